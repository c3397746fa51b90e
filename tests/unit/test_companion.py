"""The companion of a run by Taylor series: the errors that it shows are those of the run, and nothing else holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl.simulate.verdict import RunView
from hsdsl.simulate.verdict.companion import accompany, order_of
from hsdsl.simulate.verdict.follower import Follower

DUFFING = ("v", "x - x**3 - 0.3*v + 0.5*cos(1.2*t)", "x >= 1.2", "-0.9*v")
VAN_DER_POL = ("v", "3*(1 - x**2)*v - x", "x >= 1.5", "-v/2")
UNSTABLE = ("2*v", "2*x + sin(x)", "x*v >= 5000", "-v")
PAIRS = {"duffing": DUFFING, "van der pol": VAN_DER_POL, "unstable": UNSTABLE}
CLOSE = 2.0  # how much larger or smaller the true error may be


def model(x: str, v: str, when: str, reset: str, until: float = 6, start: float = 0.1) -> Any:
    return hsdsl.loads(
        f"""
hsdsl: 1
modes:
  a:
    flow: {{x: {x}, v: "{v}"}}
    transitions: [{{name: hit, when: {when}, to: a, reset: {{v: "{reset}"}}}}]
initial: {{mode: a, x: 0.5, v: {start}}}
experiment: {{until: {until}, scheme: located, method: taylor}}
"""
    )


def view(run: Any, **options: Any) -> RunView:
    return RunView(run.compiled.under_way.plan.problem, run, **options)


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_it_shows_the_true_error(name: str, tolerance: float) -> None:
    loaded = model(*PAIRS[name])
    run, exact = (loaded.simulate(tolerance=each) for each in (tolerance, 1e-14))
    shown, true = view(run, accompanied=True).errors, view(run, against=exact).errors
    assert shown is not None
    assert true is not None
    for of_true, found in ((true.measured[-1].max(), shown.measured[-1].max()), (true.late[-1], shown.late[-1])):
        assert of_true / CLOSE <= found <= CLOSE * of_true + 1e-11


@pytest.mark.parametrize("name", PAIRS)
def test_both_engines_follow_alike(name: str) -> None:
    loaded = model(*PAIRS[name])
    run = loaded.simulate(tolerance=1e-6)
    in_c, in_python = view(run, accompanied=True).screen, accompany(view(run).problem, run)
    assert in_c is not None
    assert np.allclose(in_c.companion.apart, in_python.apart, rtol=1e-6, atol=1e-14)
    assert np.allclose(in_c.companion.late, in_python.late, rtol=1e-6, atol=1e-14)
    verdicts = [loaded.simulate(tolerance=1e-6, engine=engine).verdict for engine in ("c", "python")]
    assert verdicts[0] == verdicts[1]


def test_fewer_terms_show_growth_that_the_run_does_not() -> None:
    """Where v is (x + 1/20)/20 it is a line, but its errors grow by exp(20 t), which no step of the run resolves."""
    loaded = model("1", "20*v - x", "x >= 9", "v", until=1.6, start=0.55 / 20)
    run = loaded.simulate(tolerance=1e-5)
    problem = view(run).problem
    fewer, all_terms = (Follower(problem, run, order_of(problem.settings.method)) for _ in range(2))
    all_terms.order = all_terms.most
    for each in (fewer, all_terms):
        each.follow(run.arcs[0], None)
    assert np.allclose(fewer.apart, all_terms.apart, rtol=0.1, atol=1e-14)


def test_a_clear_run_is_not_repeated() -> None:
    run = model(*VAN_DER_POL).simulate(tolerance=1e-9)
    assert run.verdict.theorem == "holds"
    assert "finer" not in run.__dict__


def test_chaos_is_repeated_and_unknown() -> None:
    run = model(*DUFFING, until=200, start=0).simulate(tolerance=1e-9)
    assert run.verdict.theorem == "unknown"
    assert any(reason.startswith("the run is unreliable from t = ") for reason in run.verdict.reasons)
    assert "finer" in run.__dict__


@pytest.mark.parametrize("engine", ["c", "python"])
def test_round_off_that_both_share_is_seen(engine: str) -> None:
    """A rate of cos t is the sum of terms of 1e14, whose last digit is 0.016: round-off decides whether x reaches 1."""
    flow = {"x": "(c + 1e7)**2 - 1e14 - 2e7*c - c**2 + c", "c": "-s", "s": "c"}
    loaded = hsdsl.loads(
        f"""
hsdsl: 1
modes: {{a: {{flow: {flow}, transitions: [{{name: hit, when: x >= 1.0005, to: a, reset: {{x: x - 3}}}}]}}}}
initial: {{mode: a, x: 0, c: 1, s: 0}}
experiment: {{until: 2.5, scheme: located, method: taylor}}
"""
    )
    assert loaded.simulate(tolerance=1e-5, engine=engine).verdict.theorem == "unknown"


def test_one_that_cannot_follow_is_no_proof() -> None:
    run = model("1", "0", "1 - (x - 2)**2 - 1 + 1e-13 >= 0", "v").simulate(tolerance=1e-9)  # all but tangent
    assert run.verdict.theorem != "holds"
