"""Cascades of impacts at one instant, and bodies that touch without a force, against closed forms."""

from __future__ import annotations

import math
from typing import Any

import pytest
from engines import assert_engines_agree

import hsdsl

LIFT = """
hsdsl: 1
parameters: {{s: {speed}, e: {e}, m: {m}}}
modes:
  a:
    flow: {{x: u, y: v, u: -10, v: -10}}
    transitions:
      - {{name: floor, when: x <= s*t, {low}to: a, reset: {{u: s - e*(u - s)}}}}
      - name: meet
        when: y <= x
        {high}to: a
        reset: {{u: (m*u + v - e*(u - v))/(m + 1), v: (m*u + v + m*e*(u - v))/(m + 1)}}
initial: {{mode: a, x: 0, u: s, y: 1, v: 0}}
experiment: {{until: 3}}
"""


@pytest.mark.parametrize(
    ("speed", "e", "m", "conditional"),
    [("0.2", "0", "1", False), ("0.2", "0", "1", True), ("-0.3", "1/9", "1", True), ("0.2", "1/2", "1/8", False)],
)
def test_a_cascade_of_one_instant_ends_in_the_motion_that_all_guards_keep(
    speed: str, e: str, m: str, conditional: bool
) -> None:
    """A body falls on another one that rests on a lift: both end at rest there, at the lift's speed."""
    low, high = ("if: u < s, ", "if: v < u\n        ") if conditional else ("", "")
    run = assert_engines_agree(hsdsl.loads(LIFT.format(speed=speed, e=e, m=m, low=low, high=high)))
    right = [3 * float(speed)] * 2 + [float(speed)] * 2
    assert [run.final.state[name] for name in "xyuv"] == pytest.approx(right, abs=1e-12)
    assert run.verdict.theorem == "left"
    assert any(
        "of meet after number" in reason and "their limit replaces them" in reason for reason in run.verdict.reasons
    )
    assert not any("in a strip" in reason for reason in run.verdict.reasons)


def test_bodies_that_collapse_in_flight_have_their_common_momentum() -> None:
    text = """
hsdsl: 1
modes:
  a:
    flow: {x: u, y: v, z: w, u: 0, v: 0, w: 0}
    transitions:
      - {name: low, when: y <= x, if: v < u, to: a, reset: {u: (u + v)/2, v: (u + v)/2}}
      - {name: high, when: z <= y, if: w < v, to: a, reset: {v: (v + 3*w)/4, w: (v + 3*w)/4}}
initial: {mode: a, x: -1, u: 1, y: 0, v: 0, z: 1, w: -1}
experiment: {until: 4}
"""
    run = assert_engines_agree(hsdsl.loads(text))
    assert [run.final.state[name] for name in "uvw"] == pytest.approx([-0.4] * 3, abs=1e-9)
    assert [run.final.state[name] for name in "xyz"] == pytest.approx([-1.2] * 3, abs=1e-9)


PAIR = """
hsdsl: 1
modes:
  a:
    flow: {{x: v, y: w, v: '-10 + {pull}', w: -10}}
    transitions:
      - {{name: meet, when: y <= x, {condition}to: a, reset: {{v: (v + w)/2, w: (v + w)/2}}}}
initial: {{mode: a, x: 0, y: 0, v: 1, w: 1}}
experiment: {{until: 2}}
"""


@pytest.mark.parametrize(
    ("pull", "right", "condition"),
    [
        ("t**2", [2 / 3 - 18, 2 / 3 - 18], "if: w < v, "),
        ("1e-9*t**3", [8e-10 - 18, 8e-10 - 18], "if: w < v, "),
        ("max(t - 1, 0)", [1 / 12 - 18, 1 / 12 - 18], ""),
        ("-t**2", [-18 - 4 / 3, -18], ""),
    ],
)
def test_bodies_that_touch_are_pressed_together_once_a_force_begins(
    pull: str, right: list[float], condition: str
) -> None:
    """A force that begins at zero presses next: half of it acts on each body, all of it where it pulls them apart."""
    run = assert_engines_agree(hsdsl.loads(PAIR.format(pull=pull, condition=condition)))
    assert run.stop.reason == "until"
    assert [run.final.state[name] for name in "xy"] == pytest.approx(right, abs=1e-12)


