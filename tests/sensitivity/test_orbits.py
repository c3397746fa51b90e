"""Periodic orbits and their multipliers, against independent computations."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.orbits.section import Section
from hsdsl.analysis.plot import style
from hsdsl.analysis.plot.style import label
from hsdsl.interface.cli.verbs import obey

BELT = "models/gallery/stick-slip.yaml"
OSCILLATOR = "models/oscillator-with-stop-1.yaml"


def close(found: Any, expected: Any, tolerance: float = 1e-9) -> bool:
    """Whether multipliers agree in any order."""
    left = list(expected)
    for m in found:
        nearest = min(left, key=lambda e: abs(e - m), default=np.inf)
        if abs(nearest - m) > tolerance:
            return False
        left.remove(nearest)
    return not left


def test_oscillator() -> None:
    """Against the root of a quadratic and exp(A T) S."""
    orbit = hsdsl.load(OSCILLATOR).orbit("impact")
    assert orbit.verdict == "stable"
    assert np.isclose(orbit.period, 2 * np.pi / 2.5, rtol=1e-12)
    assert np.isclose(orbit.state["v"], -11.68623385549078, rtol=1e-11)
    assert np.isclose(orbit.phase, 0.06638216533121, rtol=1e-10)
    flow = expm(np.array([[0, 1], [-6.25, -0.1]]) * orbit.period)
    jump = np.array([[-0.9, 0], [-9.917213367781442, -0.9]])
    assert close(orbit.multipliers, np.linalg.eigvals(flow @ jump))


def test_oscillator_with_a_period_that_is_given() -> None:
    model = hsdsl.load(OSCILLATOR)
    double = model.orbit("impact", laps=2, period="4*pi/2.5")
    single = model.orbit("impact", period="2*pi/2.5")
    assert np.isclose(double.period, 2 * single.period, rtol=1e-12)
    assert close(double.multipliers, single.multipliers**2)


@pytest.mark.parametrize("section", ["up", "down"])
def test_section_through_a_point_at_rest(section: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's method goes to where the section and the flow meet at rest, and ends there: nearby no run comes back."""
    model, passages = hsdsl.load("models/gallery/lorenz-section.yaml"), list[float]()
    follow = Section.follow

    def counted(self: Section, point: Any, phase: float, horizon: float, *rest: Any, **others: Any) -> Any:
        passages.append(horizon)
        return follow(self, point, phase, horizon, *rest, **others)

    monkeypatch.setattr(Section, "follow", counted)
    with pytest.raises(UsageError, match="it closes where the flow is at rest"):
        model.orbit(section)
    assert len(passages) < 6 * 30  # of six guesses


def test_orbit_of_a_section_at_rest() -> None:
    """The shortest orbit of the flow, twice through the section: its period by D. Viswanath, Nonlinearity 16, 2003."""
    orbit = hsdsl.load("models/gallery/lorenz-section.yaml").orbit("up", laps=2)
    assert np.isclose(orbit.period, 1.558652210716, rtol=1e-11)
    assert np.isclose(abs(orbit.multipliers[0]), 4.71294727, rtol=1e-8)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_closing_within_the_error_of_a_run(tolerance: float) -> None:
    orbit = hsdsl.load(OSCILLATOR).orbit("impact", tolerance=tolerance)
    assert orbit.verdict == "stable"
    assert np.isclose(orbit.period, 2 * np.pi / 2.5, rtol=tolerance)


WALKER = (0.7344606213364, [-0.202216100148 + 0.543414971353j, -0.202216100148 - 0.543414971353j, 0.131386707191])


def test_compass_walker() -> None:
    """Against a run of forty digits with differences, and a second integrator."""
    orbit = hsdsl.load("examples/orbits/compass-walker.yaml").orbit("heel_strike")
    assert orbit.verdict == "stable"
    assert np.isclose(orbit.period, WALKER[0], rtol=1e-12)
    assert np.allclose(
        [orbit.state[x] for x in ("ns", "st", "wns", "wst")],
        [-0.3237746179803, 0.2187746179803, -0.3761345935308, -1.0928668105801],
        rtol=1e-11,
    )
    assert close(orbit.multipliers, WALKER[1])


