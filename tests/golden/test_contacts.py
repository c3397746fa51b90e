"""Bodies that guards hold together, and large models of them, against closed forms."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from engines import assert_engines_agree

import hsdsl
from hsdsl.mathematics.completion.constrained import constrained_mode
from hsdsl.mathematics.completion.nearby import size

ENGINES = ["python", "c"]
TOWER = """
hsdsl: 1
parameters: {{m: 2, e: 0.4}}
modes:
  a:
    flow: {{x: v, y: w, v: -1 + {lift}, w: -1 + {pull}}}
    transitions:
      - {{name: floor, when: x <= 0, to: a, reset: {{v: -e*v}}}}
      - name: bodies
        when: y <= x
        to: a
        reset: {{v: (m*v + w - e*(v - w))/(1 + m), w: (m*v + w + m*e*(v - w))/(1 + m)}}
initial: {{mode: a, x: 0, y: 0, v: 0, w: 0}}
experiment: {{until: 3}}
"""


def tower(lift: str, pull: str, **arguments: Any) -> Any:
    return hsdsl.loads(TOWER.format(lift=lift, pull=pull)).simulate(tolerance=1e-12, **arguments)


@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
@pytest.mark.parametrize("engine", ENGINES)
def test_body_on_a_body_on_the_floor_rests_exactly_until_either_is_lifted(engine: str, method: str) -> None:
    """The upper one leaves where its own force is its weight; both where the forces on both are their weight."""
    run = tower("0", "t/2", engine=engine, method=method)
    assert run.final.state["x"] == run.final.state["v"] == 0
    assert run.final.state["w"] == pytest.approx(1 / 4, abs=1e-10)
    assert run.final.state["y"] == pytest.approx(1 / 12, abs=1e-10)
    run = tower("t", "0", engine=engine, method=method)  # (2 (t - 1) - 1)/3 from t = 3/2 on
    assert run.final.state["x"] == pytest.approx(3 / 8, abs=1e-10)
    assert run.final.state["y"] == pytest.approx(3 / 8, abs=1e-10)
    assert run.final.state["w"] == pytest.approx(3 / 4, abs=1e-10)
    assert any("at rest on the guard of bodies from t = 0 to t = 1.5" in reason for reason in run.verdict.reasons)


def test_body_that_lands_on_others_at_rest_stays() -> None:
    """Two bodies that rest on each other at 0 are off each other by round-off of where they fell from."""
    text = """
hsdsl: 1
modes:
  a:
    flow:
      {x: u, y: v, z: w, u: 19.443*sin(5*t + 0.7) - 9.81, v: 2.443*sin(2*t + 0.7) - 9.81, w: 10.124*sin(t + 0.7) - 9.81}
    transitions:
      - {name: floor, when: x <= 0, to: a, reset: {u: 0}}
      - {name: low, when: y <= x, to: a, reset: {u: (u + v)/2, v: (u + v)/2}}
      - {name: high, when: z <= y, to: a, reset: {v: (4*v + w)/5, w: (4*v + w)/5}}
initial: {mode: a, x: 0, u: 0, y: 0.3, v: 0, z: 0.3, w: 0}
experiment: {until: 1.6}
"""
    run = hsdsl.loads(text).simulate(tolerance=1e-8)
    assert run.stop.reason == "until"
    assert sum(made.edge == "high" and made.time > 1.5 for made in run.transitions) > 1
    assert list(run.final.state.values()) == pytest.approx([0] * 6, abs=1e-8)


@pytest.mark.parametrize("engine", ENGINES)
def test_forces_that_are_not_one_choice_end_the_run(engine: str) -> None:
    """Each of two guards takes back twice what the other takes back of its own: alone or together, either holds."""
    text = """
hsdsl: 1
modes:
  a:
    flow: {x: v, y: w, v: 1, w: 1}
    transitions:
      - {name: one, when: x >= 0, to: a, reset: {v: -v/2, w: w - 3*v}}
      - {name: two, when: y >= 0, to: a, reset: {w: -w/2, v: v - 3*w}}
initial: {mode: a, x: 0, y: 0, v: 0, w: 0}
experiment: {until: 1}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "zeno"
    assert "among them that of one, and no single motion along them is known" in run.stop.message


