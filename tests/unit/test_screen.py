"""The compiled screen of a verdict: what it leaves out has no finding, and what it encloses holds every value."""

from __future__ import annotations

import ctypes
import pickle
import re
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from engines import needs_compiler

import hsdsl
from hsdsl.engine.simulate import verdict
from hsdsl.engine.simulate.stops import Diagnostics
from hsdsl.engine.simulate.verdict import RunView, assess, run_view
from hsdsl.engine.simulate.verdict.screen import Screen, screened

ROOT = Path(__file__).parents[2]
MODELS = (
    "models/bouncing-ball", "models/oscillator-with-stop-1", "models/oscillator-with-stop-2", "models/pronking-runner",
    "models/constrained-pendulum", "tests/conformance/cases/m10-flow-ends-at-guard",
    "tests/conformance/cases/m3-if-of-another-edge", "tests/conformance/cases/m5-jump-onto-surface",
    "tests/conformance/cases/m4-past-sizes", "tests/conformance/cases/m6-tie-file-order",
    "tests/conformance/cases/m6-tie-priority", "tests/conformance/cases/m6-guard-and-wall",
)  # fmt: skip


def model(x: str, y: str, when: str = "x >= 100", until: float = 3) -> Any:
    return hsdsl.loads(
        f"""
hsdsl: 1
modes:
  a:
    flow:
      x: {x}
      y: {y}
    transitions:
      - when: {when}
        to: b
  b: {{flow: {{x: 0, y: 0}}}}
initial: {{mode: a, x: 0, y: 1}}
experiment: {{until: {until}, scheme: located}}
"""
    )


def run_of(loaded: Any, method: str, tolerance: float, **parameters: float) -> Any:
    return loaded.simulate(scheme="located", method=method, tolerance=tolerance, parameters=parameters)


def screen_of(run: Any) -> Screen:
    screen = screened(run, run.finer)
    assert screen is not None
    return screen


FLOWS = {
    "tangent": ("cos(t)", "0", "x >= 0.9999999"),
    "near": ("y", "-x", "x >= 1 + 1e-8"),
    "root": ("1", "-sqrt(y)", "x >= 2"),
    "fast": ("y", "-x + exp(sin(3*t))", "x*y >= 1.2"),
    "powers": ("y**3/10", "-x**3 - y/(2 + x**2)", "x + y**2 >= 1.4"),
    "kinked": ("min(y, 0.7)", "-abs(x)", "max(x, y) >= 2"),
    "logarithm": ("log(2 + y)", "-tanh(x)*tan(y/3)", "atan2(x, 3) >= 0.9"),
    "pulse": ("exp(-((t - 1.7)/1e-3)**2)", "0", "x >= 2"),
}
UNSEEN = "a change of the flow of mode a may not have been seen"


def both(loaded: Any, method: str, tolerance: float, **parameters: float) -> tuple[Any, Any]:
    """The verdict of a run, and that without a screen."""
    found = run_of(loaded, method, tolerance, **parameters).verdict
    with (
        patch.object(verdict, "screens_of", return_value=None),
        patch.object(run_view, "screened", return_value=None),
        patch.object(verdict, "is_compiled", return_value=False),
    ):
        return found, run_of(loaded, method, tolerance, **parameters).verdict


def assert_alike(found: Any, expected: Any) -> None:
    """The same reasons; numbers in them may differ by how far bounds of round-off are rounded outwards."""
    texts, numbers = zip(*(_split("\n".join(each.reasons)) for each in (found, expected)), strict=True)
    assert (found.theorem, texts[0]) == (expected.theorem, texts[1])
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-4)


def _split(text: str) -> tuple[str, list[float]]:
    """A text without its numbers, and these."""
    number = r"\d[\d,]*(?:\.\d+)?(?:e[+-]\d+)?"
    return re.sub(number, "#", text), [float(each.replace(",", "")) for each in re.findall(number, text)]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize(("method", "tolerance"), [("taylor", 1e-9), ("dopri5", 1e-6)])
def test_findings_are_the_same(name: str, method: str, tolerance: float) -> None:
    found, expected = both(hsdsl.load(ROOT / f"{name}.yaml"), method, tolerance)
    assert_alike(found, expected)


@pytest.mark.parametrize("name", FLOWS)
@pytest.mark.parametrize(("method", "tolerance"), [("taylor", 1e-9), ("dop853", 1e-7), ("radau", 1e-5)])
def test_findings_of_small_flows_are_the_same(name: str, method: str, tolerance: float) -> None:
    method = "dopri5" if name == "kinked" and method == "taylor" else method  # which refuses kinks
    found, expected = both(model(*FLOWS[name]), method, tolerance)
    assert_alike(found, expected)


