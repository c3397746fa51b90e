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

from hsdsl.analysis.fitting.jumps import MOST_SIDES, around, lowest
from hsdsl.engine.execution import Array

Numbers = Callable[[Array], Array]
Minimum = Callable[[Numbers, Numbers, Array, Array, Array], Any]  # of residuals and slopes, as `_minimum` there
Known = dict[float, tuple[float, Array]]  # by a value: the excess of the sum, signed, and the others
Firsts = Callable[[int, float, Known], Sequence[Array]]  # of the others, for a value
HALVINGS = 16  # of the distance over which the sum seems to jump
PRECISE = 1e-4  # of the distance from the value to an end: how well ends are located
STEEP = 0.1  # of the root of the rise: the least change across an end, as far as it is located, that is a jump
FURTHEST = 12  # doublings of the first step in which an end is sought


def rise_of(level: float, variance: float, free: int, sigma: bool) -> float:
    """How much the sum of squares may rise: by chi square where deviations are known, else by the F distribution."""
    chance: Any = chdtri(1, 1 - level) if sigma else variance * stdtrit(free, (1 + level) / 2) ** 2  # F(1, n) is t^2
    return float(chance)


def _bracket(known: Known) -> tuple[float, float]:
    """The neighbouring values inside and outside that are nearest to each other."""
    inside, outside = ([v for v in known if (known[v][0] > 0) == over] for over in (False, True))
    return min(((a, b) for a in inside for b in outside), key=lambda each: abs(each[0] - each[1]))


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
    lower: list[tuple[float, Array]] = field(default_factory=list[tuple[float, Array]])  # sums below that of the fit

    def interval(self, k: int, step: float, rise: float) -> tuple[float, float]:
        """Where the sum of squares has risen by so much; a bound, or infinite, where it does not rise as far."""
        return self._end(k, -step, rise), self._end(k, step, rise)

    def _end(self, k: int, step: float, rise: float) -> float:
        near, bound = float(self.best[k]), float(self.limits[k, int(step > 0)])
        known = {near: (-(rise**0.5), np.delete(self.best, k))}
        end = self._sought(k, step, known, rise, self._neighbour)
        if self._jumps(known, rise) and len(self.best) > 1:  # the fit of the others may have met the jump, not the sum
            for value in [value for value in known if known[value][0] > 0]:
                del known[value]
            end = self._sought(k, step, known, rise, self._others)
        if end != bound and self._jumps(known, rise):
            self.jumps.append((k, end))
        return end

    def _sought(self, k: int, step: float, known: Known, rise: float, firsts: Firsts) -> float:
        """An end; ``known`` gets the signed excess of the sum by the value, and the others fitted to it."""
        near, bound = float(self.best[k]), float(self.limits[k, int(step > 0)])

        def excess(value: float) -> float:
            """Signed roots of the sums are near to a line, where these themselves are near to a parabola."""
            if value not in known:
                found = self._fitted(k, value, firsts(k, value, known))
                if self.total - found[0] > PRECISE * rise:
                    self.lower.append((found[0], np.insert(found[1], k, value)))
                known[value] = max(found[0] - self.total, 0.0) ** 0.5 - rise**0.5, found[1]
            return known[value][0]

        def located(inside: float, outside: float) -> float:
            """The end between two values, at which the sum may jump over its level."""
            solve: Any = brentq  # pyright: ignore[reportUnknownVariableType]
            end = float(solve(excess, inside, outside, xtol=PRECISE * abs(outside - near), rtol=1e-12))
            for _ in range(HALVINGS):  # what jumps there jumps by as much over a shorter distance
                if excess(end) == 0 or not self._jumps(known, rise):
                    break
                end = sum(_bracket(known)) / 2
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

    def _fitted(self, k: int, value: float, firsts: Sequence[Array]) -> tuple[float, Array]:
        """The lowest sum of squares with this value, from some first values of the others, and these."""

        def residuals(x: Array) -> Array:
            return self.objective.residuals(np.insert(x, k, value))

        def slopes(x: Array) -> Array:
            return np.delete(self.objective.slopes(np.insert(x, k, value)), k, axis=1)

        keep = np.delete(np.arange(len(self.best)), k)
        found = [
            self.minimum(residuals, slopes, first, self.limits[keep], self.sizes[keep]).x if len(first) else first
            for first in firsts
        ]
        sums = [float(np.sum(residuals(x) ** 2)) for x in found]
        return min(zip(sums, found, strict=True), key=lambda each: each[0])

    def _neighbour(self, k: int, value: float, known: Known) -> Sequence[Array]:
        """The others fitted to the nearest value inside; a run that failed leads nowhere."""
        return [known[min((v for v in known if known[v][0] <= 0), key=lambda v: abs(v - value))][1]]

    def _others(self, k: int, value: float, known: Known) -> Sequence[Array]:
        """First values on all sides of a jump: the neighbours, their lines, the tangent, and values around.

        Those with the lowest sum of each order of transitions count.
        """
        neighbours = sorted(known, key=lambda v: abs(v - value))[:2]
        starts: list[Array] = [*(known[v][1] for v in neighbours), *self._neighbour(k, value, known)]
        if len(neighbours) == 2:
            (a, b), (p, q) = neighbours, starts[:2]
            starts.append(p + (value - a) / (b - a) * (q - p))
        slopes: Array = self.objective.slopes(self.best)
        solved: Any = np.linalg.lstsq(np.delete(slopes, k, axis=1), -slopes[:, k], rcond=None)[0]
        starts.append(np.delete(self.best, k) + (value - self.best[k]) * solved)
        keep = np.delete(np.arange(len(self.best)), k)
        low, high = self.limits[keep, 0], self.limits[keep, 1]
        wide = around(self._neighbour(k, value, known)[0], self.limits[keep], self.sizes[keep])
        points = [np.insert(np.clip(x, low, high), k, value) for x in (*starts, *wide)]
        found = [np.delete(x, k) for x, _, _ in lowest(self.objective, points)]
        return found[:MOST_SIDES] or starts[:1]

    def _jumps(self, known: Known, rise: float) -> bool:
        """Whether the sum seems to jump between the last value inside and the first one outside."""
        if not any(over > 0 for over, _ in known.values()):
            return False
        inside, outside = _bracket(known)
        return known[inside][0] != 0 and known[outside][0] - known[inside][0] > STEEP * rise**0.5 > 0

    def intervals(self, names: Sequence[str], covariance: Array, rise: float) -> dict[str, tuple[float, float]]:
        """The interval of each value; the first step is a standard deviation, or where there is none the size."""
        deviations = np.sqrt(np.diag(covariance))
        steps = np.where((deviations > 0) & np.isfinite(deviations), deviations, self.sizes)
        return {name: self.interval(k, float(steps[k]), rise) for k, name in enumerate(names)}
