"""The shadow run of a run: the errors that it shows are those of the run, and nothing else holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl.engine.simulate.verdict import RunView
from hsdsl.engine.simulate.verdict.shadow import ShadowRun, order_of, shadow_errors

DUFFING = ("v", "x - x**3 - 0.3*v + 0.5*cos(1.2*t)", "x >= 1.2", "-0.9*v")
VAN_DER_POL = ("v", "3*(1 - x**2)*v - x", "x >= 1.5", "-v/2")
UNSTABLE = ("2*v", "2*x + sin(x)", "x*v >= 5000", "-v")
PAIRS = {"duffing": DUFFING, "van der pol": VAN_DER_POL, "unstable": UNSTABLE}
CLOSE, FAR = 2.0, 8.0  # how much larger or smaller the true error may be, by series and by corrections
METHODS = ["taylor", "radau", "dopri5"]
RELAXATION = """
  a: {flow: {x: v, v: 1e3*((1 - x**2)*v - x)}, transitions: [{name: down, when: x <= 1.2, to: b, reset: {x: x + 0.3}}]}
  b: {flow: {x: v, v: 1e3*((1 - x**2)*v - x)}, transitions: [{name: up, when: x >= 1.9, to: a}]}
initial: {mode: a, x: 1.5, v: 0}
"""  # the second crossing is in the fast part of the cycle
ROBERTSON = """
  a:
    flow: {x: -0.04*x + 1e4*y*z, y: 0.04*x - 1e4*y*z - 3e7*y**2, z: 3e7*y**2}
    transitions: [{name: refill, when: x <= 0.95, to: a, reset: {x: x + 0.02, z: z - 0.02}}]
initial: {mode: a, x: 1, y: 0, z: 0}
"""
CONTACT = """
  free: {flow: {x: v, v: -9.81}, transitions: [{name: hit, when: x <= 0, to: touch}]}
  touch: {flow: {x: v, v: -9.81 - 1e6*x - 300*v}, transitions: [{name: off, when: x >= 0, to: free}]}
initial: {mode: free, x: 1, v: 0}
"""
FOLLOWING = """
  up: {flow: {y: 1e4*(sin(z) - y), z: 1 + y/2, w: y - w}, transitions: [{name: down, when: y >= 0.9, to: down}]}
  down: {flow: {y: 1e4*(cos(z) - y), z: 1 - w, w: y - w}, transitions: [{name: up, when: y <= -0.8, to: up}]}
initial: {mode: up, y: 0, z: 0, w: 0.3}
"""
STIFF = {
    "relaxation": (RELAXATION, 2.5),
    "robertson": (ROBERTSON, 9),
    "contact": (CONTACT, 1.2),
    "fast": (FOLLOWING, 6),
}


def model(x: str, v: str, when: str, reset: str, until: float = 6, start: float = 0.1, method: str = "taylor") -> Any:
    return hsdsl.loads(
        f"""
hsdsl: 1
modes:
  a:
    flow: {{x: {x}, v: "{v}"}}
    transitions: [{{name: hit, when: {when}, to: a, reset: {{v: "{reset}"}}}}]