def many(n: int, springs: str = "") -> str:
    """Masses that fall on tables of their own; ``springs`` between neighbours."""

    def pull(i: int) -> str:
        pulls = [f"x{j} - x{i}" for j in (i - 1, i + 1) if 0 <= j < n]
        return f" + {springs}*({' + '.join(pulls)})" if springs and pulls else ""

    flow = "".join(f"      x{i}: v{i}\n      v{i}: -1{pull(i)}\n" for i in range(n))
    stops = "".join(f"      - {{name: s{i}, when: x{i} <= 0, to: a, reset: {{v{i}: -v{i}/2}}}}\n" for i in range(n))
    start = "".join(f", x{i}: {Fraction(1 + i * 7 % 11, 22) + Fraction(i, 50 * n)}, v{i}: 0" for i in range(n))
    return (
        f"hsdsl: 1\nmodes:\n  a:\n    flow:\n{flow}    transitions:\n{stops}"
        f"initial: {{mode: a{start}}}\nexperiment: {{until: 4}}\n"
    )


LARGE = [pytest.param(50, marks=pytest.mark.slow), pytest.param(200, marks=pytest.mark.campaign)]


@pytest.mark.parametrize("n", [6, *LARGE])
def test_masses_come_to_rest_one_after_another(n: int) -> None:
    """A fall from h and bounces of half the speed end at 3 sqrt(2 h)."""
    run = hsdsl.loads(many(n)).simulate(tolerance=1e-9)
    assert run.stop.reason == "until"
    assert all(abs(run.final.state[f"x{i}"]) <= 1e-12 for i in range(n))
    ends = {reason.split(" of s")[1].split()[0]: float(reason.split("t = ")[1].split(":")[0])
            for reason in run.verdict.reasons if reason.startswith("Zeno at")}  # fmt: skip
    for i in range(n):
        height = (1 + i * 7 % 11) / 22 + i / (50 * n)
        assert ends[str(i)] == pytest.approx(3 * (2 * height) ** 0.5, abs=1e-6)
    assert sum("the guard of s0 " in reason for reason in run.verdict.reasons) <= 3


def test_engines_agree_on_masses_with_springs_and_towers() -> None:
    arguments: dict[str, Any] = {"tolerance": 1e-6, "max_transitions": 100, "relaxation": 1e-2}
    for scheme in ("located", "relaxed"):
        assert_engines_agree(hsdsl.loads(many(3, "3/2")), until=2, scheme=scheme, **arguments)
        text = TOWER.format(lift="t/2", pull="t/3")
        assert_engines_agree(hsdsl.loads(text), scheme=scheme, **arguments)


@pytest.mark.parametrize("engine", ENGINES)
def test_stack_of_bodies_rests_and_leaves_from_the_top(engine: str) -> None:
    """Inelastic bodies of one mass: body i is lifted by i t/8, and each leaves at 8/i, the topmost first."""
    n = 4
    flow = ", ".join(f"x{i}: v{i}, v{i}: -1 + {i}*t/8" for i in range(n))
    pairs = "".join(
        f"      - {{name: c{i}, when: x{i} <= x{i - 1}, to: a, reset: {{v{i}: (v{i} + v{i - 1})/2, "
        f"v{i - 1}: (v{i} + v{i - 1})/2}}}}\n" for i in range(1, n)
    )  # fmt: skip
    start = "".join(f", x{i}: 0, v{i}: 0" for i in range(n))
    text = (
        f"hsdsl: 1\nmodes:\n  a:\n    flow: {{{flow}}}\n    transitions:\n"
        f"      - {{name: c0, when: x0 <= 0, to: a, reset: {{v0: 0}}}}\n{pairs}"
        f"initial: {{mode: a{start}}}\nexperiment: {{until: 4}}\n"
    )
    run = hsdsl.loads(text).simulate(engine=engine, tolerance=1e-11)
    flown = 4 - 8 / 3
    assert run.final.state["x3"] == pytest.approx(3 / 8 * flown**3 / 6, abs=1e-9)
    assert [run.final.state[f"x{i}"] for i in range(3)] == [0, 0, 0]
    assert any("the guard of c2 from t = 2.6666" in reason for reason in run.verdict.reasons)


