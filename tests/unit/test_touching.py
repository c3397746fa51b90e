"""Guards that are reached tangentially, at the edge of what the flow is defined for: tanks that empty."""

from __future__ import annotations

from math import sqrt
from typing import Any

import pytest
from engines import assert_engines_agree, needs_compiler

import hsdsl

METHODS = {"taylor": 1e-9, "dopri5": 1e-5, "dop853": 1e-5, "radau": 1e-5, "auto": 1e-5}  # relative to the time

TANK = """hsdsl: 1
parameters: {c: 0.7, full: 1}
modes:
  a: {flow: {h: -c*sqrt(h), out: c*sqrt(h)}, transitions: [{when: h <= 0, to: e}]}
  e: {flow: {h: 0, out: 0}}
initial: {mode: a, h: full, out: 0}
experiment: {until: 3.7*sqrt(full)/c}
"""


def tank() -> Any:
    return hsdsl.loads(TANK)


@pytest.mark.parametrize(("c", "full"), [(0.7, 1), (0.31, 900), (20, 5), (1, 1), (0.5, 4), (2, 0.25)])
@pytest.mark.parametrize("method", METHODS)
def test_a_tank_empties(method: str, c: float, full: float) -> None:
    run = tank().simulate(method=method, parameters={"c": c, "full": full}, engine="python")
    (made,) = run.transitions
    assert made.time == pytest.approx(2 * sqrt(full) / c, rel=METHODS[method])
    assert run.final.state["out"] == pytest.approx(full, abs=1e-6)
    assert len(run.times) < 2000


@needs_compiler
def test_engines_agree_on_it() -> None:
    for method in METHODS:
        assert_engines_agree(tank(), method=method)
        assert_engines_agree(tank(), method=method, parameters={"c": 1})  # a step may end on the surface


def test_what_only_comes_near_is_not_empty() -> None:
    """H' = 1e-3 - sqrt(h) runs to h = 1e-6 and stays there."""
    text = (
        "hsdsl: 1\nmodes: {a: {flow: {h: 1e-3 - sqrt(h)}, transitions: [{when: h <= 0, to: e}]}, e: {flow: {h: 0}}}\n"
        "initial: {mode: a, h: 1}\nexperiment: {until: 4}\n"
    )
    for method in ("taylor", "dopri5", "radau"):
        assert hsdsl.loads(text).simulate(method=method).transitions == ()
