"""Error against the relaxation: of first order (Corollary 28).

The delay of a transition is eps + tau (1/s - 1) with tau anywhere in (0, eps], so the error of one run scatters; the
median over step sizes does not.
"""

from __future__ import annotations

import numpy as np
import pytest
from convergence.scene import SCENES, slope


@pytest.mark.parametrize("scene", SCENES)
def test_slope_in_the_relaxation(scene: str) -> None:
    chosen = SCENES[scene]
    relaxations = np.logspace(-3, -7, 9)
    steps = np.linspace(0.011, 0.019, 11)
    medians = [
        np.median([chosen.error_between(chosen.run(method="rk4", step=h, relaxation=eps)) for h in steps])
        for eps in relaxations
    ]
    assert abs(slope(relaxations, medians) - 1) <= 0.05, medians