def column(n: int, restitution: str, bodies: str, until: float, conditional: bool = True) -> str:
    """Bodies of one mass above each other and a floor, as one writes them; ``bodies`` are their initial values."""
    floor, above = ("if: v0 < 0, ", "if: v{0} < v{1}, ") if conditional else ("", "")
    flow = ", ".join(f"x{i}: v{i}, v{i}: -9.81" for i in range(n))
    lines = [f"- {{name: floor, when: x0 <= 0, {floor}to: a, reset: {{v0: -e*v0}}}}"]
    for i in range(1, n):
        one, two = f"(v{i}*(1 - e) + v{i - 1}*(1 + e))/2", f"(v{i - 1}*(1 - e) + v{i}*(1 + e))/2"
        guard = f"when: x{i} <= x{i - 1}, {above.format(i, i - 1)}"
        lines.append(f"- {{name: hit{i}, {guard}to: a, reset: {{v{i}: '{one}', v{i - 1}: '{two}'}}}}")
    transitions = "\n".join(f"      {line}" for line in lines)
    return (
        f"hsdsl: 1\nparameters: {{e: {restitution}}}\nmodes:\n  a:\n    flow: {{{flow}}}\n    transitions:\n"
        f"{transitions}\ninitial: {{mode: a, {bodies}}}\nexperiment: {{until: {until}}}\n"
    )


def end_of_column(restitution: float, x: list[float], v: list[float]) -> float:
    """When two bodies above a floor come to rest, flight by flight in 60 digits: the end of both Zeno tails."""
    with mpmath.workdps(60):
        e, g, t = mpmath.mpf(str(restitution)), mpmath.mpf("9.81"), mpmath.mpf(0)
        a, b, u, w = (mpmath.mpf(str(value)) for value in (*x, *v))
        while max(abs(a), abs(b), abs(u), abs(w)) > mpmath.mpf(10) ** -16:
            floor = (u + mpmath.sqrt(u * u + 2 * g * a)) / g
            meet = (b - a) / (u - w) if u > w else mpmath.inf
            if a < mpmath.mpf(10) ** -40 and abs(u) < mpmath.mpf(10) ** -24:
                a, u = mpmath.mpf(0), mpmath.mpf(0)  # at rest on the floor until the other one comes
                floor, meet = mpmath.inf, (w + mpmath.sqrt(w * w + 2 * g * b)) / g
                t, b, w = t + meet, mpmath.mpf(0), -mpmath.sqrt(w * w + 2 * g * b)
                u, w = (u * (1 - e) + w * (1 + e)) / 2, (w * (1 - e) + u * (1 + e)) / 2
                continue
            s = min(floor, meet)
            t, a, b, u, w = t + s, a + u * s - g * s * s / 2, b + w * s - g * s * s / 2, u - g * s, w - g * s
            if meet <= floor:
                b, u, w = a, (u * (1 - e) + w * (1 + e)) / 2, (w * (1 - e) + u * (1 + e)) / 2
            else:
                a, u = mpmath.mpf(0), -e * u
        return float(t)


@pytest.mark.parametrize("conditional", [False, True])
def test_bodies_that_bounce_on_each_other_come_to_rest_together(conditional: bool) -> None:
    """Tails of two edges in turn, one of them inside the other's flights, end where resets in turn lead."""
    text = column(2, "0.2", "x0: 0.33, v0: -0.01, x1: 0.83, v1: 0.3", 4, conditional)
    run = assert_engines_agree(hsdsl.loads(text))
    right = end_of_column(0.2, [0.33, 0.83], [-0.01, 0.3])
    assert run.stop.reason == "until"
    assert run.verdict.theorem == "left"
    assert [run.final.state[name] for name in ("v0", "v1")] == [0, 0]
    assert [run.final.state[name] for name in ("x0", "x1")] == pytest.approx([0, 0], abs=1e-15)
    rests = [reason for reason in run.verdict.reasons if reason.startswith("at rest on the guard of hit1 from t = ")]
    assert float(rests[0].split("t = ")[1].split()[0]) == pytest.approx(right, abs=4e-6)  # the relaxation


