"""`select`: the chosen part counts alone, in runs, series, Jacobians, enclosures, derivatives and completed text."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from engines import assert_engines_agree, needs_compiler

import hsdsl
from hsdsl import ModelError
from hsdsl.language.expression.plain import text_of

RATE = "select(on, 1/(1 - x) + sqrt(1 - x), -y)"
MODEL = """
hsdsl: 1
parameters: {p: -1}
modes:
  A:
    flow: {x: "1 + select(p, log(p)*x, 0)", y: "RATE", on: 0}
    transitions: [{name: go, when: x >= 1/2, to: B, reset: {on: 0, x: "select(x - 1, log(x - 1), 2 + x)"}}]
  B:
    flow: {x: "1 + select(p, log(p)*x, 0)", y: "RATE", on: 0}
outputs: {z: "select(1/4 - t, atanh(t), select(t - 2, atanh(t - 2), 10))", w: "select(y - 100, y**-1000, 1)"}
initial: {mode: A, x: 0, y: 1, on: 1}
experiment: {until: 1, scheme: located}
""".replace("RATE", RATE)


def exact(run: Any) -> None:
    """The flow of y is 1/(1 - x) + sqrt(1 - x) until t = 1/2, then y decays, while x goes on past 1."""
    rise = 1 + np.log(2) + 2 / 3 * (1 - 0.5**1.5)
    assert run.transitions[0].before["y"] == pytest.approx(rise, rel=1e-9)
    assert run.final.state == pytest.approx({"x": 3, "y": rise * np.exp(-0.5), "on": 0}, rel=1e-9)
    table = run.sample([0.2, 0.75])
    assert table["z"] == pytest.approx([np.arctanh(0.2), 10])
    assert table["w"] == pytest.approx([1, 1])


@needs_compiler
@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
def test_what_is_not_chosen_needs_no_value(method: str) -> None:
    model = hsdsl.loads(MODEL)
    exact(assert_engines_agree(model, method=method, tolerance=1e-11))
    run = model.simulate(method=method, tolerance=1e-11)
    assert run.verdict.theorem == "holds", run.verdict.reasons


def test_by_states_that_flow_it_jumps() -> None:
    """As `sign` does: the flow of |x| + log(x) where x is positive, and -x else."""
    text = 'hsdsl: 1\nmodes: {A: {flow: {x: 1, y: "select(x, 1 + log(x), 3)"}}}\n'
    run = hsdsl.loads(text + "initial: {mode: A, x: -1, y: 0}\nexperiment: {until: 2}\n").simulate(tolerance=1e-9)
    assert run.final.state["y"] == pytest.approx(3, abs=1e-5)
    assert run.verdict.theorem == "unknown"


def test_derivatives_are_those_of_what_is_chosen() -> None:
    found = hsdsl.loads(MODEL).sensitivity("initial.y,initial.x")
    assert found.final.state["y"]["initial.y"] == pytest.approx(np.exp(-0.5), rel=1e-10)
    assert np.isfinite(found.final.state["y"]["initial.x"])


def test_its_text_is_read_back() -> None:
    rate = hsdsl.loads(MODEL).system.modes[0].flow[1]
    exact(hsdsl.loads(MODEL.replace(RATE, text_of(rate))).simulate(tolerance=1e-11))


@pytest.mark.parametrize("text", ["select(1, 2)", "select(t, 1/0, 1)", "select(x > 0, 1, 2)", "select(1, 2, 3, 4)"])
def test_bad_input(text: str) -> None:
    with pytest.raises(ModelError, match=r":2:\d+: error HS1\d\d"):
        hsdsl.loads(
            f'hsdsl: 1\nmodes: {{A: {{flow: {{x: "{text}"}}}}}}\ninitial: {{mode: A, x: 0}}\nexperiment: {{until: 1}}\n'
        )


def test_a_choice_by_a_known_number_is_made_at_once() -> None:
    system = hsdsl.loads(MODEL.replace("select(p,", "select(2 - 3,")).system
    assert system.modes[0].flow[0] == 1
