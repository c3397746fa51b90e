"""The stiff model's last switch, 3.5e-7 before its end: met or undecided, never passed over silently."""

from pathlib import Path

import pytest

import hsdsl

MODEL = Path(__file__).parents[2] / "models" / "stiff-switch.yaml"
LAST = 4.999999646216
UNDECIDED = "a transition of switch_down within the error of the end is undecided"
UNRELIABLE = "the run is unreliable from t = 4.99999"  # a finer run makes the last switch


@pytest.fixture(scope="module")
def model():
    return hsdsl.load(MODEL)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4, 1e-5, 1e-6])
def test_loose_tolerances_say_that_it_is_undecided(model, tolerance):
    verdict = model.simulate(tolerance=tolerance).verdict
    assert verdict.theorem == "unknown"
    assert any(UNDECIDED in reason or UNRELIABLE in reason for reason in verdict.reasons)


@pytest.mark.parametrize("tolerance", [1e-7, 1e-8, 1e-9])
def test_tight_tolerances_meet_it(model, tolerance):
    run = model.simulate(tolerance=tolerance)
    assert len(run.transitions) == 5
    assert run.transitions[-1].time == pytest.approx(LAST, abs=tolerance)
