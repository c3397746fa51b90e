"""Distances between executions are distances: symmetric, zero on the diagonal, and with the triangle inequality."""

from __future__ import annotations

from itertools import pairwise

import hand_made
import numpy as np
import pytest
from curve_spaces import Bent, Plane
from hypothesis import given, settings
from hypothesis import strategies as st

from hsdsl.analysis.metrics.curves import rho
from hsdsl.analysis.metrics.labelled import rho_hat, skorokhod, sup_norm, tau_epsilon

UNTIL = 2.0
number = st.floats(-2, 2).map(lambda x: round(x, 3))


@st.composite
def runs(draw):
    """A run in the plane through up to four modes, pieces of degree up to 3, strips between some of them, until 2."""
    degree = draw(st.integers(0, 3))
    draft = hand_made.Draft(degree=degree)
    jumps = sorted(draw(st.lists(st.integers(1, 31), max_size=3, unique=True)))
    edges = [0.0, *(k / 16 for k in jumps), UNTIL]
    for j, (begin, end) in enumerate(pairwise(edges)):
        mode = draw(st.sampled_from("abc"))
        x = [draw(number), draw(number)]
        wait = draw(st.sampled_from([0.0, 1 / 32])) if end < UNTIL else 0.0
        rows = []
        steps = draw(st.integers(1, 3))
        times = np.linspace(begin, end - wait, steps + 1).tolist()
        for t in times[:-1]:
            powers = [[draw(number), draw(number)] for _ in range(degree)]
            rows.append((t, x, [], 0.0, powers))
            x = [a + sum(p[i] for p in powers) for i, a in enumerate(x)] if degree else [draw(number), draw(number)]
        rows.append((times[-1], x, [], 0.0, []))
        draft.arc(mode, ("x", "y"), j, rows)
        if wait:
            draft.arc(mode, ("x", "y"), j, [(end - wait, x, [], 0.0, []), (end, x, [], wait, [])], "strip")
        if end < UNTIL:
            state = dict(zip(("x", "y"), x, strict=True))
            draft.transition(end - wait, end, "go", mode, mode, state, state)
    return draft.make()


METRICS = {
    "rho": lambda a, b: rho(a, b, Plane()),
    "rho, points only": lambda a, b: rho(a, b, Bent(), gap=0.05),
    "relaxed": lambda a, b: rho(a, b, Plane(), relaxation=1 / 32),
    "sup": sup_norm,
    "skorokhod": lambda a, b: skorokhod(a, b, resolution=60),
    "tau-epsilon": lambda a, b: tau_epsilon(a, b, tau=2.0, resolution=60),
}
SYMMETRIC = pytest.mark.parametrize("name", METRICS)


@SYMMETRIC
@settings(max_examples=15, deadline=None)
@given(runs(), runs())
def test_symmetric_up_to_what_is_certified(name, a, b):
    there, back = METRICS[name](a, b), METRICS[name](b, a)
    assert there.lower <= back.upper + 1e-12
    assert back.lower <= there.upper + 1e-12


@pytest.mark.parametrize("name", [name for name in METRICS if name != "tau-epsilon"])  # which is no metric
@settings(max_examples=15, deadline=None)
@given(runs(), runs(), runs())
def test_triangle_inequality(name, a, b, c):
    metric = METRICS[name]
    assert metric(a, c).lower <= metric(a, b).upper + metric(b, c).upper + 1e-12


@SYMMETRIC
@settings(max_examples=10, deadline=None)
@given(runs())
def test_zero_against_itself(name, a):
    assert METRICS[name](a, a).lower <= 1e-12


@settings(max_examples=40, deadline=None)
@given(runs(), runs(), st.lists(st.floats(0, UNTIL), min_size=1, max_size=30))
def test_no_sampled_time_is_beyond_the_upper_bound(a, b, times):
    """Dense sampling can only find less than the certified bound, and at least the other one at its time."""
    found = rho(a, b, Plane())
    for side in ("left", "right"):
        x, y = a.sample(times, side), b.sample(times, side)
        apart = np.hypot(x["x"] - y["x"], x["y"] - y["y"])
        assert np.max(apart) <= found.upper + 1e-12
    at = [
        np.hypot(
            a(found.time, side)["x"] - b(found.time, side)["x"], a(found.time, side)["y"] - b(found.time, side)["y"]
        )
        for side in ("left", "right")
    ]
    assert min(abs(d - found.lower) for d in at) <= 1e-12


@settings(max_examples=20, deadline=None)
@given(runs(), runs())
def test_order_of_the_distances(a, b):
    """Sampling sees no more than the supremum, retiming can only help, and a label only adds."""
    assert rho_hat(a, b).upper <= rho(a, b, Plane()).upper + 1e-12
    assert rho(a, b, Plane()).lower <= sup_norm(a, b).upper
    assert skorokhod(a, b, resolution=60).lower <= sup_norm(a, b).upper
