"""Point distances of a model's space, many at once, as the distances of curves ask for them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Array
from hsdsl.metrics.budget import Budget
from hsdsl.metrics.geometry import Space
from hsdsl.metrics.interval import weakest
from hsdsl.metrics.neighbours import Neighbours
from hsdsl.metrics.points import SpacePoint, distance, distances
from hsdsl.metrics.segment_containment import highest

QUICK, SLOW = 50_000, 20_000


@dataclass(frozen=True, eq=False)
class ModePoints:
    """n points of one mode: states (n, d), times, and the edge (else empty) and depth of a strip they are in."""

    mode: str
    x: Array
    t: Array
    edge: Array
    depth: Array


@dataclass(frozen=True)
class SpaceMetric:
    """The distance on M or, with a ``relaxation``, on the relaxed space."""

    space: Space
    relaxation: float | None = None
    budget: Budget = field(default_factory=Budget)
    hops: int | None = None
    _statuses: set[str] = field(default_factory=set[str], repr=False)

    @property
    def status(self) -> str:
        """What all bounds given so far rest on."""
        return weakest(*self._statuses)

    @property
    def timed(self) -> bool:
        """Whether time is a coordinate of the domains."""
        return self.space.timed

    @property
    def evaluations(self) -> int:
        """How many distances a search may take: they are quick where everything is affine, and slow elsewhere."""
        return QUICK if self.space.affine else SLOW

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self.space, self.relaxation or 0.0, self.budget, self.hops)

    def contains(self, mode: str, low: Array, high: Array) -> Array:
        """Whether whole boxes are known to be in a mode's domain, or that domain to be convex."""
        domain = self.space.domains[self.space.mode_index(self._named(mode))]
        inside = np.ones(len(low), dtype=bool)
        for formula in domain.curved:
            inside &= highest(formula, low, high) <= 0
        return inside

    def between(self, p: ModePoints, q: ModePoints, enough: float = 0.0) -> tuple[Array, Array]:
        """Bound the distances of pairs from below and above; bounds of at most ``enough`` need not be close."""
        lower, upper = np.zeros(len(p.t)), np.full(len(p.t), np.inf)
        waits = (p.edge != "") | (q.edge != "")
        flows = np.flatnonzero(~waits)
        if len(flows):
            lower[flows], upper[flows] = self._flowing(p, q, flows, enough)
        for k in np.flatnonzero(waits).tolist():
            ends = self._place(p, k), self._place(q, k)
            found = distance(self.space, *ends, self.relaxation, self.hops, self.budget)
            lower[k], upper[k] = found.interval.lower, found.interval.upper
            self._statuses.add(found.status)
        return lower, upper

    def _flowing(self, p: ModePoints, q: ModePoints, chosen: Array, enough: float) -> tuple[Array, Array]:
        (mode_p, x), (mode_q, y) = ((self._named(e.mode), self._coordinates(e, chosen)) for e in (p, q))
        known = None if self.space.affine else self._neighbours
        where = self.space, mode_p, x, mode_q, y, self.relaxation
        lower, upper, status = distances(*where, known, enough, self.hops, self.budget)
        self._statuses.add(status)
        return lower, upper

    def _named(self, mode: str) -> str:
        if mode not in self.space.modes:
            raise UsageError(f"the model has no mode '{mode}', which a run is in")
        return mode

    def _coordinates(self, points: ModePoints, chosen: Array) -> Array:
        x = points.x[chosen]
        return np.column_stack([x, points.t[chosen]]) if self.timed else x

    def _place(self, points: ModePoints, k: int) -> SpacePoint:
        x, edge = tuple(points.x[k].tolist()), str(points.edge[k]) or None
        depth = min(float(points.depth[k]), self.relaxation or 0.0)
        return SpacePoint(points.mode, x, edge, depth, float(points.t[k]) if self.timed else None)