@pytest.mark.parametrize("seed", range(12))
def test_columns_come_to_rest_and_elastic_ones_do_not(seed: int) -> None:
    r = random.Random(f"column {seed}")
    n, bodies, height, energy = r.choice((2, 3, 4)), list[str](), 0.0, 0.0
    for i in range(n):
        height, speed = round(height + r.uniform(0.1, 1), 2), round(r.uniform(-1, 1), 2)
        bodies.append(f"x{i}: {height}, v{i}: {speed}")
        energy += speed**2 / 2 + 9.81 * height
    model = hsdsl.loads(column(n, r.choice(("0.2", "0.5", "0.7")), ", ".join(bodies), 5, r.random() < 0.5))
    last = model.simulate().final.state
    assert max(map(abs, last.values())) < 1e-12
    last = model.simulate(parameters={"e": 1}, until=2).final.state
    kept = sum(float(last[f"v{i}"]) ** 2 / 2 + 9.81 * float(last[f"x{i}"]) for i in range(n))
    assert kept == pytest.approx(energy, rel=1e-7)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "condition", ["v < 0", "v <= 0", "v < 0 and t < 3", "not v >= 0", "v < 1e-3*(3 - t)", "v < 0 or t < 3"]
)
def test_an_if_counts_as_what_it_is_next_along_the_flow(engine: str, condition: str) -> None:
    """A ball at rest is pressed to fall; where its `if` ends it does."""
    text = f"""
hsdsl: 1
modes:
  a: {{flow: {{x: v, v: -1}}, transitions: [{{when: x <= 0, if: {condition}, to: a, reset: {{v: -v/5}}}}]}}
initial: {{mode: a, x: 1, v: 0}}
experiment: {{until: 4}}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    falls = -0.5 if "t)" in condition or " and " in condition else 0
    assert run.final.state["x"] == pytest.approx(falls, abs=1e-9)


@pytest.mark.parametrize(
    ("floor", "speed", "right"),
    [
        ("A*sin(w*t)", "A*w*cos(w*t)", 0.1 * math.sin(21)),
        ("0.1*exp(-t)", "-0.1*exp(-t)", 0.1 * math.exp(-3)),
        ("t**2/7 - t/3", "2*t/7 - 1/3", 2 / 7),
    ],
)
@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
def test_an_if_that_motion_along_its_guard_keeps_at_its_limit_does_not_end(
    floor: str, speed: str, right: float, method: str
) -> None:
    """A body falls relative to the floor that carries it, however both move."""
    text = f"""
hsdsl: 1
parameters: {{A: 0.1, w: 7}}
modes:
  a:
    flow: {{x: v, v: -9.81}}
    transitions: [{{when: x <= {floor}, if: v < {speed}, to: a, reset: {{v: "{speed} - 0.3*(v - ({speed}))"}}}}]
initial: {{mode: a, x: 1, v: 0}}
experiment: {{until: 3}}
"""
    run = assert_engines_agree(hsdsl.loads(text), method=method)
    assert run.stop.reason == "until" and run.final.state["x"] == pytest.approx(right, abs=1e-8)


def test_lifting_the_upper_of_two_bodies_leaves_the_lower_one_on_its_floor() -> None:
    text = """
hsdsl: 1
inputs: {u: {times: [0, 0.7], values: [0, 1], hold: zero}}
modes:
  a:
    flow: {x: v, y: w, v: -10 + 6*u, w: -10 + 14*u}
    transitions:
      - {name: floor, when: x <= 0, if: v < 0, to: a, reset: {v: -v/3}}
      - {name: bodies, when: y <= x, if: w < v, to: a, reset: {v: (v + w)/2, w: (v + w)/2}}
initial: {mode: a, x: 0, y: 0, v: 0, w: 0}
experiment: {until: 2}
"""
    for method in ("taylor", "dopri5", "radau"):
        run = assert_engines_agree(hsdsl.loads(text), method=method)
        assert run.final.state["x"] == pytest.approx(0, abs=1e-12)
        assert run.final.state["y"] == pytest.approx(4 * 1.3**2 / 2, abs=1e-9)


@pytest.mark.parametrize(
    ("reset", "stop"),
    [
        ("select(abs(v) - 0.2, -v/2, 0)", "until"),
        ("max(0, -v/2 - 0.05)", "until"),
        ("abs(v)/2", "until"),
        ("select(-v, -v/2, v)", "until"),
        ("sqrt(v**2)/3 + (-v)**1.5/100", "until"),
        ("-v*min(0.8, 0.5 + 0.1*abs(v))", "until"),
        ("-v*select(n - 9, 0, 1/2)", "transition_limit"),
    ],
)
def test_a_reset_with_kinks_is_its_branch_for_slow_impacts(reset: str, stop: str) -> None:
    """A body rests where its reset leads there; where another state decides on the branch, no rest is known."""
    text = f"""
hsdsl: 1
modes:
  a:
    flow: {{x: v, v: -2, n: 0}}
    transitions: [{{when: x <= 0, if: v < 0, to: a, reset: {{v: "{reset}", n: n + 1}}}}]
initial: {{mode: a, x: 1, v: 0, n: 0}}
experiment: {{until: 8, max_transitions: 500}}
"""
    run = assert_engines_agree(hsdsl.loads(text))
    assert run.final.state["x"] == pytest.approx(0, abs=1e-12)
    assert run.stop.reason == stop


def test_motion_along_a_guard_whose_flow_has_a_choice_is_stepped_by_an_automatic_method() -> None:
    text = """