BODY = """
hsdsl: 1
title: A body on two legs that hop together
parameters: {k: 200, l: 1, d: 0.5, I: 0.1, g: 9.81}
let: {left: z - d*sin(th), right: z + d*sin(th)}
modes:
  air:
    flow: {x: u, z: v, th: w, u: 0, v: -g, w: 0}
    transitions:
      - {when: left <= l, to: on_left, name: left_down}
      - {when: right <= l, to: on_right, name: right_down}
  on_left:
    flow: {x: u, z: v, th: w, u: 0, v: "k*(l - left) - g", w: "-k*(l - left)*d*cos(th)/I"}
    transitions: [{when: right <= l, to: ground, name: then_right}]
  on_right:
    flow: {x: u, z: v, th: w, u: 0, v: "k*(l - right) - g", w: "k*(l - right)*d*cos(th)/I"}
    transitions: [{when: left <= l, to: ground, name: then_left}]
  ground:
    flow:
      x: u
      z: v
      th: w
      u: 0
      v: k*(2*l - left - right) - g
      w: k*(left - right)*d*cos(th)/I
    transitions:
      - {when: left >= l, to: up_left, name: left_up}
      - {when: right >= l, to: up_right, name: right_up}
  up_left:
    flow: {x: u, z: v, th: w, u: 0, v: "k*(l - right) - g", w: "k*(l - right)*d*cos(th)/I"}
    transitions: [{when: right >= l, to: ascent, name: both_up}]
  up_right:
    flow: {x: u, z: v, th: w, u: 0, v: "k*(l - left) - g", w: "-k*(l - left)*d*cos(th)/I"}
    transitions: [{when: left >= l, to: ascent, name: both_up_too}]
  ascent:
    flow: {x: u, z: v, th: w, u: 0, v: -g, w: 0}
    transitions: [{when: v <= 0, to: air, name: apex}]
initial: {mode: air, x: 0, z: 1.2, th: 0, u: 1, v: 0, w: 0}
experiment: {until: 2}
"""


def test_pronk_of_a_hopping_body() -> None:
    """Both feet meet the ground together; height and speed are kept, pitch turns by a matrix of its own."""
    model = hsdsl.loads(BODY)
    orbit = model.orbit("apex")
    assert list(orbit.drift) == ["x"]
    assert orbit.drift["x"] == pytest.approx(orbit.period)
    fall = np.sqrt(2 * 0.2 / 9.81)
    rate, speed = 20.0, 9.81 * fall  # sqrt(2 k / m), at touchdown
    stance = (2 * np.pi - 2 * np.arctan2(speed * rate, 9.81)) / rate
    assert np.isclose(orbit.period, 2 * fall + stance, rtol=1e-10)
    turn = np.sqrt(2 * 200 * 0.25 / 0.1)
    flight = np.array([[1, fall], [0, 1]])
    ground = expm(np.array([[0, 1], [-turn * turn, 0]]) * stance)
    pitch = np.linalg.eigvals(flight @ ground @ flight)
    assert close(orbit.multipliers, [1, 1, *pitch], 1e-6)


@pytest.mark.slow
def test_pronking_runner() -> None:
    """The multipliers of its stride, against differences of runs."""
    model = hsdsl.load("models/pronking-runner.yaml")
    orbit = model.orbit("ascent->apex")
    assert orbit.verdict == "unstable"
    states, matrix, step = ("z", "th", "vx", "vz", "w"), [], 1e-6
    for moved in states:
        ends = []
        for way in (step, -step):
            start = orbit.state | {moved: orbit.state[moved] + way}
            ends.append(model.simulate(initial=start, tolerance=1e-14).final.state)
        matrix.append([(ends[0][x] - ends[1][x]) / (2 * step) for x in states])
    values = sorted(np.linalg.eigvals(np.array(matrix).T), key=abs)[1:]
    assert close(orbit.multipliers, values, 1e-6)


BALL = """
hsdsl: 1
parameters: {{A: 0.1, w: 5, e: 0.5}}
modes:
  fly:
    flow: {{z: v, v: -1}}
    transitions:
      - {{name: hit, when: z <= {floor}, if: "v < 1", to: fly, reset: {{v: -e*v + 1}}}}
initial: {{mode: fly, z: 1, v: 0}}
experiment: {{until: 20}}
"""


