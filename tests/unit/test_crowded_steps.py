"""Runs that make thousands of steps within a millionth of their length: they say so, or end."""

from __future__ import annotations

import pytest
from engines import needs_compiler

import hsdsl

BURST = """hsdsl: 1
parameters: {w: 1e11}
modes:
  burst: {flow: {x: w*v, v: -w*x, s: 1}, transitions: [{when: s >= 5/10000000, to: calm}]}
  calm: {flow: {x: -x, v: -v, s: 1}}
initial: {mode: burst, x: 1, v: 0, s: 0}
experiment: {until: 1, method: taylor}
"""
FAST = """hsdsl: 1
parameters: {w: 5e10}
modes: {run: {flow: {z: 1, x: w*v, v: -w*x}}}
initial: {mode: run, z: 0, x: 1, v: 0}
experiment: {until: 1, method: taylor}
"""


@needs_compiler
def test_a_burst_is_right_and_said() -> None:
    run = hsdsl.loads(BURST).simulate(engine="c")
    (said,) = [reason for reason in run.verdict.reasons if reason.startswith("10000 steps from t = ")]
    assert run.stop.complete and run.verdict.theorem == "holds" and said.endswith("of burst moves most")


@needs_compiler
@pytest.mark.parametrize(
    ("scheme", "method", "w"), [("located", "taylor", 1e14), ("located", "dopri5", 5e10), ("relaxed", "dopri5", 5e10)]
)
def test_a_run_that_would_not_end_stops(scheme: str, method: str, w: float) -> None:
    run = hsdsl.loads(FAST).simulate(scheme=scheme, method=method, parameters={"w": w}, engine="c")
    assert run.stop.reason == "step_underflow" and len(run.times) < 110_000
    assert "within a millionth of the run" in run.stop.message and "whose flow is" in run.stop.message


@needs_compiler
def test_steps_of_long_runs_with_transitions_are_no_creeping() -> None:
    text = """hsdsl: 1
modes: {run: {flow: {s: 1}, transitions: [{when: s >= 1, to: run, reset: {s: 0}}]}}
initial: {mode: run, s: 0}
experiment: {until: 1e12, max_transitions: 150000}
"""
    run = hsdsl.loads(text).simulate(engine="c")
    assert run.stop.reason == "transition_limit"
