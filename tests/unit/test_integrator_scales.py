"""The sizes of the terms that a flow is a small difference of, by what the last digits of states change in it."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace

import pytest

import hsdsl
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.integrators.stepper import make_resolved
from hsdsl.engine.scheme.scales import flow_terms


@pytest.mark.parametrize("n", [3, 7, 20])
def test_the_terms_of_any_difference(n):
    """Every two states, and every state and time, differ by terms of their size, though their values are the same."""
    ones = (1.0,) * n
    for i, j in combinations(range(n + 1), 2):

        def flow(t, *x, i=i, j=j):
            return (700 * ((*x, t)[i] - (*x, t)[j]), *(0.0 for _ in range(n - 1)))

        by = make_resolved(n, 0.0, FLOAT64)
        by.found[:], by.slope[:] = ones, flow(1.0, *ones)
        flow_terms(SimpleNamespace(flow=flow), by, n, 1.0, ones)
        found = by.least
        assert 700 / 4 <= found[0] <= 16 * 700
        assert not any(found[1:])


MODEL = """
hsdsl: 1
modes:
  one:
    flow: {a: b, b: -a, c: d, d: -c, z: 300*(a*(1 + d) - c*(1 + b)), w: z}
    transitions: [{when: t >= 1, to: two, reset: {z: 0, w: 0}}]
  two: {flow: {a: b, b: -a, c: d, d: -c, z: 300*(a*(1 + d) - c*(1 + b)), w: z}}
initial: {mode: one, a: 0.3, b: 1, c: 0.3, d: 1, z: 0, w: 0}
experiment: {until: 9, tolerance: 1e-13}
"""


@pytest.mark.parametrize("engine", ["python", "auto"])
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_states_that_are_zero_by_cancellation(engine, method):
    run = hsdsl.loads(MODEL).simulate(engine=engine, method=method)
    assert run.stop.reason == "until"
    assert len(run.times) < 2000