@pytest.mark.parametrize(
    ("model", "arguments", "sentence"),
    [
        (OSCILLATOR, {"section": "impct"}, "no transition 'impct'"),
        (OSCILLATOR, {"section": "x"}, "no transition 'x'"),
        (OSCILLATOR, {"section": "impact", "laps": 0}, "laps"),
        (OSCILLATOR, {"section": "impact", "until": 0.01}, "does not make the transition impact"),
        (
            "models/thermostat.yaml",
            {"section": "switch_off", "laps": 5},
            "makes the transition switch_off only 3 times",
        ),
        (OSCILLATOR, {"section": "impact", "step": 1}, "no argument 'step'"),
        ("examples/orbits/compass-walker.yaml", {"section": "heel_strike", "period": 1}, "does not depend on time"),
        ("models/bouncing-ball.yaml", {"section": "bounce"}, "ever shorter"),
        (BALL.format(floor="A*sin(w*t) + A*sin(w**2*t)"), {"section": "hit"}, "without a common multiple"),
        (BALL.format(floor="A*t"), {"section": "hit"}, "outside of sines"),
        (BELT, {"section": "catches_up", "settings": {"completion": "none"}}, "one instant only.*stops at t = 0.25"),
        ("models/gallery/dry-friction.yaml", {"section": "turns_right"}, "no periodic orbit"),
        ("models/gallery/lorenz-section.yaml", {"section": "up"}, "no periodic orbit"),
    ],
)
def test_bad_input(model: str, arguments: dict[str, Any], sentence: str) -> None:
    loaded = hsdsl.loads(model) if "\n" in model else hsdsl.load(model)
    with pytest.raises(UsageError, match=sentence):
        loaded.orbit(**arguments)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "orbit.svg"
    assert obey(["orbit", OSCILLATOR, "--section", "impact", "--plot", str(picture), "--json"]) == 0
    assert picture.stat().st_size > 1000
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "stable"
    assert found["multipliers"][0]["size"] == pytest.approx(0.7937202404684, rel=1e-9)
    assert obey(["orbit", OSCILLATOR, "--section", "impct"]) == 2


def test_stick_slip_on_a_belt() -> None:
    """Sticking puts nearby executions on one line: a multiplier is zero. The period is that of two integrators."""
    text = hsdsl.load(BELT).completed()
    orbit = hsdsl.loads(text).orbit("sliding_slower_faster->slower")
    assert orbit.period == pytest.approx(6.608448370445725, abs=1e-12)
    assert orbit.verdict == "stable"
    assert np.allclose(orbit.multipliers, 0, atol=1e-12)


RELAY = """
hsdsl: 1
modes:
  pos:
    flow: {x: -3*x + y - 1, y: -3*x + z + 1.2, z: -2*x - 1}
    transitions: [{name: down, when: x <= 0, to: neg}]
  neg:
    flow: {x: -3*x + y + 1, y: -3*x + z - 1.2, z: -2*x + 1}
    transitions: [{name: up, when: x >= 0, to: pos}]
initial: {mode: pos, x: 0.5, y: 0.3, z: 0.2}
experiment: {until: 40, completion: auto}
"""


@pytest.mark.parametrize("section", ["pos->sliding_pos_neg", "neg->sliding_pos_neg", "sliding_pos_neg->pos"])
def test_sections_of_sliding(section: str) -> None:
    """A start off the surface parts from the orbit at the end of sliding, but no lap ends there."""
    orbit = hsdsl.loads(RELAY).orbit(section)
    assert orbit.verdict == "stable"
    assert np.isclose(orbit.period, 6.933568018533765, rtol=1e-12)
    assert close(orbit.multipliers, [0.0362579783319586, 0])
    assert orbit.state["x"] == 0
    assert "multipliers 0.036257978332, 0\n" in orbit.summary


def test_multipliers_that_are_zero() -> None:
    """Sticking puts every near orbit on the same line."""
    orbit = hsdsl.load(BELT).orbit("slower->sliding_slower_faster")
    assert orbit.verdict == "stable"
    assert "multipliers 0\nverdict     stable: the largest multiplier has the size 0," in orbit.summary


TABLE = """
hsdsl: 1
parameters: {A: 0.14, w: 9, e: 0.3, g: 9.81}
modes:
  fly:
    flow: {z: v, v: -g}
    transitions:
      - name: hit
        when: z <= A*sin(w*t)
        if: v < A*w*cos(w*t)
        to: fly
        reset: {v: -e*v + (1 + e)*A*w*cos(w*t)}
initial: {mode: fly, z: 1, v: 0}
experiment: {until: 8}
"""