hsdsl: 1
modes:
  a:
    flow: {x: v, v: -2, top: 0}
    transitions: [{when: x <= 0, to: a, reset: {v: -v/2, top: "select(top + v, top, -v)"}}]
initial: {mode: a, x: 1, v: 0, top: 0}
experiment: {until: 6}
"""
    run = assert_engines_agree(hsdsl.loads(text))
    assert run.final.state == pytest.approx({"x": 0, "v": 0, "top": 2}, abs=1e-12)
    with pytest.raises(hsdsl.UsageError, match="needs smooth flows"):
        hsdsl.loads(text).simulate(method="taylor")


def test_motion_along_a_curved_guard_goes_on_behind_what_interrupts_it() -> None:
    """Kinks of inputs and impacts of others find the state on its guard to round-off, not to the tolerance."""
    text = """
hsdsl: 1
inputs: {u: {times: [0, 1.15, 1.25, 2, 3], values: [0, 1, 0, 1, 0]}}
modes:
  a:
    flow: {h: v, v: -10, c: u, y: w, w: -10}
    transitions:
      - {name: table, when: h <= sin(9*t)/20, to: a, reset: {v: 0.45*cos(9*t) - 0.5*(v - 0.45*cos(9*t))}}
      - {name: floor, when: y <= 0, to: a, reset: {w: -0.95*w}}
initial: {mode: a, h: 0.5, v: 0, c: 0, y: 1, w: 0}
experiment: {until: 3}
"""
    for method in ("taylor", "dopri5", "radau"):
        run = assert_engines_agree(hsdsl.loads(text), method=method)
        assert run.stop.reason == "until", method
        assert run.final.state["h"] == pytest.approx(math.sin(27) / 20, abs=1e-9)
        assert run.final.state["v"] == pytest.approx(0.45 * math.cos(27), abs=1e-8)


WEDGE = """
hsdsl: 1
parameters: {{a: {a}, b: {b}, e: {e}, g: {g}}}
modes:
  fall:
    flow: {{x: v, y: w, v: 0, w: -g}}
    transitions:
      - {{name: right, when: y - a*x <= 0, to: fall,
         reset: {{v: v + (1 + e)*a*(w - a*v)/(1 + a**2), w: w - (1 + e)*(w - a*v)/(1 + a**2)}}}}
      - {{name: left, when: y + b*x <= 0, to: fall,
         reset: {{v: v - (1 + e)*b*(w + b*v)/(1 + b**2), w: w - (1 + e)*(w + b*v)/(1 + b**2)}}}}
initial: {{mode: fall, x: {x}, y: 3/4, v: -1/4, w: 0}}
experiment: {{until: 6}}
"""
WEDGES = (
    {"a": 0.55, "b": 0.4, "e": 0.45, "g": 6.5, "x": -0.1},
    {"a": 0.7, "b": 0.3, "e": 0.5, "g": 4, "x": 0.15},
    {"a": 0.35, "b": 0.8, "e": 0.4, "g": 9.81, "x": 0.05},
    {"a": 0.39, "b": 0.28, "e": 0.42, "g": 4.1, "x": -0.17},  # impacts at the vertex change what no flow changes
    {"a": 0.62, "b": 0.85, "e": 0.59, "g": 5, "x": 0.11},  # a tail along one wall ends beyond the other one
)


@pytest.mark.parametrize("engine", ["c", "python"])
@pytest.mark.parametrize("numbers", WEDGES, ids=str)
def test_a_ball_in_a_wedge_loses_energy_until_it_rests_at_the_bottom(numbers: dict[str, float], engine: str) -> None:
    # hundreds of impacts on walls in turn: carried sizes once grew by a factor with each, and fast impacts were kept
    run = hsdsl.loads(WEDGE.format(**numbers)).simulate(engine=engine)
    energy = run.values[:, 1] * numbers["g"] + (run.values[:, 2] ** 2 + run.values[:, 3] ** 2) / 2
    assert np.all(np.diff(energy) < 1e-9)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    assert max(map(abs, run.final.state.values())) < 1e-9


@pytest.mark.parametrize("engine", ENGINES)
def test_a_body_that_never_left_its_floor_by_a_row_bounces_on_it(engine: str) -> None:
    """Its hops are inside steps: how far off the floor round-off may leave it is the size of them, not of its rows."""
    text = """
hsdsl: 1
parameters: {m: 0.9, g: 8.4, k: 34.2, e: 1/5, l: 0.9}
modes:
  a:
    flow: {x: u, y: w, u: k*(y - x - l)/m - g, w: -k*(y - x - l) - g}
    transitions: [{name: floor, when: x <= 0, to: a, reset: {u: -e*u}}]