@pytest.mark.parametrize("arguments", [{"method": "rk4", "step": 1e-2}, {"method": "dopri5"}, {}])
def test_an_if_does_not_let_a_resting_ball_through_its_floor_in_strips(arguments: dict[str, Any]) -> None:
    text = """
hsdsl: 1
modes:
  a: {flow: {x: v, v: -2}, transitions: [{when: x <= 3, if: v < 0, to: a, reset: {v: -v/2}}]}
initial: {mode: a, x: 4, v: 0}
experiment: {until: 5, relaxation: 1e-3, scheme: relaxed}
"""
    run = assert_engines_agree(hsdsl.loads(text), **arguments)
    assert run.stop.reason == "until"
    assert run.final.state["x"] == pytest.approx(3, abs=1e-3)


STACK = """
hsdsl: 1
inputs: {{u: {{times: [0, 1], values: [0, 1], hold: zero}}}}
modes:
  a:
    flow: {{x: v, y: w, v: -10, w: '-10 + 16*u'}}
    transitions:
      - {{name: floor, when: x <= 0, {low}to: a, reset: {{v: -v/3}}}}
      - {{name: meet, when: y <= x, {high}to: a, reset: {{v: (v + w)/2, w: (v + w)/2}}}}
initial: {{mode: a, x: {x}, y: {y}, v: {v}, w: {w}}}
experiment: {{until: 2}}
"""


@pytest.mark.parametrize(
    ("x", "y", "v", "w", "conditional"),
    [
        ("0", "1.8e-40", "0", "0", True),
        ("-2e-17", "-3e-17", "1e-18", "-1e-19", True),
        ("-4e-17", "0", "0", "0", False),
        ("1e-200", "0", "-1e-160", "0", False),
    ],
)
def test_a_run_goes_on_from_a_state_at_rest(x: str, y: str, v: str, w: str, conditional: bool) -> None:
    """What is left of zeros is nothing to what gravity makes of them; the upper body is lifted at t = 1."""
    low, high = ("if: v < 0, ", "if: w < v, ") if conditional else ("", "")
    run = assert_engines_agree(hsdsl.loads(STACK.format(x=x, y=y, v=v, w=w, low=low, high=high)))
    assert run.stop.reason == "until"
    assert [run.final.state[name] for name in "xyvw"] == pytest.approx([0, 3, 0, 6], abs=1e-12)


def test_an_if_that_round_off_ends_moves_no_body_along_a_line() -> None:
    """Fixed steps leave the speed across an incline at a round-off that is not looked at far ahead."""
    text = """
hsdsl: 1
parameters: {th: 0.3}
let: {n: u*sin(th) + v*cos(th)}
modes:
  a:
    flow: {x: u, y: v, u: 0, v: -9.81}
    transitions: [{when: y + x*tan(th) <= 0, if: n < 0, to: a, reset: {u: u - 1.6*n*sin(th), v: v - 1.6*n*cos(th)}}]
initial: {mode: a, x: 0, y: 0, u: 0, v: 0}
experiment: {until: 2}
"""
    run = hsdsl.loads(text).simulate(method="rk4", step=1e-3)
    assert run.final.state["x"] == pytest.approx(2 * 9.81 * math.sin(0.3) * math.cos(0.3), rel=1e-9)


@pytest.mark.parametrize("e", ("1/2", "1/4"))
@pytest.mark.parametrize("step", ("1/32", "1/512", "0.01"))
def test_strips_lead_through_a_zeno_point_where_steps_end_on_the_guard(step: str, e: str) -> None:
    """With a step of 1/32 a flight takes one step: the height there is round-off of a far larger one."""
    model = hsdsl.load("tests/conformance/cases/zeno-ball.yaml")
    run = assert_engines_agree(model, scheme="relaxed", method="rk4", step=step, parameters={"e": e})
    assert run.stop.reason == "until" and run.time_span[1] == 5
    assert all(abs(run.final.state[name]) < 1e-2 for name in "hv") and not any(t.entry for t in run.transitions)