def test_a_ball_that_rests_on_a_shaken_table() -> None:
    """It is thrown where the table's acceleration is -g, after a rest that forgets the flights before."""
    model = hsdsl.loads(TABLE)
    with pytest.raises(UsageError) as refused:
        model.orbit("hit")
    assert "hsdsl complete" in str(refused.value.hint)
    text = model.completed()
    assert text is not None
    orbit = hsdsl.loads(text).orbit("contact_fly_hit->fly", parameters={"contact_time": 1e-4})
    thrown = np.arcsin(9.81 / (0.14 * 81)) / 9
    assert orbit.verdict == "stable"
    assert np.isclose(orbit.period, 2 * np.pi / 9, rtol=1e-12)
    assert np.isclose(orbit.phase, thrown, rtol=1e-11)
    assert np.allclose([orbit.state["z"], orbit.state["v"]], [9.81 / 81, 0.14 * 9 * np.cos(9 * thrown)], rtol=1e-11)
    assert np.allclose(orbit.multipliers, 0, atol=1e-8)


WORLD = """
hsdsl: 1
title: A monopod whose foot has a place in the world
parameters: {k: 18500, m: 74, g: 9.81, angle: 21*pi/180, push: 171.125}
let:
  l: sqrt((x - foot)**2 + (y - ground)**2)
  out: ((x - foot)*u + (y - ground)*v)/l
  leg: k*(0.925 - l) - 46.25*out
modes:
  air:
    flow: {x: u, y: v, u: 0, v: -g, ground: 0}
    transitions:
      - {name: down, when: y - ground <= 0.925*cos(angle), if: v < 0, to: shorter, reset: {foot: x + 0.925*sin(angle)}}
      - {name: fallen, when: y <= ground, to: end}
  shorter:
    flow: {x: u, y: v, u: "leg*(x - foot)/l/m", v: "leg*(y - ground)/l/m - g", ground: 0, foot: 0}
    transitions: [{name: turn, when: out >= 0, to: longer}]
  longer:
    flow: {x: u, y: v, u: "(leg + push)*(x - foot)/l/m", v: "(leg + push)*(y - ground)/l/m - g", ground: 0, foot: 0}
    transitions: [{name: up, when: l >= 0.925, to: air}]
  end: {final: true}
initial: {mode: air, x: 2, y: 3.923306046, u: 3.880553995, v: 0, ground: 3}
experiment: {until: 3}
"""
FROM_FOOT = """
hsdsl: 1
parameters: {k: 18500, m: 74, g: 9.81, angle: 21*pi/180, push: 171.125}
let: {l: sqrt(x**2 + y**2), out: (x*u + y*v)/l, leg: k*(0.925 - l) - 46.25*out}
modes:
  air:
    flow: {y: v, u: 0, v: -g}
    transitions:
      - {name: down, when: y <= 0.925*cos(angle), if: v < 0, to: shorter, reset: {x: -0.925*sin(angle)}}
  shorter:
    flow: {x: u, y: v, u: leg*x/l/m, v: leg*y/l/m - g}
    transitions: [{name: turn, when: out >= 0, to: longer}]
  longer:
    flow: {x: u, y: v, u: (leg + push)*x/l/m, v: (leg + push)*y/l/m - g}
    transitions: [{name: up, when: l >= 0.925, to: air}]
initial: {mode: air, y: 0.923306046, u: 3.880553995, v: 0}
experiment: {until: 3}
"""


@pytest.mark.parametrize(("section", "moving"), [("down", {"x", "foot"}), ("up", {"x"})])
def test_shifts_of_several_states_together(section: str, moving: set[str]) -> None:
    """The place of the foot shifts with that of the body, and the ground with the height: as measured from the foot."""
    other = hsdsl.loads(FROM_FOOT).orbit("up")
    orbit = hsdsl.loads(WORLD).orbit(section)
    assert orbit.period == pytest.approx(other.period, rel=1e-9)
    assert close(np.trim_zeros(np.where(abs(orbit.multipliers) < 1e-9, 0, orbit.multipliers)), other.multipliers, 1e-7)
    drift = {name: value for name, value in orbit.drift.items() if abs(value) > 1e-9}
    assert drift.keys() == moving
    assert set(orbit.drift) - moving == {"y", "ground"}
    assert len(set(np.round(list(drift.values()), 9))) == 1


