"""Guards and resets that depend on time or on sampled inputs: time is a coordinate of every domain."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl
from hsdsl.analysis.metrics.points import SpacePoint, distance
from hsdsl.analysis.metrics.space import make_space
from hsdsl.interface.model.distances import distance_of_runs as between_runs

HEAD = "hsdsl: 1\n"
TAIL = "initial: {mode: a, x: 0}\nexperiment: {until: 3}\n"

# name: model text after the head, from (mode, x, t), to (mode, x, t), their distance
CASES = {
    # x >= t, glued without moving: the straight line through the plane of (x, t)
    "a guard that moves": (
        "modes:\n  a:\n    flow: {x: 3}\n    transitions: [{when: x >= t, to: b}]\n  b: {flow: {x: 1}}\n",
        ("a", 0.0, 1.0), ("b", 2.0, 1.0), 2.0,
    ),
    # x >= u with u a ramp from 1 (t <= 0) to 2 (t >= 1): a kinked surface; at t = 3 it stands at 2
    "a guard at a linear input": (
        "inputs: {u: {times: [0, 1], values: [1, 2], hold: linear}}\n"
        "modes:\n  a:\n    flow: {x: 3}\n    transitions: [{when: x >= u, to: b}]\n  b: {flow: {x: 1}}\n",
        ("a", 1.5, 3.0), ("b", 2.5, 3.0), 1.0,
    ),
    # the image is moved by t/10: at t = 2 the guard x = 1 is glued to x = 1.2
    "a reset that depends on time": (
        "modes:\n  a:\n    flow: {x: 3}\n    transitions: [{when: x >= 1, to: b, reset: {x: x + t/10}}]\n"
        "  b: {flow: {x: 1}}\n",
        ("a", 0.5, 2.0), ("b", 1.2, 2.0), None,
    ),
}  # fmt: skip


def loaded(text):
    return hsdsl.loads(HEAD + text + TAIL)


@pytest.mark.parametrize("name", CASES)
def test_distance_with_time_as_a_coordinate(name):
    text, (mode_p, x_p, t_p), (mode_q, x_q, t_q), expected = CASES[name]
    space = make_space(loaded(text).system, [])
    assert space.timed
    found = distance(space, SpacePoint(mode_p, (x_p,), t=t_p), SpacePoint(mode_q, (x_q,), t=t_q)).interval
    if expected is None:  # by hand: cross at time s, then (1 + s/10, s) to (1.2, 2)
        s = np.linspace(0, 4, 400_001)
        expected = np.min(np.hypot(0.5, s - 2) + np.hypot(s / 10 - 0.2, s - 2))
    assert found.lower <= expected * (1 + 1e-9)
    assert expected * (1 - 1e-6) <= found.upper <= expected * (1 + 1e-6)


def test_runs_that_switch_at_other_times_are_as_near_as_their_times():
    """A run delayed by a strip of 1e-3: at its end it is 1e-3 beyond t = 1 in mode a, the other one 1e-3 beyond in b.

    From there to the guard and back is 2e-3 in t, and 1e-3 in x.
    """
    model = loaded("modes:\n  a:\n    flow: {x: 1}\n    transitions: [{when: t >= 1, to: b}]\n  b: {flow: {x: -1}}\n")
    runs = [model.simulate(scheme="relaxed", relaxation=eps) for eps in (1e-8, 1e-3)]
    found = between_runs(*runs, model=model)
    assert found.lower == pytest.approx(np.hypot(1e-3, 2e-3), rel=1e-4)
    assert found.upper <= found.lower * 1.011


def test_a_sampled_input_of_too_many_samples_is_refused():
    times = ", ".join(str(k) for k in range(300))
    model = loaded(
        f"inputs: {{u: {{times: [{times}], values: [{times}], hold: zero}}}}\n"
        "modes:\n  a:\n    flow: {x: 3}\n    transitions: [{when: x >= u, to: b}]\n  b: {flow: {x: 1}}\n"
    )
    with pytest.raises(hsdsl.UsageError, match="more than 200 samples"):
        model.distance("a x=0 t=1", "b x=400 t=1")