initial: {{mode: a, x: 0.5, v: {start}}}
experiment: {{until: {until}, scheme: located, method: {method}}}
"""
    )


def view(run: Any, **options: Any) -> RunView:
    return RunView(run.compiled.plan.problem, run, **options)


def stiff(name: str) -> Any:
    modes, until = STIFF[name]
    return hsdsl.loads(f"hsdsl: 1\nmodes:{modes}experiment: {{until: {until}, scheme: located, method: radau}}\n")


def hold_to_the_truth(run: Any, exact: Any, tolerance: float) -> None:
    """Hold what is shown against the error at ends of steps; inside them some methods are off by the tolerance."""
    close, inside = (CLOSE, 0.0) if run.method == "taylor" else (FAR, tolerance)
    shown, true = view(run, by_shadow=True).errors, view(run, against=exact).errors
    assert shown is not None
    assert true is not None
    assert shown.parted is None
    assert true.measured[-1].max() / close <= shown.measured[-1].max()
    assert (shown.measured[-1] <= close * true.measured[-1].max() + inside * true.sizes[-1] + 1e-11).all()
    if len(run.transitions):
        assert (
            true.time_errors[-1] / close <= shown.time_errors[-1] <= close * true.time_errors[-1] + inside / 10 + 1e-11
        )


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_it_shows_the_true_error(name: str, tolerance: float, method: str) -> None:
    exact = model(*PAIRS[name]).simulate(tolerance=1e-14)
    run = model(*PAIRS[name], method=method).simulate(tolerance=tolerance)
    hold_to_the_truth(run, exact, tolerance)


@pytest.mark.parametrize("name", STIFF)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_it_shows_the_true_error_of_stiff_runs(name: str, tolerance: float) -> None:
    loaded = stiff(name)
    exact = loaded.simulate(tolerance=1e-14, method="taylor")
    hold_to_the_truth(loaded.simulate(tolerance=tolerance), exact, tolerance)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", PAIRS)
def test_both_engines_follow_alike(name: str, method: str) -> None:
    alike(model(*PAIRS[name], method=method))


@pytest.mark.parametrize("name", STIFF)
def test_both_engines_follow_stiff_runs_alike(name: str) -> None:
    alike(stiff(name))


def alike(loaded: Any) -> None:
    run = loaded.simulate(tolerance=1e-6)
    in_c, in_python = view(run, by_shadow=True).screen, shadow_errors(view(run).problem, run)
    assert in_c is not None
    assert np.allclose(
        in_c.shadow_errors.state_errors, in_python.state_errors, rtol=1e-5, atol=1e-14 * abs(run.values).max()
    )
    assert np.allclose(in_c.shadow_errors.time_errors, in_python.time_errors, rtol=1e-5, atol=1e-12)
    verdicts = [loaded.simulate(tolerance=1e-6, engine=engine).verdict for engine in ("c", "python")]
    assert verdicts[0] == verdicts[1]


def test_fewer_terms_show_growth_that_the_run_does_not() -> None:
    """Where v is (x + 1/20)/20 it is a line, but its errors grow by exp(20 t), which no step of the run resolves."""
    loaded = model("1", "20*v - x", "x >= 9", "v", until=1.6, start=0.55 / 20)
    run = loaded.simulate(tolerance=1e-5)
    problem = view(run).problem
    assert problem.settings.method is not None
    most = order_of(problem.settings.method)
    fewer, all_terms = (ShadowRun(problem, run, most) for _ in range(2))
    assert most is not None
    all_terms.order = most
    for each in (fewer, all_terms):
        each.follow(run.arcs[0], None)
    assert np.allclose(fewer.state_errors, all_terms.state_errors, rtol=0.1, atol=1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_a_clear_run_is_not_repeated(method: str) -> None:
    run = model(*VAN_DER_POL, method=method).simulate(tolerance=1e-9)
    assert run.verdict.theorem == "holds"
    assert "finer" not in run.__dict__


def test_chaos_is_repeated_and_unknown() -> None:
    run = model(*DUFFING, until=200, start=0).simulate(tolerance=1e-9)
    assert run.verdict.theorem == "unknown"
    assert any(reason.startswith("the run is unreliable from t = ") for reason in run.verdict.reasons)
    assert "finer" in run.__dict__


@pytest.mark.parametrize(
    ("engine", "method"), [*(("c", method) for method in (*METHODS, "dop853")), ("python", "taylor")]
)
def test_round_off_that_both_share_is_seen(engine: str, method: str) -> None:
    """A rate of cos t is the sum of terms of 1e14, whose last digit is 0.016: round-off decides whether x reaches 1."""
    flow = {"x": "(c + 1e7)**2 - 1e14 - 2e7*c - c**2 + c", "c": "-s", "s": "c"}
    loaded = hsdsl.loads(
        f"""
hsdsl: 1
modes: {{a: {{flow: {flow}, transitions: [{{name: hit, when: x >= 1.0005, to: a, reset: {{x: x - 3}}}}]}}}}
initial: {{mode: a, x: 0, c: 1, s: 0}}
experiment: {{until: 2.5, scheme: located, method: {method}}}
"""
    )
    assert loaded.simulate(tolerance=1e-5, engine=engine).verdict.theorem == "unknown"


def test_one_that_cannot_follow_is_no_proof() -> None:
    run = model("1", "0", "1 - (x - 2)**2 - 1 + 1e-13 >= 0", "v").simulate(tolerance=1e-9)  # all but tangent
    assert run.verdict.theorem != "holds"