initial: {mode: a, x: 0, u: 0, y: 1.2, w: -2.7}
experiment: {until: 4}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "until"
    assert not any(made.entry for made in run.transitions)


@pytest.mark.parametrize("engine", ENGINES)
def test_impacts_in_a_wedge_dissipate_all_energy(engine: str) -> None:
    """The energy has a limit, too, where tails along both walls end at the vertex, and no flow depends on it."""
    text = """
hsdsl: 1
parameters: {a: 0.83, b: 0.47, e: 0.38, f: 0.29, g: 5.4}
let: {right: w - a*v, left: w + b*v}
modes:
  fall:
    flow: {x: v, y: w, v: 0, w: -g, lost: 0, n: 0}
    transitions:
      - when: y <= a*x
        if: right < 0
        to: fall
        reset:
          v: v + (1 + e)*a*right/(1 + a**2)
          w: w - (1 + e)*right/(1 + a**2)
          lost: lost + (1 - e**2)*right**2/(1 + a**2)/2
          n: n + 1
      - when: y + b*x <= 0
        if: left < 0
        to: fall
        reset:
          v: v - (1 + f)*b*left/(1 + b**2)
          w: w - (1 + f)*left/(1 + b**2)
          lost: lost + (1 - f**2)*left**2/(1 + b**2)/2
          n: n + 1
initial: {mode: fall, x: 0.13, y: 0.9, v: -0.6, w: 0.2, lost: 0, n: 0}
experiment: {until: 5}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "until"
    state = run.final.state
    assert state["lost"] == pytest.approx(5.4 * 0.9 + (0.6**2 + 0.2**2) / 2, abs=1e-8)
    assert [state[name] for name in "xyvw"] == pytest.approx([0] * 4, abs=1e-12)


def test_bodies_on_springs_between_stops_have_a_flow_in_little_time() -> None:
    """Rows of flows along several guards stay short, also where impacts add up what they dissipate."""
    text = """
hsdsl: 1
parameters: {m: 1.7, k: 3.1, d: 0.4, e: 0.2, f: 0.35}
modes:
  a:
    flow: {x: u, y: w, u: -k*x/m + 5*sin(2*t)/m, w: 4*cos(t), lost: 0}
    transitions:
      - when: y - x <= -d
        to: a
        reset: {u: u + (1 + e)*(w - u)/(1 + m), w: w - m*(1 + e)*(w - u)/(1 + m),
                lost: lost + m*(1 - e**2)*(w - u)**2/(1 + m)/2}
      - when: y - x >= d
        to: a
        reset: {u: u + (1 + e)*(w - u)/(1 + m), w: w - m*(1 + e)*(w - u)/(1 + m),
                lost: lost + m*(1 - e**2)*(w - u)**2/(1 + m)/2}
      - {when: x <= -2*d, to: a, reset: {u: -f*u, lost: lost + m*(1 - f**2)*u**2/2}}
initial: {mode: a, x: 0, y: 0.1, u: 0, w: 0, lost: 0}
experiment: {until: 1}
"""
    system = hsdsl.loads(text).system
    both = constrained_mode(system.modes[0])
    assert both is not None and size(both.mode.flow) < 1000


@pytest.mark.parametrize("engine", ENGINES)
def test_guards_without_a_push_let_go_by_what_the_flow_makes_of_them(engine: str) -> None:
    """Three bodies are pressed to a ceiling; once the lowest leaves, the forces on the middle one only begin to differ.

    The values are those of an event-driven run whose forces are solved as a linear complementarity problem.
    """
    text = """
hsdsl: 1
parameters: {k: 3.6, e: 0.2}
modes:
  a:
    flow:
      {x: u, y: v, z: w, u: k*(y - x - 1) + 10.5*sin(2.4*t), v: k*(x + z - 2*y), w: k*(y + 1 - z) + 2.9}
    transitions:
      - {when: y - x <= 1/2, to: a, reset: {u: (u + v)/2, v: (u + v)/2}}
      - {when: z - y <= 1/2, to: a, reset: {v: (v + w)/2 + e*(w - v)/2, w: (v + w)/2 - e*(w - v)/2}}
      - {when: z >= 3, to: a, reset: {w: -e*w}}
initial: {mode: a, x: 0, y: 1, z: 2, u: 0, v: 0, w: 0}
experiment: {until: 3}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "until"
    right = [-3.93197457, -1.30619058, 2.64396088, 0.29974392, -4.81019493, -2.07344044]
    assert [run.final.state[name] for name in "xyzuvw"] == pytest.approx(right, abs=1e-6)


