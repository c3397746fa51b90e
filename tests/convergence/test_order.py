"""Error against step and tolerance: every method keeps its order through transitions, at its samples and between them.

The relaxation is at most a thousandth of the smallest error, so what is left of it does not bend the slopes.
"""

from __future__ import annotations

import numpy as np
import pytest
from convergence.scene import SCENES, slope

from hsdsl.integrators import INTEGRATORS, METHODS

FIXED = [name for name, table in INTEGRATORS.items() if table.embedded is None]
ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
FINEST = {1: 12, 2: 9, 3: 8, 4: 8}  # the smallest step, 2**-k, by order
RELAXATION = "1e-15"


@pytest.mark.parametrize("crossing", ["between samples", "at a sample"])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", FIXED)
def test_slope_in_the_step(method: str, scene: str, crossing: str) -> None:
    chosen, order = SCENES[scene], INTEGRATORS[method].order
    finest = FINEST[order]
    scale = 0.97 if crossing == "between samples" else chosen.first_crossing
    steps = [scale * 2.0**-k for k in range(finest - 4, finest + 1)]
    runs = [chosen.run(method=method, step=step, relaxation=RELAXATION) for step in steps]
    for errors in (list(map(chosen.error_at_samples, runs)), list(map(chosen.error_between, runs))):
        assert min(errors) >= 1e3 * float(RELAXATION)
        assert abs(slope(steps, errors) - order) <= 0.1, errors


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", ADAPTIVE)
def test_error_against_tolerance(method: str, scene: str) -> None:
    """Errors stay in proportion to the tolerance, which bounds each step's: at samples, and between them."""
    chosen = SCENES[scene]
    tolerances = [10.0**-k for k in range(4, 10 if method == "radau" else 12)]  # an estimate of h**4 takes many steps
    runs = [chosen.run(method=method, tolerance=tolerance, relaxation="1e-14") for tolerance in tolerances]
    at_samples = np.array([chosen.error_at_samples(run) for run in runs]) / tolerances
    between = np.array([chosen.error_between(run) for run in runs]) / tolerances
    assert np.all(at_samples <= 10), at_samples
    assert np.all(between <= 50), between


@pytest.mark.parametrize("scene", ["switched", "nonlinear"])
def test_order_eight_in_the_step(scene: str) -> None:
    """At samples, and between them by the dense output (order 7, so its error in one step is of order 8)."""
    chosen = SCENES[scene]
    steps = [0.97 * 2.0 ** (-k / 2) for k in range(1, 6)]
    runs = [chosen.run(method="dop853", step=step, relaxation=RELAXATION) for step in steps]
    for errors in (list(map(chosen.error_at_samples, runs)), list(map(chosen.error_between, runs))):
        assert min(errors) >= 1e3 * float(RELAXATION)
        assert slope(steps, errors) >= 7.5, errors  # steps this long are not asymptotic: some fall faster


@pytest.mark.parametrize("scene", ["switched", "nonlinear"])
def test_order_of_radau_in_the_step(scene: str) -> None:
    """Five at samples, and four between them in one step, so that a curve of a smooth flow has order four."""
    chosen = SCENES[scene]
    steps = [0.97 * 2.0 ** (-k / 2) for k in range(4, 11)]
    runs = [chosen.run(method="radau", step=step, relaxation=RELAXATION) for step in steps]
    for errors, order in ((list(map(chosen.error_at_samples, runs)), 5), (list(map(chosen.error_between, runs)), 4)):
        assert min(errors) >= 1e3 * float(RELAXATION)
        assert slope(steps, errors) >= order - 0.2, errors


@pytest.mark.parametrize("method", [name for name in ADAPTIVE if name not in ("dop853", "taylor", "radau")])
@pytest.mark.parametrize("scene", ["switched", "nonlinear"])
def test_slope_in_the_tolerance(method: str, scene: str) -> None:
    chosen = SCENES[scene]
    tolerances = [10.0**-k for k in range(6, 12)]
    errors = [chosen.error_at_samples(chosen.run(method=method, tolerance=x, relaxation="1e-14")) for x in tolerances]
    assert abs(slope(tolerances, errors) - 1) <= 0.1, errors
