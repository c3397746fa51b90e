"""Sampled inputs with ramps and jumps between them: two samples at one time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from engines import ENGINES

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.metrics.points import SpacePoint, distance
from hsdsl.analysis.metrics.space import make_space

HEAD = "hsdsl: 1\n"
TIMES, VALUES = [0, 1, 1, 2, 3, 3], [0, 1, 3, 1, 2, -1]
INLINE = f"{{times: {TIMES}, values: {VALUES}, hold: linear}}"
BODY = """
modes: {run: {flow: {x: u}}}
outputs: {v: u}
initial: {mode: run, x: 0}
experiment: {until: 4, tolerance: 1e-10}
"""


def model_of(inputs: str, body: str = BODY) -> hsdsl.Model:
    return hsdsl.loads(f"{HEAD}inputs: {{u: {inputs}}}\n{body.strip()}\n")


@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
@pytest.mark.parametrize("engine", ENGINES)
def test_steps_see_the_values_of_their_own_ramp(engine: str, method: str) -> None:
    """The areas are 1/2, 2, 3/2 and -1; outputs have both values at a jump."""
    run = model_of(INLINE).simulate(engine=engine, method=method)
    at = {t: [float(run.outputs[k][0]) for k in np.flatnonzero(run.times == t)] for t in (1, 3)}
    assert run.final["x"] == pytest.approx(3, abs=1e-12)
    assert at == {1: [1, 3], 3: [2, -1]}
    assert [float(run(t)["x"]) for t in (1, 2, 3)] == pytest.approx([0.5, 2.5, 4], abs=1e-12)
    assert {t: float(run(t)["v"]) for t in (0.5, 1.5, 2.5, 3.5)} == pytest.approx({0.5: 0.5, 1.5: 2, 2.5: 1.5, 3.5: -1})
    assert run.verdict.theorem == "holds"


def test_a_file_has_the_same_meaning(tmp_path: Path) -> None:
    rows = "\n".join(f"{t},{v}" for t, v in zip(TIMES, VALUES, strict=True))
    (tmp_path / "u.csv").write_text(f"time,u\n{rows}\n")
    (tmp_path / "m.yaml").write_text(f"{HEAD}inputs: {{u: {{file: u.csv, hold: linear}}}}{BODY}")
    run, same = hsdsl.load(tmp_path / "m.yaml").simulate(), model_of(INLINE).simulate()
    assert np.array_equal(run.times, same.times) and run.final == same.final


def test_times_that_fall_together_by_parameters() -> None:
    inputs = "{times: [0, a, b, 3], values: [0, 1, 3, 3], hold: linear}"
    body = "\n".join(["parameters: {a: 1, b: 2}", BODY])
    model = model_of(inputs, body)
    areas = [model.simulate(parameters={"b": b}).final["x"] for b in (2, 1.5, 1)]
    assert areas == pytest.approx([8.5, 9, 9.5], abs=1e-9)
    with pytest.raises(UsageError, match="do not increase"):
        model.simulate(parameters={"b": 0.5})


@pytest.mark.parametrize("third", [False, True])
def test_a_third_row_at_one_time_is_refused(tmp_path: Path, third: bool) -> None:
    (tmp_path / "u.csv").write_text("time,u\n0,1\n1,2\n1,3\n" + third * "1,4\n" + "2,5\n")
    (tmp_path / "m.yaml").write_text(f"{HEAD}inputs: {{u: {{file: u.csv, hold: linear}}}}{BODY}")
    if not third:
        assert hsdsl.load(tmp_path / "m.yaml").simulate().final["x"] == pytest.approx(15.5)
        return
    with pytest.raises(hsdsl.ModelError) as refused:
        hsdsl.load(tmp_path / "m.yaml")
    (fault,) = refused.value.diagnostics
    assert fault.code == "HS312" and fault.span.line == 5 and "the value before it and the one behind it" in fault.hint


def test_equal_values_at_one_time_are_a_kink() -> None:
    body = BODY.replace("flow: {x: u}", "flow: {x: u}, transitions: [{when: u >= 2, to: run}]")
    run = model_of("{times: [0, 1, 1, 2], values: [0, 1, 1, 0], hold: linear}", body).simulate()
    assert not run.transitions and run.verdict.theorem == "holds"


def derived(inputs: str) -> Any:
    body = """
parameters: {a: 2, s: 1}
modes: {run: {flow: {x: u*x}}}
initial: {mode: run, x: 1}
experiment: {until: 3, tolerance: 1e-10}
"""
    return model_of(inputs, body)


def test_derivatives_by_the_values_at_a_jump() -> None:
    """The logarithm of x(3) is 1/2 (0 + 1) + (a + a**2)/2 + a**2, times s of time."""
    model = derived("{times: [0, 1, 1, 2], values: [0, 1, a, a**2], hold: linear}")
    found, x = model.sensitivity("a"), np.exp(0.5 + 3 + 4)
    assert found.final.state["x"]["a"] == pytest.approx(x * (0.5 + 2 + 4), rel=1e-8)


def test_derivatives_where_other_samples_move() -> None:
    """The first ramp ends at the jump, whose time stays; what moves is a sample inside it."""
    model = derived("{times: [0, s/2, 1, 1, 2], values: [0, 1, 1, a, 0], hold: linear}")
    found, x = model.sensitivity("s"), np.exp(0.25 + 0.5 + 1)
    assert found.final.state["x"]["s"] == pytest.approx(-x / 4, rel=1e-8)
    with pytest.raises(UsageError, match="jumps at moving times are not followed"):
        derived("{times: [0, s, s, 2], values: [0, 1, a, 0], hold: linear}").sensitivity("s")


def test_a_guard_at_such_an_input_in_distances() -> None:
    """The guard x >= u is at 1 before t = 1, then on a ramp from 2 to 3, and stays at 3."""
    text = """hsdsl: 1
inputs: {u: {times: [0, 1, 1, 2], values: [1, 1, 2, 3], hold: linear}}
modes:
  a: {flow: {x: 3}, transitions: [{when: x >= u, to: b}]}
  b: {flow: {x: 1}}
initial: {mode: a, x: 0}
experiment: {until: 3}
"""
    space = make_space(hsdsl.loads(text).system, [])
    found = distance(space, SpacePoint("a", (2.5,), t=5.0), SpacePoint("b", (3.5,), t=5.0)).interval
    assert found.lower <= 1 <= found.upper * (1 + 1e-9) and found.upper == pytest.approx(1, rel=1e-6)