@pytest.mark.parametrize(
    "reset",
    [
        "sign(u)*max(abs(u) + mu*(1 + e)*v, 0)",
        "u + max(-abs(u), mu*(1 + e)*v)*sign(u)",
        "select(abs(u) + mu*(1 + e)*v, u + sign(u)*mu*(1 + e)*v, 0)",
    ],
)
def test_a_body_slides_by_the_friction_of_its_impacts_until_that_jumps(reset: str) -> None:
    """Impulses take as much of the speed along the floor as friction in the same time."""
    text = f"""
hsdsl: 1
parameters: {{mu: 0.3, e: 0.4}}
modes:
  a:
    flow: {{x: u, y: v, u: 0, v: -7}}
    transitions: [{{name: floor, when: y <= 0, to: a, reset: {{v: -e*v, u: "{reset}"}}}}]
initial: {{mode: a, x: 0, y: 0.2, u: -2.5, v: 0}}
experiment: {{until: 2}}
"""
    model = hsdsl.loads(text)
    run = assert_engines_agree(model, until=1)
    assert run.stop.reason == "until"
    assert (run.final.state["u"], run.final.state["v"]) == pytest.approx((0.3 * 7 - 2.5, 0), abs=1e-9)
    run = assert_engines_agree(model)
    assert run.stop.reason == "step_underflow" and run.stop.time == pytest.approx(2.5 / (0.3 * 7), abs=1e-3)
    assert "the flow of u along the guard of floor jumps" in run.stop.message


