"""Point distances of a model's space, many at once, as the distances of curves ask for them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Array
from hsdsl.metrics.budget import Budget
from hsdsl.metrics.geometry import Space
from hsdsl.metrics.inside import highest
from hsdsl.metrics.neighbours import Neighbours
from hsdsl.metrics.on_space import Points
from hsdsl.metrics.points import Place, distance, distances

QUICK, SLOW = 50_000, 20_000


@dataclass(frozen=True)
class SpaceMetric:
    """The distance on M or, with a ``relaxation``, on the relaxed space."""

    space: Space
    relaxation: float | None = None
    budget: Budget = field(default_factory=Budget)

    @property
    def timed(self) -> bool:
        """Whether time is a coordinate of the domains."""
        return self.space.timed

    @property
    def evaluations(self) -> int:
        """Distances are quick where everything is affine, and take local solves elsewhere."""
        return QUICK if self.space.affine else SLOW

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self.space, self.relaxation, self.budget)

    def contains(self, mode: str, low: Array, high: Array) -> Array:
        """Whether whole boxes are known to be in a mode's domain, or that domain to be convex."""
        domain = self.space.domains[self._index(mode)]
        inside = np.ones(len(low), dtype=bool)
        for formula in domain.curved:
            inside &= highest(formula, low, high) <= 0
        return inside

    def between(self, p: Points, q: Points, enough: float = 0.0) -> tuple[Array, Array]:
        """Bound the distances of pairs from below and above; bounds of at most ``enough`` need not be close."""
        lower, upper = np.zeros(len(p.t)), np.full(len(p.t), np.inf)
        waits = (p.edge != "") | (q.edge != "")
        flows = np.flatnonzero(~waits)
        if len(flows):
            lower[flows], upper[flows] = self._flowing(p, q, flows, enough)
        for k in np.flatnonzero(waits).tolist():
            found = distance(self.space, self._place(p, k), self._place(q, k), self.relaxation, budget=self.budget)
            lower[k], upper[k] = found.interval.lower, found.interval.upper
        return lower, upper

    def _flowing(self, p: Points, q: Points, chosen: Array, enough: float) -> tuple[Array, Array]:
        x, y = self._coordinates(p, chosen), self._coordinates(q, chosen)
        for points in (p, q):
            self._index(points.mode)
        if self.space.affine:
            return distances(self.space, p.mode, x, q.mode, y, self.relaxation)
        return distances(self.space, p.mode, x, q.mode, y, self.relaxation, self._neighbours, enough)

    def _index(self, mode: str) -> int:
        try:
            return self.space.mode_index(mode)
        except KeyError:
            raise UsageError(f"the model has no mode '{mode}', which a run is in") from None

    def _coordinates(self, points: Points, chosen: Array) -> Array:
        x = points.x[chosen]
        return np.column_stack([x, points.t[chosen]]) if self.timed else x

    def _place(self, points: Points, k: int) -> Place:
        x, edge = tuple(points.x[k].tolist()), str(points.edge[k]) or None
        depth = min(float(points.depth[k]), self.relaxation or 0.0)
        return Place(points.mode, x, edge, depth, float(points.t[k]) if self.timed else None)
