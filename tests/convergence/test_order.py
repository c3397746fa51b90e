"""Error against step and tolerance: every method keeps its order through transitions, at its samples and between them.

The relaxation is at most a thousandth of the smallest error, so what is left of it does not bend the slopes.
"""

from __future__ import annotations

import numpy as np
import pytest
from convergence.scene import SCENES, Scene, slope

from hsdsl.engine.integrators import INTEGRATORS, METHODS

FIXED = [name for name, table in INTEGRATORS.items() if table.embedded is None]
ADAPTIVE = [name for name, method in METHODS.items() if method.adaptive]
FINEST = {1: 12, 2: 9, 3: 8, 4: 8}  # the smallest step, 2**-k, by order
RELAXATION = "1e-15"


def slopes(scene: Scene, method: str, steps: list[float]) -> list[float]:
    """The orders of the errors at samples and between them, which the relaxation does not show in."""
    runs = [scene.run(method=method, step=step, relaxation=RELAXATION) for step in steps]
    both = [[error(run) for run in runs] for error in (scene.error_at_samples, scene.error_between)]
    assert all(min(errors) >= 1e3 * float(RELAXATION) for errors in both)
    return [slope(steps, errors) for errors in both]


@pytest.mark.parametrize("crossing", ["between samples", "at a sample"])
@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("method", FIXED)
def test_slope_in_the_step(method: str, scene: str, crossing: str) -> None:
    chosen, order = SCENES[scene], INTEGRATORS[method].order
    finest = FINEST[order]
    scale = 0.97 if crossing == "between samples" else chosen.first_crossing
    steps = [scale * 2.0**-k for k in range(finest - 4, finest + 1)]
    assert all(abs(found - order) <= 0.1 for found in slopes(chosen, method, steps))


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


LONG = {  # halvings of the step, and the least orders at samples and between them
    "dop853": (range(1, 6), 7.5, 7.5),  # 8, of the dense output 7; steps this long are not asymptotic
    "radau": (range(4, 11), 4.8, 3.8),  # 5, and 4 between samples in one step
}


@pytest.mark.parametrize("scene", ["switched", "nonlinear"])
@pytest.mark.parametrize("method", LONG)
def test_order_in_long_steps(method: str, scene: str) -> None:
    halvings, *least = LONG[method]
    found = slopes(SCENES[scene], method, [0.97 * 2.0 ** (-k / 2) for k in halvings])
    assert all(one >= order for one, order in zip(found, least, strict=True)), found


@pytest.mark.parametrize("method", [name for name in ADAPTIVE if name not in ("dop853", "taylor", "radau")])
@pytest.mark.parametrize("scene", ["switched", "nonlinear"])
def test_slope_in_the_tolerance(method: str, scene: str) -> None:
    chosen = SCENES[scene]
    tolerances = [10.0**-k for k in range(6, 12)]
    errors = [chosen.error_at_samples(chosen.run(method=method, tolerance=x, relaxation="1e-14")) for x in tolerances]
    assert abs(slope(tolerances, errors) - 1) <= 0.1, errors