@pytest.mark.parametrize("engine", ENGINES)
def test_flights_that_shrink_at_growing_speeds_are_no_tail(engine: str) -> None:
    """A light body between two heavy ones turns them back: nothing is lost."""
    text = """
hsdsl: 1
parameters: {m: 1e-5}
modes:
  a:
    flow: {x: u, y: v, z: w, u: 0, v: 0, w: 0}
    transitions:
      - {when: y <= x, to: a, reset: {u: (u - m*u + 2*m*v)/(1 + m), v: (m*v - v + 2*u)/(1 + m)}}
      - {when: z <= y, to: a, reset: {w: (w - m*w + 2*m*v)/(1 + m), v: (m*v - v + 2*w)/(1 + m)}}
initial: {mode: a, x: -1, u: 1, y: 0.1, v: 0, z: 1, w: -1}
experiment: {until: 2, relaxation: 1e-2}
"""
    last = hsdsl.loads(text).simulate(engine=engine).final.state
    assert last["u"] ** 2 + 1e-5 * last["v"] ** 2 + last["w"] ** 2 == pytest.approx(2, abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_equal_pendulums_hang_together_without_a_push(engine: str) -> None:
    """Round-off of where they swung keeps them apart where they are slow: to let go of each other there has no end."""
    text = """
hsdsl: 1
parameters: {g: 9.7, b: 0.29, e: 0}
modes:
  a:
    flow: {x: u, y: v, z: w, u: -g*sin(x) - b*u, v: -g*sin(y) - b*v, w: -g*sin(z) - b*w}
    transitions:
      - {when: y <= x, to: a, reset: {u: u - (1 + e)*(u - v)/2, v: v + (1 + e)*(u - v)/2}}
      - {when: z <= y, to: a, reset: {v: v - (1 + e)*(v - w)/2, w: w + (1 + e)*(v - w)/2}}
initial: {mode: a, x: -0.23, y: 0, z: 0, u: 0, v: 0, w: 0}
experiment: {until: 12}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason == "until" and len(run.times) < 1000


@pytest.mark.parametrize(("method", "engine"), [("taylor", ENGINES[-1]), *(("dopri5", engine) for engine in ENGINES)])
def test_a_body_at_rest_falls_through_no_floor_in_strips(method: str, engine: str) -> None:
    """Its speed is 0 where a long step begins, and upwards where that ends."""
    text = """
hsdsl: 1
modes: {a: {flow: {x: v, v: 6*(t - 4)}, transitions: [{when: x <= 0, to: a, reset: {v: 0}}]}}
initial: {mode: a, x: 10, v: 0}
experiment: {until: 10, scheme: relaxed, relaxation: 1e-5}
"""
    run = hsdsl.loads(text).simulate(engine=engine, method=method)
    assert run.final.state["v"] == pytest.approx(108, abs=0.01)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_push_that_ends_between_two_numbers_lets_go(engine: str) -> None:
    """A whole turn of its phase loses digits: the push jumps over zero by more than its round-off."""
    text = """
hsdsl: 1
modes:
  a: {flow: {y: w, w: 7.8*sin(6.23 + 1.6*t)}, transitions: [{when: y <= 0, to: a, reset: {w: -w/2}}]}
initial: {mode: a, y: 0, w: 0}
experiment: {until: 1}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    after = 1 - (2 * math.pi - 6.23) / 1.6
    assert run.final.state["y"] == pytest.approx(7.8 / 1.6 * (after - math.sin(1.6 * after) / 1.6), abs=1e-9)


@pytest.mark.parametrize("method", ["taylor", "dopri5", "dop853"])
@pytest.mark.parametrize("speed", ["8e-7", "1.4e-6"])
def test_a_low_rise_counts_where_another_guard_goes_first_and_a_high_one_follows(speed: str, method: str) -> None:
    """A body slips beyond its floor by less than a long step tells, and would be there again at its end."""
    text = f"""
hsdsl: 1
modes:
  wait: {{flow: {{y: v, v: 0, w: 0, c: 1}}, transitions: [
    {{when: c >= 2, to: a, reset: {{y: 0, v: -{speed}, w: 1, c: 0}}}}]}}
  a:
    flow: {{y: v, v: w - 5*(t - 2), w: 0, c: 1}}
    transitions:
      - {{name: floor, when: y <= 0, if: v < 0, to: a, reset: {{v: -v/3}}}}
      - {{name: clock, when: c >= 7e-7, to: a, reset: {{w: -2, c: -10}}}}
initial: {{mode: wait, y: 1, v: 0, w: 1, c: 0}}
experiment: {{until: 7}}
"""
    run = assert_engines_agree(hsdsl.loads(text), method=method)
    assert [made.edge for made in run.transitions if made.source == "a"][:2] == ["floor", "clock"]
    assert run.stop.reason == "until" and run.final.state["y"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("reset", ["max(u + 0.5*(1 + e)*v, 0)", "select(u + 0.5*(1 + e)*v, u + 0.5*(1 + e)*v, 0)"])
@pytest.mark.parametrize("speed", [1.5, 3])
def test_no_body_falls_through_its_floor_on_an_edge_of_what_its_reset_keeps(
    speed: float, reset: str, engine: str
) -> None:
    """Friction of impacts stops a body before or behind its Zeno point: there no one flow is known."""
    text = f"""
hsdsl: 1
parameters: {{e: 0.4}}
modes:
  a:
    flow: {{x: u, y: v, u: 0, v: -8}}
    transitions: [{{name: floor, when: y <= 0, to: a, reset: {{v: -e*v, u: "{reset}"}}}}]
initial: {{mode: a, x: 0, y: 0.25, u: {speed}, v: 0}}
experiment: {{until: 5}}
"""
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.stop.reason != "until" and run.verdict.theorem != "holds"
    assert min(run.values[:, run.states.index("y")]) > -1e-9
    before_rest = speed < 3
    assert (run.stop.time < 0.59) == before_rest and (before_rest or run.stop.time == pytest.approx(3 / 4, abs=1e-3))


@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
def test_motion_along_guards_follows_the_slopes_of_sampled_inputs(method: str) -> None:
    """A floor has the sampled speed f: what rests on it has f at all times, not only at samples."""
    text = """
hsdsl: 1
inputs: {f: {times: [0, 1, 2, 3], values: [0, 0.6, -0.4, 0.4], hold: linear}}
modes:
  a:
    flow: {q: f, h: v, v: -9, k: w, w: -9, s: 3}
    transitions:
      - {name: floor, when: h <= q, to: a, reset: {v: f - 0.4*(v - f)}}
      - {name: bodies, when: k <= h, to: a, reset: {v: (v + w)/2, w: (v + w)/2}}
      - {name: stop, when: s >= f + 1, to: a, reset: {s: f + 1}}
initial: {mode: a, q: 0, h: 0, v: 0, k: 0, w: 0, s: 1}
experiment: {until: 2.5}
"""
    run = assert_engines_agree(hsdsl.loads(text), method=method)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    height = 0.3 + 0.1 + (-0.4 + 0) / 2 / 2
    right = {"q": height, "h": height, "v": 0, "k": height, "w": 0, "s": 1}
    assert run.final.state == pytest.approx(right, abs=1e-9)
    with pytest.raises(hsdsl.UsageError, match="the sampled input f, whose slope"):
        hsdsl.loads("".join(line for line in text.splitlines(True) if "bodies" not in line)).completed()
