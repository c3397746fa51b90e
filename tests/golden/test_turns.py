"""Transitions that take turns and accumulate, at Zeno points on two guards: rocking wheels and blocks, two tanks.

The references are independent of the simulator: each flight's time is an integral over the angle, from the energy, by
mpmath at 40 digits; flights are summed until one is below 1e-30.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import mpmath as mp
import pytest
from engines import ENGINES

import hsdsl
from hsdsl.engine.execution import Execution

WHEEL = """hsdsl: 1
parameters: {{gamma: {gamma}, alpha: {alpha}, w: {w}}}
modes:
  stance:
    flow: {{theta: omega, omega: w*sin(theta)}}
    transitions:
    - {{name: forward, when: theta >= gamma + alpha, if: omega > 0, to: stance,
       reset: {{theta: {ahead}, omega: omega*cos(2*alpha)}}}}
    - {{name: back, when: theta <= gamma - alpha, if: omega < 0, to: stance,
       reset: {{theta: {behind}, omega: omega*cos(2*alpha)}}}}
initial: {{mode: stance, theta: {theta}, omega: 0}}
experiment: {{until: 1000}}
"""
BLOCK = """hsdsl: 1
parameters: {{alpha: {alpha}, w: {w}, r: {r}}}
modes:
  right:
    flow: {{theta: omega, omega: -w*sin(alpha - theta)}}
    transitions: [{{name: to_left, when: theta <= 0, to: left, reset: {{omega: r*omega}}}}]
  left:
    flow: {{theta: omega, omega: w*sin(alpha + theta)}}
    transitions: [{{name: to_right, when: theta >= 0, to: right, reset: {{omega: r*omega}}}}]
initial: {{mode: right, theta: {theta}, omega: 0}}
experiment: {{until: 1000}}
"""
TANKS = """hsdsl: 1
parameters: {{w: {w}, a: {a}, b: {b}}}
modes:
  one:
    flow: {{x: w - a, y: -b}}
    transitions: [{{name: to_y, when: y <= 0, to: two}}]
  two:
    flow: {{x: -a, y: w - b}}
    transitions: [{{name: to_x, when: x <= 0, to: one}}]
