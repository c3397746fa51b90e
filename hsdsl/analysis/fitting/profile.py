"""Profile likelihood: how far a value can move until the best fit of the others is worse than chance allows.

A covariance treats the sum of squares as a parabola. A profile follows the sum itself, and may be asymmetric (Bates and
Watts, Nonlinear Regression Analysis, 1988, section 6.1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import brentq  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]
from scipy.special import chdtri, stdtrit  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from hsdsl.engine.execution import Array

Numbers = Callable[[Array], Array]
Minimum = Callable[[Numbers, Numbers, Array, Array, Array], Any]  # of residuals and slopes, as `_minimum` there
PRECISE = 1e-4  # of the distance from the value to an end: how well ends are located
STEEP = 0.1  # of the root of the rise: the least change across an end, as far as it is located, that is a jump
FURTHEST = 12  # doublings of the first step in which an end is sought


def rise_of(level: float, variance: float, free: int, sigma: bool) -> float:
    """How much the sum of squares may rise: by chi square where deviations are known, else by the F distribution."""
    chance: Any = chdtri(1, 1 - level) if sigma else variance * stdtrit(free, (1 + level) / 2) ** 2  # F(1, n) is t^2
    return float(chance)


@dataclass(frozen=True)
class Profile:
    """The sum of squares as a function of one value, the others fitted to each of its values.

    ``limits`` (n, 2) and ``sizes`` (n,) are those of all values, ``best`` (n,) the fit, ``total`` its sum of squares.
    """

    objective: Any
    minimum: Minimum
    best: Array
    limits: Array
    sizes: Array
    total: float
    jumps: list[tuple[int, float]] = field(default_factory=list[tuple[int, float]])  # ends at which the sum jumps

    def interval(self, k: int, step: float, rise: float) -> tuple[float, float]:
        """Where the sum of squares has risen by so much; a bound, or infinite, where it does not rise as far."""
        return self._end(k, -step, rise), self._end(k, step, rise)

    def _end(self, k: int, step: float, rise: float) -> float:
        near, others = float(self.best[k]), np.delete(self.best, k)
        bound = float(self.limits[k, int(step > 0)])
        known = {near: -(rise**0.5)}  # a fit from other values may find another minimum, and change a sign

        def excess(value: float) -> float:
            """Signed roots of the sums are near to a line, where these themselves are near to a parabola."""
            nonlocal others
            if value not in known:
                best = others

                def residuals(x: Array) -> Array:
                    return self.objective.residuals(np.insert(x, k, value))

                def slopes(x: Array) -> Array:
                    return np.delete(self.objective.slopes(np.insert(x, k, value)), k, axis=1)

                if len(others):
                    keep = np.delete(np.arange(len(self.best)), k)
                    best = self.minimum(residuals, slopes, others, self.limits[keep], self.sizes[keep]).x
                found = float(np.sum(residuals(best) ** 2))
                known[value] = max(found - self.total, 0.0) ** 0.5 - rise**0.5
                others = best if known[value] <= 0 else others  # a run that failed leads nowhere
            return known[value]

        def located(inside: float, outside: float) -> float:
            """The end between two values, at which the sum may jump over its level."""
            solve: Any = brentq  # pyright: ignore[reportUnknownVariableType]
            end = float(solve(excess, inside, outside, xtol=PRECISE * abs(outside - near), rtol=1e-12))
            below, above = (
                known[min((v for v in known if (known[v] > 0) == over), key=lambda v: abs(v - end))]
                for over in (False, True)
            )
            if above - below > STEEP * rise**0.5 > 0 and excess(end) != 0:
                self.jumps.append((k, end))
            return end

        inside = near
        for doubled in range(FURTHEST):
            value = near + step * 2.0**doubled
            beyond = abs(bound - near) <= abs(value - near)
            value = bound if beyond else value
            if value != inside and excess(value) > 0:
                return located(inside, value)
            if beyond:
                return bound
            inside = value
        return float(np.copysign(np.inf, step))

    def intervals(self, names: Sequence[str], covariance: Array, rise: float) -> dict[str, tuple[float, float]]:
        """The interval of each value; the first step is a standard deviation, or where there is none the size."""
        deviations = np.sqrt(np.diag(covariance))
        steps = np.where((deviations > 0) & np.isfinite(deviations), deviations, self.sizes)
        return {name: self.interval(k, float(steps[k]), rise) for k, name in enumerate(names)}