def test_a_section_that_is_not_made_is_answered_with_those_that_are() -> None:
    with pytest.raises(UsageError, match="does not make the transition catches_up") as caught:
        hsdsl.load(BELT).orbit("catches_up")
    assert "slower->sliding_slower_faster" in (caught.value.hint or "")


def test_the_axes_of_a_picture_have_units(tmp_path: Path) -> None:
    orbit = hsdsl.load("examples/orbits/compass-walker.yaml").orbit("heel_strike")
    seen: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "write_figure", lambda figure, *_: seen.append(figure))
        orbit.plot(tmp_path / "orbit.png")
    left, right = seen[0].axes
    first, second = [x for x in orbit.state if x not in orbit.drift][:2]
    assert (left.get_xlabel(), left.get_ylabel()) == tuple(label(x, orbit.units) for x in (first, second))
    assert (right.get_xlabel(), right.get_ylabel()) == ("real part", "imaginary part")
    assert seen[0].get_suptitle().endswith(": stable orbit") and ", multipliers " in left.get_title(loc="left")


def test_a_refusal_names_the_state_that_does_not_return():
    """The ball repeats its flights, but d grows at a rate between 1 and 3: no orbit closes."""
    model = hsdsl.loads("""hsdsl: 1
modes:
  fly:
    flow: {h: v, v: -9.81, d: 2 + sin(d)}
    transitions: [{name: bounce, when: h <= 0, to: fly, reset: {v: 5}}]
initial: {mode: fly, h: 1, v: 0, d: 1}
experiment: {until: 8}
""")
    with pytest.raises(UsageError, match=r"'d' does not return to its value: it starts at \S+ and comes back at \S+"):
        model.orbit("bounce")


RUNNER = """hsdsl: 1
parameters: {m: 80, k: 20000, L: 1, attack: 68*pi/180, g: 9.81}
let: {length: sqrt((x - foot)**2 + z**2), pull: k*(L/length - 1)/m}
modes:
  flight:
    flow: {x: vx, z: vz, vx: 0, vz: -g}
    outputs: {energy: m*(vx**2 + vz**2)/2 + m*g*z}
    transitions:
      - {name: touchdown, when: z <= L*sin(attack), if: vz < 0, to: stance, reset: {foot: x + L*cos(attack)}}
  stance:
    flow: {x: vx, z: vz, vx: pull*(x - foot), vz: pull*z - g, foot: 0}
    transitions: [{name: liftoff, when: length >= L, to: flight}]
initial: {mode: flight, x: 0, z: 1, vx: 5, vz: 0}
experiment: {until: 4}
"""


def apex_map(height: float, energy: float, k: float = 20000) -> float:
    """The next apex of the runner by SciPy: apex height is the one coordinate of a level."""
    m, g, attack = 80, 9.81, np.radians(68)
    speed = np.sqrt(2 * energy / m - 2 * g * height)
    down = -np.sqrt(2 * g * (height - np.sin(attack)))

    def stance(_: float, y: Any) -> list[float]:
        x, z, vx, vz = y
        pull = k * (1 / np.hypot(x, z) - 1) / m
        return [vx, vz, pull * x, pull * z - g]

    def off(_: float, y: Any) -> float:
        return np.hypot(y[0], y[1]) - 1 + 1e-300 * y[0]

    off.terminal, off.direction = True, 1
    start = [-np.cos(attack), np.sin(attack), speed, down]
    end = solve_ivp(stance, (0, 1), start, "DOP853", events=off, rtol=1e-13, atol=1e-13).y[:, -1]
    return float(end[1] + end[3] ** 2 / (2 * g))


def test_stability_within_a_level() -> None:
    """Against the map from apex to apex at one energy, whose derivative is the multiplier."""
    model = hsdsl.loads(RUNNER)
    family = model.orbit("liftoff")
    assert family.verdict == "undecided" and np.isclose(family.multipliers[0], 1) and family.kept == {}
    energy = 80 * (25 / 2 + 9.81)
    for keep in ("energy", "vx**2 + vz**2 + 2*g*z"):
        orbit = model.orbit("liftoff", keep=keep)
        assert orbit.verdict == "stable" and len(orbit.multipliers) == 1
        assert orbit.kept[keep] == pytest.approx(energy if keep == "energy" else energy / 40, rel=1e-14)
        apex = orbit.state["z"] + orbit.state["vz"] ** 2 / (2 * 9.81)
        assert apex_map(apex, energy) == pytest.approx(apex, rel=1e-10)
        slope = (apex_map(apex + 1e-5, energy) - apex_map(apex - 1e-5, energy)) / 2e-5
        assert orbit.multipliers[0] == pytest.approx(slope, rel=1e-6)
    assert "within this level" in orbit.summary and orbit.as_json()["kept"] == orbit.kept