initial: {{mode: one, x: {x}, y: {y}}}
experiment: {{until: 1000}}
"""
WHEELS = [
    ("0.05", "0.4", "9.81", "0.1"),
    ("0", "0.3", "1.7", "0.05"),
    ("0.02", "0.55", "400", "-0.1"),
    ("0.01", "0.1", "9.81", "0.08"),  # a round takes back four per cent
]
BLOCKS = [("0.3", "4", "0.8", "0.1"), ("0.9", "30", "0.5", "0.5"), ("0.2", "1", "0.97", "0.02")]


def in_engines(numbers: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """All numbers in the fastest engine, and the first of them in the others too."""
    return [(*row, engine) for engine in ENGINES for row in (numbers if engine == ENGINES[-1] else numbers[:1])]


def swing(foot: mp.mpf, top: mp.mpf, w: mp.mpf) -> mp.mpf:
    """The time between an angle and the one where a wheel turns back, measured from the upright position."""
    low, high = abs(top), abs(foot)
    return mp.quad(
        lambda s: 2 * s / mp.sqrt(2 * w * (2 * mp.sin((2 * low + s * s) / 2) * mp.sin(s * s / 2))),
        [0, mp.sqrt(high - low)],
    )


@cache  # for both engines
def rocks(feet: tuple[mp.mpf, mp.mpf], start: mp.mpf, w: mp.mpf, kept: mp.mpf) -> mp.mpf:
    """When a body on two feet comes to rest that starts at rest at an angle; impacts leave a share of its speed.

    It falls to one foot, whose angle is that of the first, and rises from the other in turn.
    """
    time, foot = swing(feet[0], start, w), 0
    omega = mp.sqrt(2 * w * 2 * mp.sin((feet[0] + start) / 2) * mp.sin((feet[0] - start) / 2)) * kept
    for _ in range(10000):
        foot = 1 - foot
        rise = omega**2 / (2 * w)  # of the cosine of the angle
        top = 2 * mp.asin(mp.sqrt(mp.sin(feet[foot] / 2) ** 2 - rise / 2))
        flight = 2 * swing(feet[foot], top, w)
        time, omega = time + flight, omega * kept
        if flight < mp.mpf("1e-17"):
            return time
    raise AssertionError("it does not come to rest")


def rest(run: Execution, edges: tuple[str, str], time: mp.mpf, within: float) -> None:
    """The run ends at the limit, and its message says so."""
    assert run.stop.reason == "zeno" and run.verdict.theorem == "left"
    assert abs(run.stop.time - time) <= within * time
    assert run.times[-1] == run.stop.time
    assert all(word in run.stop.message for word in (*edges, f"accumulate at t = {float(run.stop.time):.10g}"))
    assert {made.edge for made in run.transitions[-2:]} == set(edges) and len(run.transitions) < 2000


@pytest.mark.parametrize("reset", ["to the other angle", "by the angle between"])
@pytest.mark.parametrize(("gamma", "alpha", "w", "theta", "engine"), in_engines(WHEELS))
def test_a_rimless_wheel_rocks_to_rest(gamma: str, alpha: str, w: str, theta: str, reset: str, engine: str) -> None:
    """Standing on both legs is one state with two angles: either is on the guard that leads to the other."""
    other = reset == "to the other angle"
    ahead, behind = ("gamma - alpha", "gamma + alpha") if other else ("theta - 2*alpha", "theta + 2*alpha")
    text = WHEEL.format(gamma=gamma, alpha=alpha, w=w, theta=theta, ahead=ahead, behind=behind)
    run = hsdsl.loads(text).simulate(engine=engine, tolerance=1e-14)
    with mp.workdps(30):
        g, a, start = mp.mpf(gamma), mp.mpf(alpha), mp.mpf(theta)
        feet = (a + g, a - g) if start > 0 else (a - g, a + g)
        time = rocks(feet, abs(start), mp.mpf(w), mp.cos(2 * a))
    rest(run, ("forward", "back"), time, 1e-13)
    assert min(abs(run.final.state["theta"] - float(g + a)), abs(run.final.state["theta"] - float(g - a))) <= 1e-15
    assert run.final.state["omega"] == 0


@pytest.mark.parametrize(("alpha", "w", "r", "theta", "engine"), in_engines(BLOCKS))
def test_a_block_rocks_to_rest_through_two_modes(alpha: str, w: str, r: str, theta: str, engine: str) -> None:
    run = hsdsl.loads(BLOCK.format(alpha=alpha, w=w, r=r, theta=theta)).simulate(engine=engine, tolerance=1e-14)
    with mp.workdps(30):
        a = mp.mpf(alpha)
        time = rocks((a, a), a - mp.mpf(theta), mp.mpf(w), mp.mpf(r))
    rest(run, ("to_left", "to_right"), time, 1e-13)
    assert run.final.state == {"theta": pytest.approx(0, abs=1e-15), "omega": 0}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("w", "a", "b", "x", "y"), [("3/4", "1/2", "1/2", "1", "1"), ("2", "3/2", "5/4", "3", "7")])
def test_two_tanks_run_empty(w: str, a: str, b: str, x: str, y: str, engine: str) -> None:
    """What flows in is less than what flows out: both are empty when the sum of them is."""
    run = hsdsl.loads(TANKS.format(w=w, a=a, b=b, x=x, y=y)).simulate(engine=engine, tolerance=1e-14)
    time = (Fraction(x) + Fraction(y)) / (Fraction(a) + Fraction(b) - Fraction(w))
    rest(run, ("to_x", "to_y"), mp.mpf(time.numerator) / time.denominator, 1e-12)
    assert all(abs(value) <= 1e-14 for value in run.final.state.values())