def test_a_pulse_between_stages_is_found() -> None:
    run = run_of(model(*FLOWS["pulse"]), "taylor", 1e-6)
    assert screen_of(run).undecided("flow change")
    assert any(reason.startswith(UNSEEN) for reason in run.verdict.reasons)


SMALL = {  # against the other terms of the flow, of width w; and by which method
    "time": ("-1.3*x + 0.006*exp(-((t - 1.13)/w)**2)", "radau"),
    "state": ("-sin(x) + 0.007/(1 + ((x - 0.37)/w)**2)**2", "dop853"),
    "speed": ("-x - 0.1*y + 0.004*(tanh((y - 0.5)/w + 1) - tanh((y - 0.5)/w - 1))", "taylor"),
    "factor": ("-x*(1 + 0.009*exp(-((t - 0.77)/w)**4))", "taylor"),
    "root": ("sqrt(2 + 0.01*cos((t - 1.4)/(14*w))**400) - 2*x", "taylor"),
    "sine": ("-x + sin(2 - x + 0.012*exp(-((t - 1.6)/w)**2))", "dopri5"),
    "input": ("u - 0.8*x", "taylor"),
    "quotient": ("-x/(1.5 + 0.013/(1 + ((t - 1.9)/w)**2)**2)", "dopri5"),
}


@pytest.mark.parametrize("name", SMALL)
def test_a_pulse_that_is_small_against_other_terms_is_found(name: str) -> None:
    flow, method = SMALL[name]
    loaded = hsdsl.loads(f"""
hsdsl: 1
parameters: {{w: 1}}
inputs: {{u: 0.005*exp(-((t - 1.2)/w)**2)}}
modes:
  before: {{flow: {{x: y, y: -x}}, transitions: [{{when: t >= 0.3, to: a}}]}}
  a: {{flow: {{x: y, y: "{flow}"}}, transitions: [{{when: x >= 100, to: before}}]}}
initial: {{mode: before, x: 0, y: 1}}
experiment: {{until: 3, scheme: located}}
""")
    for width, theorem in ((0.7, "holds"), (1.5e-4, "unknown")):
        found, expected = both(loaded, method, 1e-8, w=width)
        assert_alike(found, expected)
        assert found.theorem == theorem
        assert (theorem == "unknown") == any(reason.startswith(UNSEEN) for reason in found.reasons)


@pytest.mark.parametrize(("method", "tolerance"), [("dopri5", 3e-7), ("dop853", 1e-7)])
def test_how_polynomials_swing_around_the_flow_is_no_pulse(method: str, tolerance: float) -> None:
    found, expected = both(model("y", "-x + 0.5/(1 + exp(-25*(t - 2)))", until=5), method, tolerance)
    assert_alike(found, expected)
    assert found.theorem == "holds"


def test_of_a_clear_run_nothing_is_undecided() -> None:
    screen = screen_of(run_of(model("y", "-x + cos(2*t)"), "taylor", 1e-9))
    assert not screen.undecided()
    assert screen.margins.crossed == 0


def test_a_far_turning_point_is_the_nearest_miss() -> None:
    run = run_of(model("cos(t)", "0", "x >= 2"), "taylor", 1e-9)
    modes = run.compiled.plan.problem.program.modes
    (sentence,) = screen_of(run).margins.nearest_miss(modes)
    assert "t = 1.570796327" in sentence
    assert "more than a million times" in sentence


def test_a_screen_reads_no_further_than_its_columns() -> None:
    run = run_of(model("cos(t)", "0", "x >= 0.5"), "taylor", 1e-9)
    table = screen_of(run).table
    assert table.run.rows == len(run.times)
    assert table.run.transitions == len(run.transitions) == 1
    before = (ctypes.c_double * 2).from_address(table.run.before)
    assert np.array_equal(before, [run.transitions[0].before[name] for name in "xy"])


@needs_compiler
def test_ties_that_commute_need_no_closer_look():
    run = run_of(hsdsl.load(ROOT / "models/pronking-runner.yaml"), "taylor", 1e-9)
    screen = screen_of(run)
    assert screen.commuting and not screen.undecided()


@needs_compiler
def test_reasons_that_are_read_later_are_those_of_their_run() -> None:
    loaded = hsdsl.load(ROOT / "models/pronking-runner.yaml")
    runs: list[Any] = [loaded.simulate(scheme="located", tolerance=tolerance) for tolerance in (1e-9, 1e-6)]
    verdicts = [run.verdict for run in runs]
    assert all("reasons" not in vars(found) for found in verdicts)
    for run, found in zip(runs, verdicts, strict=True):
        fresh = assess(RunView(run.compiled.plan.problem, run), Diagnostics())
        assert pickle.loads(pickle.dumps(found)) == found == fresh