def test_a_branch_within_a_level() -> None:
    """Against the map from apex to apex at one energy, for other springs."""
    branch = hsdsl.loads(RUNNER).continuation("liftoff", "k", 19500, 20500, keep="energy")
    energy = 80 * (25 / 2 + 9.81)
    assert len(branch.points) > 3 and not branch.bifurcations
    for point in (branch.points[0], branch.points[-1]):
        assert point.parameter in (19500, 20500) and len(point.multipliers) == 1
        state = dict(zip(branch.states, point.state.tolist(), strict=True))
        apex, k = state["z"] + state["vz"] ** 2 / (2 * 9.81), point.parameter
        assert 80 * ((state["vx"] ** 2 + state["vz"] ** 2) / 2 + 9.81 * state["z"]) == pytest.approx(energy, rel=1e-9)
        assert apex_map(apex, energy, k) == pytest.approx(apex, rel=1e-9)
        slope = (apex_map(apex + 1e-5, energy, k) - apex_map(apex - 1e-5, energy, k)) / 2e-5
        assert point.multipliers[0] == pytest.approx(slope, rel=1e-5)


BALL = """hsdsl: 1
parameters: {g: 1}
modes:
  air: {flow: {h: v, v: -g}, transitions: [{name: hit, when: h <= 0, to: air, reset: {v: -v}}]}
initial: {mode: air, h: 1, v: 0}
experiment: {until: 10}
"""
BALLS = """hsdsl: 1
automata:
  ball:
    parameters: {g: 1}
    modes:
      air: {flow: {h: v, v: -g}, transitions: [{name: hit, when: h <= 0, to: air, reset: {v: -v}}]}
system:
  p: {automaton: ball, initial: {mode: air, h: 1, v: 0}}
experiment: {until: 10}
"""


def test_a_branch_within_a_level_that_depends_on_the_parameter() -> None:
    """A ball that rises to height 1 lands with v = sqrt(2 g) and takes 2 v/g."""
    branch = hsdsl.loads(BALL).continuation("hit", "g", 1, 2, keep="h + v**2/(2*g)")
    assert {1.0, 2.0} <= {point.parameter for point in branch.points}
    for point in branch.points:
        speed = np.sqrt(2 * point.parameter)
        assert point.state[1] == pytest.approx(speed, rel=1e-8)
        assert point.period == pytest.approx(2 * speed / point.parameter, rel=1e-8)


def test_a_level_of_a_part() -> None:
    orbit = hsdsl.loads(BALLS).orbit("p.hit", keep="p.v**2/2 + p.g*p.h")
    assert orbit.kept == {"p.v**2/2 + p.g*p.h": pytest.approx(1)} and orbit.verdict == "stable"
    assert orbit.state["p.v"] == pytest.approx(np.sqrt(2)) and orbit.period == pytest.approx(2 * np.sqrt(2))


@pytest.mark.parametrize(
    ("keep", "sentence"),
    [
        ("vx", "'vx' is not kept: a lap changes"),
        ("z + foot", "expected an expression of states and parameters, got 'foot'"),
        ("2*(", "is no expression"),
        ("m*g", "depends on no state of mode flight"),
    ],
)
def test_what_is_no_level_is_refused(keep: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=rf"--keep: .*{re.escape(sentence)}"):
        hsdsl.loads(RUNNER).orbit("liftoff", keep=keep)


def test_a_refusal_offers_a_start_of_the_run() -> None:
    """A ball that loses energy has no orbit; its last bounce is offered."""
    model = hsdsl.load("models/bouncing-ball.yaml")
    run = model.simulate(until=2)
    with pytest.raises(UsageError) as refusal:
        model.orbit(run.transitions[0].edge, until=2)
    assert f"--set initial.v={run.transitions[-1].after['v']:.10g}" in (refusal.value.hint or "")
