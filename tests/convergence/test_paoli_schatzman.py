"""The Paoli-Schatzman scheme against the closed forms of Sec. V-B, in position at its steps (the paper's rho-hat)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from references.impact_oscillator import Motion, exact_example_1, exact_example_2
from shipped import MODELS

import hsdsl


def error(example: int, step: float) -> float:
    """Largest error in position at the steps."""
    solution: Motion = exact_example_1() if example == 1 else exact_example_2()
    run: Any = hsdsl.load(MODELS / f"oscillator-with-stop-{example}.yaml").simulate(scheme="paoli-schatzman", step=step)
    return float(np.max(np.abs(run.values[:-1, 0] - solution.at(run.times[:-1])[0])))


def test_example_2_as_recorded_by_the_authors() -> None:
    assert abs(error(2, 5e-4) - 1.0025e-4) <= 5e-9


def test_example_2_is_of_first_order_over_both_zeno_points() -> None:
    steps = [8e-3, 4e-3, 2e-3, 1e-3]
    slope = np.polyfit(np.log(steps), np.log([error(2, h) for h in steps]), 1)[0]
    assert abs(slope - 1) <= 0.02


@pytest.mark.parametrize(("step", "low", "high"), [(1e-3, 1.3, 1.6), (5e-4, 0.24, 0.33), (2.5e-4, 0.15, 0.19)])
def test_example_1_as_the_recurrence_gives_it(step: float, low: float, high: float) -> None:
    """Above 1e-3 an impact is added near t = 10.18, and the error is of whole units; below it falls with the step."""
    assert low <= error(1, step) <= high
