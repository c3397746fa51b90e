"""Motion along guards and sliding against closed forms and independent computations."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from shipped import MODELS

import hsdsl
from hsdsl.analysis.lint import lint, selected

METHODS = ["taylor", "dopri5", "radau"]
ENGINES = ["python", "c"]


def ball(
    flow: str, reset: str, further: str = "", guard: str = "h <= 0", states: str = "x: 0, h: 1, u: 1, v: 0"
) -> str:
    return f"""
hsdsl: 1
parameters: {{e: 1/2}}
modes:
  fly: {{flow: {{{flow}}}, transitions: [{{name: bounce, when: h <= 0, to: fly, reset: {{{reset}}}}}{further}]}}
  off: {{flow: {{x: u, h: v, u: 0, v: -9.81}}}}
initial: {{mode: fly, {states}}}
experiment: {{until: 4}}
"""


TABLE = ball("x: u, h: v, u: 0, v: -9.81", "v: -e*v", ", {name: edge, when: x >= 1.5, to: off}",
             states="x: 0, h: 1, u: 0.5, v: 0")  # fmt: skip


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_ball_rolls_to_the_edge_of_a_table(method: str, engine: str) -> None:
    run = hsdsl.loads(TABLE).simulate(method=method, engine=engine, tolerance=1e-11)
    assert run.transitions[0].time == pytest.approx(0.451523640985731, abs=1e-10)
    assert any("Zeno at t = 1.354570923" in reason for reason in run.verdict.reasons)
    assert (run.transitions[-1].edge, run.transitions[-1].time) == ("edge", pytest.approx(3, abs=1e-9))
    assert run.final.state["h"] == pytest.approx(-9.81 / 2, abs=1e-8)
    assert run.verdict.theorem == "left"


@pytest.mark.parametrize("engine", ENGINES)
def test_friction_takes_its_share_of_the_pressing_force(engine: str) -> None:
    """Impulses mu (1 + e) |v| slow the ball before the Zeno point as mu g does behind it: u = 1 - mu g t throughout."""
    text = ball("x: u, h: v, u: 0, v: -9.81", "v: -e*v, u: u + 0.1*(1 + e)*v", states="x: 0, h: 0, u: 1, v: 1")
    run = hsdsl.loads(text).simulate(until=0.9, engine=engine, tolerance=1e-12)
    contact = 2 / 9.81 * 2  # 1 + 1/2 + 1/4 + ... flights of 2 v/g
    assert run.final.time > contact
    expected = 1 - 0.1 * (9.81 * 0.9 - 1 + 0)
    assert run.final.state["u"] == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_mass_on_a_shaken_table_is_carried_and_thrown(method: str, engine: str) -> None:
    """In contact until the table's acceleration is -g: A w^2 sin(w t) = g; then a flight from there."""
    text = """
hsdsl: 1
parameters: {A: 0.2, w: 8, e: 0.3}
modes:
  a:
    flow: {h: v, v: -9.81}
    transitions: [{when: h <= A*sin(w*t), to: a, reset: {v: -e*v + (1 + e)*A*w*cos(w*t)}}]
initial: {mode: a, h: 0, v: A*w}
experiment: {until: 0.3}
"""
    run = hsdsl.loads(text).simulate(method=method, engine=engine, tolerance=1e-12)
    free = math.asin(9.81 / (0.2 * 64)) / 8
    assert run.times[run.arcs[1].first] == pytest.approx(free, abs=1e-10)
    flown = 0.3 - free
    height = 0.2 * math.sin(8 * free) + 1.6 * math.cos(8 * free) * flown - 9.81 * flown**2 / 2
    assert run.final.state["h"] == pytest.approx(height, abs=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
def test_two_bodies_stay_together_until_they_are_pulled_apart(engine: str) -> None:
    """Pressed together by a force that turns at t = 2: both move with the mean acceleration, then part."""
    text = """
hsdsl: 1
parameters: {m: 2, e: 0.4}
modes:
  a:
    flow: {x: v, y: w, v: 2 - t, w: 0}
    transitions:
      - {when: x >= y, to: a, reset: {v: (m*v + w - e*(v - w))/(1 + m), w: (m*v + w + m*e*(v - w))/(1 + m)}}
initial: {mode: a, x: 0, y: 0, v: 0, w: 0}
experiment: {until: 3}
"""
    run = hsdsl.loads(text).simulate(engine=engine, tolerance=1e-12)
    speed = 2 / 3 * (2 * 2 - 2)  # of both at t = 2
    place = 2 / 3 * (4 - 8 / 6)
    assert run.final.state["w"] == pytest.approx(speed, abs=1e-10)
    assert run.final.state["y"] == pytest.approx(place + speed, abs=1e-10)
    assert run.final.state["x"] == pytest.approx(place + speed - 1 / 6, abs=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_body_on_a_curved_guard_is_a_pendulum(method: str, engine: str) -> None:
    """Energy and the distance from the centre stay as they are on a circle from inside."""
    text = """
hsdsl: 1
parameters: {e: 1/2}
modes:
  a:
    flow: {x: u, y: v, u: 0, v: -1}
    transitions:
      - when: x**2 + y**2 >= 1
        to: a
        reset: {u: u - (1 + e)*(x*u + y*v)*x/(x**2 + y**2), v: v - (1 + e)*(x*u + y*v)*y/(x**2 + y**2)}
initial: {mode: a, x: sin(1), y: -cos(1), u: 0, v: 0}
experiment: {until: 20}
"""
    run = hsdsl.loads(text).simulate(method=method, engine=engine, tolerance=1e-11)
    x, y, u, v = (run.final.state[name] for name in "xyuv")
    assert len(run.transitions) == 0
    assert math.hypot(x, y) == pytest.approx(1, abs=1e-8)
    assert (u * u + v * v) / 2 + y == pytest.approx(-math.cos(1), abs=1e-8)


def sliding(modes: str, initial: str, until: float, **arguments: Any) -> Any:
    text = (
        f"hsdsl: 1\nmodes:\n{modes}\ninitial: {{mode: a, {initial}}}\nexperiment: {{until: {until}, completion: auto}}"
    )
    return hsdsl.loads(text).simulate(**arguments)


FRICTION = """
  a: {flow: {x: v, v: -x - 1}, transitions: [{when: v <= 0, to: b}]}
  b: {flow: {x: v, v: -x + 1}, transitions: [{when: v >= 0, to: a}]}"""
CIRCLE = """
  a: {flow: {x: x - Q*y, y: y + Q*x}, transitions: [{when: x**2 + y**2 >= 1, to: b}]}
  b: {flow: {x: -x**2 - 3*y, y: -x*y + 3*x}, transitions: [{when: x**2 + y**2 <= 1, to: a}]}"""
RELAY = """
  a: {flow: {x: -3*x + y - 1, y: -3*x + z + 1.2, z: -2*x - 1}, transitions: [{when: x <= 0, to: b}]}
  b: {flow: {x: -3*x + y + 1, y: -3*x + z - 1.2, z: -2*x + 1}, transitions: [{when: x >= 0, to: a}]}"""


@pytest.mark.parametrize(
    ("method", "engine"), [("radau", ENGINES[-1]), *((method, engine) for method in METHODS[:2] for engine in ENGINES)]
)
def test_friction_oscillator_sticks(method: str, engine: str) -> None:
    run = sliding(FRICTION, "x: 12, v: 6", 30, method=method, engine=engine, tolerance=1e-13)
    assert run.transitions[-1].time == pytest.approx(22.423556350709, abs=1e-10)
    assert run.final.state["x"] == pytest.approx(15 - math.sqrt(205), abs=1e-9)
    assert run.final.mode == "sliding_a_b" and run.verdict.theorem == "left"
    assert any("sliding between a and b from t = 22.42355635 to t = 30" in reason for reason in run.verdict.reasons)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_sliding_on_a_circle_with_a_tangential_exit(method: str, engine: str) -> None:
    modes, exit = CIRCLE.replace("Q", "1"), 1.053969730783829
    run = sliding(modes, "x: 1/2, y: 0", exit + 0.5, method=method, engine=engine, tolerance=1e-12)
    assert [t.time for t in run.transitions] == pytest.approx([math.log(2), exit], abs=1e-10)
    assert (run.final.state["x"], run.final.state["y"]) == pytest.approx(
        (-1.445130245113728, 0.102481186329294), abs=1e-10
    )
    start = "x: cos(-1.5)/2, y: sin(-1.5)/2"
    run = sliding(CIRCLE.replace("Q", "2"), start, 1.5, method=method, engine=engine, tolerance=1e-12)
    assert [t.time for t in run.transitions] == pytest.approx([math.log(2), 1.335949117872369], abs=1e-10)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("start", [-0.2, -2.5])
def test_a_ball_comes_to_rest_beside_a_sliding(start: float, method: str, engine: str) -> None:
    """Flights of 1, 2/3, 4/9, ... end at t = 2.5; sliding begins before or behind that, with y' = 1 + 2 (1 - w)/3."""
    modes = """
  a: {flow: {x: 1, h: v, v: -8, y: 1}, transitions: [
    {when: x >= t/4, to: b}, {name: hit, when: h <= 0, to: a, reset: {v: -2*v/3}}]}
  b: {flow: {h: v, v: -8, x: -2, y: 3}, transitions: [
    {when: x <= t/4, to: a}, {name: hit, when: h <= 0, to: b, reset: {v: -2*v/3}}]}"""
    run = sliding(modes, f"x: {start}, y: 0, h: 1, v: 0", 5, method=method, engine=engine, tolerance=1e-11)
    begins = -start / (1 - 1 / 4)
    assert run.stop.reason == "until" and run.final.mode == "sliding_a_b"
    assert run.final.state["y"] == pytest.approx(begins + 1.5 * (5 - begins), abs=1e-9)
    assert [run.final.state[name] for name in "xhv"] == pytest.approx([5 / 4, 0, 0], abs=1e-9)
    assert run.verdict.theorem == "left" and any("along the guard of hit" in reason for reason in run.verdict.reasons)


SET_POINT = """
hsdsl: 1
inputs: {{w: {{times: [0, 1, 2], values: {values}, hold: {hold}}}}}
modes:
  a: {{flow: {{x: 1, y: 1}}, transitions: [{{when: x >= w, to: b}}]}}
  b: {{flow: {{x: -{back}, y: 4}}, transitions: [{{when: x <= w, to: a}}]}}
initial: {{mode: a, x: {x}, y: 0}}
experiment: {{until: 3, completion: auto}}
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("hold", "values", "back", "x", "right"),
    [
        # w' is 0.4, -3 and 0: the share of b is (1 - w')/6, then 2/3 and 1/6
        ("linear", [0, 0.4, -2.6], 5, -0.3, (-2.6, 0.5 + 0.5 * 1.3 + 3 + 1.5)),
        # b cannot follow -3: it meets w again at t = 2.5
        ("linear", [0, 0.4, -2.6], 2, -0.3, (-2.6, 0.5 + 0.5 * 1.6 + 6 + 0.5 * 2)),
        # a catches up 0.5 behind the first jump, b 0.4 behind the second one
        ("zero", [0, 0.5, -0.3], 2, -0.5, (-0.3, 0.5 + 1 + 0.5 + 1 + 1.6 + 1.2)),
        ("zero", [0, 1e-5, -1e-5], 2, -0.5, (-1e-5, 0.5 + 1 + 1e-5 + 2 * (1 - 1e-5) + 4e-5 + 2 * (1 - 1e-5))),
    ],
)
def test_sliding_follows_a_surface_that_a_sampled_input_moves(
    hold: str, values: list[float], back: float, x: float, right: tuple[float, float], method: str, engine: str
) -> None:
    model = hsdsl.loads(SET_POINT.format(hold=hold, values=values, back=back, x=x))
    run = model.simulate(method=method, engine=engine)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    assert (run.final.state["x"], run.final.state["y"]) == pytest.approx(right, abs=1e-8)


def test_a_surface_that_moves_with_a_ramp_of_samples_is_not_written() -> None:
    model = hsdsl.loads(SET_POINT.format(hold="linear", values=[0, 1, 0], back=2, x=-0.3))
    with pytest.raises(hsdsl.UsageError, match="moves with the sampled input w"):
        model.completed()


@pytest.mark.parametrize("engine", ENGINES)
def test_sliding_stays_on_a_surface_that_switches_of_time_move(engine: str) -> None:
    modes = """
  a: {flow: {x: 1, y: 1}, transitions: [{when: x >= 0.4*floor(t) + abs(t - 2.5)/4, to: b}]}
  b: {flow: {x: -3, y: 3}, transitions: [{when: x <= 0.4*floor(t) + abs(t - 2.5)/4, to: a}]}"""
    run = sliding(modes, "x: 0.625, y: 0", 3.5, engine=engine, tolerance=1e-11)
    # two jumps are met again after 0.4/(5/4) each; behind the third one the rest of the run is too short for that
    caught, falling, rising = 2 * 0.4 / 1.25, 1 + 2 * 5 / 16, 1 + 2 * 3 / 16
    right = falling * (2.5 - caught) + caught + rising * 0.5 + 0.5
    assert run.final.state["y"] == pytest.approx(right, abs=1e-8)


def test_long_sliding_on_a_curve_does_not_drift() -> None:
    """Two flows press on the circle from both sides for ever, and turn along it."""
    modes = """
  a: {flow: {x: x - 3*y, y: y + 3*x}, transitions: [{when: x**2 + y**2 >= 1, to: b}]}
  b: {flow: {x: -x - 2*y, y: -y + 2*x}, transitions: [{when: x**2 + y**2 <= 1, to: a}]}"""
    run = sliding(modes, "x: 1/2, y: 0", 1000, tolerance=1e-6)
    assert math.hypot(run.final.state["x"], run.final.state["y"]) == pytest.approx(1, abs=1e-6)


def test_relay_slides_in_each_half_period() -> None:
    run = sliding(RELAY, "x: 0.5, y: 0.3, z: 0.2", 9, tolerance=1e-12)
    times = [0.41637324, 2.77740629, 5.25590496, 5.83345647, 8.80617843]
    assert [t.time for t in run.transitions] == pytest.approx(times, abs=1e-8)


def test_on_a_belt_the_border_case_does_not_stick_again() -> None:
    """Friction 0.4 on a belt of speed 0.1 from (0, 0.1): sticks for 4, then touches the belt's speed once in 2 pi."""
    modes = """
  a: {flow: {x: v, v: -x + 0.4}, transitions: [{when: v >= 0.1, to: b}]}
  b: {flow: {x: v, v: -x - 0.4}, transitions: [{when: v <= 0.1, to: a}]}"""
    run = sliding(modes, "x: 0, v: 0.0", 4.5, tolerance=1e-12)
    assert run.transitions[0].time == pytest.approx(math.asin(0.25), abs=1e-10)
    assert run.transitions[1].time == pytest.approx(4.12566360134949554, abs=1e-9)


def test_sliding_on_an_intersection_is_refused_with_its_reason() -> None:
    """Four quadrants that all press on the origin: no rule gives one flow there."""
    modes = "".join(
        f"\n  {name}: {{flow: {{x: {-sx}, y: {-sy}}}, transitions: ["
        f"{{when: x {'<=' if sx > 0 else '>='} 0, to: {across}}}, {{when: y {'<=' if sy > 0 else '>='} 0, to: {up}}}]}}"
        for name, sx, sy, across, up in (("a", 1, 1, "b", "d"), ("b", -1, 1, "a", "c"), ("c", -1, -1, "d", "b"),
                                         ("d", 1, -1, "c", "a"))
    )  # fmt: skip
    run = sliding(modes, "x: 1, y: 2", 5)
    assert run.stop.reason == "zeno" and "intersection" in run.stop.message


@pytest.mark.parametrize("back", ["-2*x**2 - 2*y**2 + 2 >= 0", "(x**2 + y**2)/3 <= 1/3", "0.1*(1 - x**2) >= 0.1*y**2"])
def test_surfaces_that_differ_by_a_factor_are_one(back: str) -> None:
    plain, other = (
        sliding(modes, "x: 1/2, y: 0", 1.5, tolerance=1e-12)
        for modes in (CIRCLE.replace("Q", "1"), CIRCLE.replace("Q", "1").replace("x**2 + y**2 <= 1", back))
    )
    assert [t.time for t in other.transitions] == pytest.approx([t.time for t in plain.transitions], abs=1e-10)
    assert {t.edge for t in other.transitions} >= {"sliding_a_b->b"}


def test_without_auto_sliding_stops_and_says_how_to_go_on() -> None:
    text = f"hsdsl: 1\nmodes:\n{FRICTION}\ninitial: {{mode: a, x: 12, v: 6}}\nexperiment: {{until: 30}}"
    run = hsdsl.loads(text).simulate()
    assert run.stop.reason == "zeno" and "sliding" in run.stop.message and "completion: auto" in run.stop.message


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", METHODS)
def test_sliding_follows_a_surface_that_moves_through_the_origin(method: str, engine: str) -> None:
    """On x = sin(2 t)/2, while the state that the surface depends on passes zero, y' = 1 + share."""
    modes = """
  a: {flow: {x: 2, y: 1}, transitions: [{when: x - sin(2*t)/2 >= 0, to: b}]}
  b: {flow: {x: -2, y: 2}, transitions: [{when: x - sin(2*t)/2 <= 0, to: a}]}"""
    run = sliding(modes, "x: 0, y: 0", 5, method=method, engine=engine, tolerance=1e-11)
    assert run.final.mode == "sliding_a_b"
    assert run.final.state["x"] == pytest.approx(math.sin(10) / 2, abs=1e-8)
    assert run.final.state["y"] == pytest.approx(1.5 * 5 - math.sin(10) / 8, abs=1e-8)


def ordinary(modes: str, initial: str, until: float) -> str:
    return f"hsdsl: 1\nmodes:{modes}\ninitial: {{mode: a, {initial}}}\nexperiment: {{until: {until}}}\n"


COMPLETED = {
    "rolls": TABLE,
    "sticks": ordinary(FRICTION, "x: 12, v: 6", 30),
    # shrinks by a third: what is left of a tail is less than the flight to come
    "rebounds by a third": ordinary("""
  a: {flow: {h: v, v: -9.81}, transitions: [
    {when: h <= 0.3*sin(5.6*t + 4), to: a, reset: {v: -v/3 + 4/3*0.3*5.6*cos(5.6*t + 4)}}]}""", "h: 0.45, v: 0", 1.2),
    # leaves a circle where the push ends, with errors of steps off it
    "falls off a dome": ordinary("""
  a: {flow: {x: u, y: v, u: 0, v: -1}, transitions: [{when: x**2 + y**2 <= 1, to: a, reset: {
    u: u - 1.3*(x*u + y*v)*x/(x**2 + y**2), v: v - 1.3*(x*u + y*v)*y/(x**2 + y**2)}}]}""",
                                 "x: sin(0.3), y: cos(0.3), u: 0, v: 0", 3.5),
    "falls where an `if` ends": ordinary("""
  a: {flow: {x: u, h: v, u: 0, v: -9.81}, transitions: [
    {when: h <= 0, if: (t <= 1.5 or x >= 9) and not (u >= 5), to: a, reset: {v: -0.4*v}}]}""",
                                         "x: 0, h: 0.1, u: 1, v: 0", 2),
    "between floor and ceiling": ordinary("""
  a: {flow: {h: v, v: 15*sin(t)}, transitions: [
    {name: floor, when: h <= 0, to: a, reset: {v: -0.3*v}}, {name: ceiling, when: h >= 1, to: a, reset: {v: -0.3*v}}]}
""", "h: 0, v: 0", 6),
    # the mode that a sliding is entered from is the last one of the file
    "slides on two surfaces": ordinary("""
  a: {flow: {x: 0.7, y: 0.8}, transitions: [{when: x >= 0, to: b}]}
  b: {flow: {x: -0.6, y: 0.5}, transitions: [{when: x <= 0, to: a}, {when: y >= 1, to: c}]}
  c:
    flow: {x: 0.8, y: -0.5}
    transitions:
      - {when: y <= 1, to: b}""", "x: -0.3, y: -0.3", 3),
    # comes to rest before it slides
    "slides beside a ball at rest": ordinary("""
  a: {flow: {x: 1, h: v, v: -8, y: 1}, transitions: [
    {when: x >= 0.4*sin(2*t), to: b}, {name: hit, when: h <= 0, to: a, reset: {v: -v/3}}]}
  b: {flow: {x: -1.5, h: v, v: -8, y: 3}, transitions: [
    {when: x <= 0.4*sin(2*t), to: a}, {name: hit, when: h <= 0, to: b, reset: {v: -v/3}}]}""",
                                             "x: -1.5, h: 0.7, v: 0, y: 0", 2.5),
    # numbers of many digits
    "slides on a curve": ordinary("""
  a: {flow: {x: 0.7654321, y: 0.912345}, transitions: [{when: y - 0.34567*sin(1.2345*x) >= 0, to: b}]}
  b: {flow: {x: 0.6543217, y: -0.512349}, transitions: [{when: y - 0.34567*sin(1.2345*x) <= 0, to: a}]}""",
                                  "x: 0, y: -1", 3),
    # rest one after the other; each is thrown up while the other one rests
    "two balls on tables that shake": ordinary("""
  a: {flow: {x: u, h: v, u: 0.1, v: -1, k: w, w: -1.2}, transitions: [
    {name: one, when: h <= 0.3*sin(2*t), to: a, reset: {v: -v/4 + 5/4*0.6*cos(2*t)}},
    {name: two, when: k <= 0.2*sin(3*t), to: a, reset: {w: -w/5 + 6/5*0.6*cos(3*t)}},
    {name: back, when: x >= 0.4, to: a, reset: {x: -0.4}}]}""",
                                              "x: 0, h: 0.02, u: 0.5, v: 0, k: 0.01, w: 0", 6),
    "slides on a belt whose speed changes": ordinary("""
  a: {flow: {x: v, v: -x + 0.4}, transitions: [{when: v - 0.1*cos(t) >= 0, to: b}]}
  b: {flow: {x: v, v: -x - 0.4}, transitions: [{when: v - 0.1*cos(t) <= 0, to: a}]}""", "x: 0, v: 0", 5),
}  # fmt: skip


@pytest.mark.parametrize("name", COMPLETED)
def test_completed_text_is_an_ordinary_model_with_the_same_execution(name: str) -> None:
    model = hsdsl.loads(COMPLETED[name])
    written = model.completed()
    assert written is not None
    run = hsdsl.loads(written).simulate(completion="none", tolerance=1e-12)
    expected = model.simulate(completion="auto", tolerance=1e-12)
    assert run.stop.reason == expected.stop.reason == "until"
    assert expected.verdict.theorem == "left"
    for state, value in expected.final.state.items():
        assert run.final.state[state] == pytest.approx(value, abs=2e-5)


@pytest.mark.parametrize("name", ["stick-slip", "zeno-ball", "relay"])
def test_completed_text_is_clean_and_complete(name: str) -> None:
    """What remains is a transition of the file that never fires, since sliding goes before it."""
    model = hsdsl.load(MODELS / "gallery" / f"{name}.yaml")
    written = model.completed()
    assert written is not None
    assert name == "zeno-ball" or hsdsl.loads(written).completed() is None
    rules = selected(["HS42", "HS50"])
    codes = {
        found.code for found in lint(Path("m.yaml"), rules, text=written.encode()).findings if found.severity != "note"
    }
    assert codes <= ({"HS427"} if name == "relay" else set())


def test_completed_text_keeps_comments_and_style(tmp_path: Any) -> None:
    text = """# mine
hsdsl: 1
parameters:
  g: 9.81  # gravity
modes:
  fly:
    flow: {h: v, v: -g + sin(h)}
    transitions:
      - when: h <= 0  # floor
        to: fly
        reset: {v: -v/2}
        # bounces

# begins in the air
initial: {mode: fly, h: 1, v: 0}
experiment: {until: 5}
"""
    written = hsdsl.loads(text).completed()
    assert written is not None and "# gravity" in written and "# floor" in written and written.startswith("# mine\n")
    assert "# bounces\n      - {when:" in written and "\n\n# begins in the air\ninitial:" in written
    assert "contact_time: 1e-06" in written and "  contact_fly:\n" in written
    assert hsdsl.loads(written).system.modes[1].name == "contact_fly"


def test_the_time_of_contact_is_a_share_of_short_runs() -> None:
    text = ordinary(
        """
  a: {flow: {h: v, v: -g}, transitions: [{when: h <= 0, to: a, reset: {v: -v/2}}]}""",
        "h: 0, v: g*T/3",
        1,
    )
    text = text.replace("modes:", "parameters: {T: 4e-9, g: 2/T**2}\nmodes:").replace("until: 1}", "until: 2*T}")
    written = hsdsl.loads(text).completed()
    assert written is not None and "contact_time: 8e-15" in written
    assert abs(hsdsl.loads(written).simulate(completion="none").final["h"]) < 1e-9


def test_resets_that_leave_the_guard_keep_nothing_on_it() -> None:
    """A clock that counts, a level that is filled up, a place that is another one modulo 2."""
    text = ordinary(
        """
  a: {flow: {s: 3, x: -x, y: u, u: -y}, transitions: [
    {when: s >= 2, to: a, reset: {s: 0, x: x + 1}}, {when: x <= 0.3, to: a, reset: {x: 2}},
    {when: y >= 1, to: a, reset: {y: y - 2}}]}""",
        "s: 0, x: 1, y: 0, u: 2",
        3,
    )
    assert hsdsl.loads(text).completed() is None


@pytest.mark.parametrize("flow", ["y - 1/2 <= x", "2*y <= 2*x + 1"])
def test_bodies_that_press_on_each_other_have_no_text(flow: str) -> None:
    """A box on a box on the floor; a floor and a ceiling are never met together."""
    text = ordinary(
        f"""
  a: {{flow: {{x: v, v: -1, y: w, w: -1}}, transitions: [
    {{name: floor, when: x <= 0, to: a, reset: {{v: -v/2}}}},
    {{name: boxes, when: {flow}, to: a, reset: {{v: (v + w)/2, w: (v + w)/2}}}}]}}""",
        "x: 0, v: 0, y: 1, w: 0",
        3,
    )
    with pytest.raises(hsdsl.UsageError, match="the guards of floor and boxes may hold together and press"):
        hsdsl.loads(text).completed()


def test_long_transitions_are_written_a_line_for_each_key() -> None:
    written = hsdsl.load(MODELS / "gallery" / "stick-slip.yaml").completed()
    assert written is not None and max(map(len, written.splitlines())) <= 120
    assert "\n        to: sliding_slower_faster\n        priority: 1\n" in written


def test_nothing_to_complete_is_said(tmp_path: Any, capsys: Any) -> None:
    from hsdsl.interface.cli.verbs import obey

    path = tmp_path / "m.yaml"
    path.write_text("hsdsl: 1\nmodes: {a: {flow: {x: 1}}}\ninitial: {mode: a, x: 0}\nexperiment: {until: 1}\n")
    assert obey(["complete", str(path)]) == 2
    assert "nothing to complete" in capsys.readouterr().err
    assert obey(["complete", str(path), "--out", str(path)]) == 2
    assert "this is the model itself" in capsys.readouterr().err


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("height", "count"), [("2", 46), ("1", 46), ("1.1", 46)])
def test_two_balls_come_to_rest_one_after_the_other_or_together(height: str, count: int, engine: str) -> None:
    text = f"""
hsdsl: 1
modes:
  a:
    flow: {{h: v, v: -1, k: w, w: -1, x: 1}}
    transitions:
      - {{name: one, when: h <= 0, to: a, reset: {{v: -v/2}}}}
      - {{name: two, when: k <= 0, to: a, reset: {{w: -w/2}}}}
initial: {{mode: a, h: 1, v: 0, k: {height}, w: 0, x: 0}}
experiment: {{until: 10}}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "until" and len(run.transitions) == count
    assert [run.final.state[name] for name in "hvkwx"] == pytest.approx([0, 0, 0, 0, 10], abs=1e-9)
    for name in ("one", "two"):
        assert any(f"motion along the guard of {name}" in reason for reason in run.verdict.reasons)


@pytest.mark.parametrize("engine", ENGINES)
def test_guards_that_press_on_each_other_come_to_rest_together(engine: str) -> None:
    """A ball on a ball on the floor: what presses on the floor depends on the contact above."""
    text = """
hsdsl: 1
modes:
  a:
    flow: {x: v, v: -1, y: w, w: -1}
    transitions:
      - {name: floor, when: x <= 0, to: a, reset: {v: -v/2}}
      - {name: balls, when: x >= y, to: a, reset: {v: (v + w)/2, w: (v + w)/2}}
initial: {mode: a, x: 0, v: 0, y: 1, w: 0}
experiment: {until: 10}
"""
    run = hsdsl.loads(text).simulate(max_transitions=1000, engine=engine)
    assert run.verdict.theorem == "left" and run.stop.reason == "until"
    assert [run.final.state[name] for name in "xvyw"] == pytest.approx([0] * 4, abs=1e-9)


COUNTING = """
hsdsl: 1
modes:
  a:
    flow: {x: v, v: -1, n: 0, m: MORE}
    domain: [WALL]
    transitions: [{name: hit, when: x <= 0, to: a, reset: {v: VELOCITY, n: RESET, m: m + n}}]
initial: {mode: a, x: 1, v: 0, n: 1, m: 0}
experiment: {until: 6, max_transitions: 200}
"""


@pytest.mark.parametrize(
    ("more", "wall", "velocity", "reset", "limit"),
    [
        ("0", "t <= 9", "-v/2", "n + 1", True),
        ("0", "t <= 9", "-v/2", "1e-12 + n", True),
        ("0", "t <= 9", "-v/2", "-n", True),
        ("0", "t <= 9", "-v/2", "2*n", True),
        ("n", "t <= 9", "-v/2", "n + 1", False),  # a flow depends on it
        ("0", "n <= 1e6", "-v/2", "n + 1", False),
        ("0", "t <= 9", "-v*n/(n + 1)", "n + 1", False),
    ],
)
def test_what_nothing_depends_on_needs_no_limit(more: str, wall: str, velocity: str, reset: str, limit: bool) -> None:
    names = {"MORE": more, "WALL": wall, "VELOCITY": velocity, "RESET": reset}
    text = COUNTING
    for name, value in names.items():
        text = text.replace(name, value)
    run = hsdsl.loads(text).simulate()
    assert (run.stop.reason == "until" and abs(run.final["x"]) < 1e-9) == limit
    assert any("n, m has no limit, and keeps its value" in reason for reason in run.verdict.reasons) == limit


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("before", [0, 1e-8, 3e-7, 9e-7])
def test_zeno_point_just_behind_the_end(before: float, engine: str) -> None:
    """Flights of 1, 1/2, 1/4, ... end at t = 3."""
    run = hsdsl.loads(ROLLING).simulate(until=3 - before, engine=engine)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    assert run.final.state["x"] == pytest.approx(3 - before, abs=1e-9)
    assert abs(run.final.state["h"]) < 1e-11


ROLLING = """
hsdsl: 1
modes:
  fly: {flow: {x: 1, h: v, v: -2}, transitions: [{when: h <= 0, to: fly, reset: {v: -v/2}}]}
initial: {mode: fly, x: 0, h: 1, v: 0}
experiment: {until: 3}
"""


def test_derivatives_go_through_sliding() -> None:
    text = f"hsdsl: 1\nparameters: {{mu: 1}}\nmodes:\n{FRICTION.replace('1}', 'mu}')}\n"
    text += "initial: {mode: a, x: 12, v: 6}\nexperiment: {until: 30, completion: auto}"
    model, small = hsdsl.loads(text), 1e-5
    slopes: Any = model.sensitivity("mu,initial.x").final.state["x"]
    for name, group, at in (("mu", "parameters", {"mu": 1.0}), ("initial.x", "initial", {"x": 12.0})):
        (key, value), ends = next(iter(at.items())), []
        for sign in (1, -1):
            arguments: Any = {group: {key: value + sign * small}, "tolerance": 1e-13}
            ends.append(model.simulate(**arguments).final.state["x"])
        assert slopes[name] == pytest.approx((ends[0] - ends[1]) / (2 * small), abs=1e-8)


def test_written_sliding_is_no_longer_than_it_has_to_be() -> None:
    """Multiplied out, its flow would have 4,100 characters; that of others more than an expression may have."""
    outside = "y: -0.6*y - sin(y + 1.8*t)/2 - 0.4*x*y"
    text = f"""
hsdsl: 1
modes:
  a:
    flow: {{x: 2 - 1.4*x, "{outside} + y**2/4 - x**2/8 - 1.4*cos(2*y)"}}
    transitions: [{{when: x >= 0.4*sin(2*y) + 0.5, to: b}}]
  b:
    flow: {{x: -2 - 1.4*x, "{outside} + 1.4*cos(2*y)"}}
    transitions: [{{when: x <= 0.4*sin(2*y) + 0.5, to: a}}]
initial: {{mode: a, x: -0.5, y: -0.5}}
experiment: {{until: 3, completion: auto}}
""".replace('"y: ', 'y: "')
    model = hsdsl.loads(text)
    written = model.completed()
    assert written is not None
    assert max(map(len, written.splitlines())) < 1000
    run, again = model.simulate(tolerance=1e-11), hsdsl.loads(written).simulate(tolerance=1e-11)
    assert [made.edge for made in run.transitions] == [made.edge for made in again.transitions]
    assert again.final.state == pytest.approx(run.final.state, rel=1e-9)
