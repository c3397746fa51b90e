"""Point distances of a model's space, many at once, as the distances of curves ask for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Array
from hsdsl.metrics.curves import Points
from hsdsl.metrics.geometry import Space
from hsdsl.metrics.points import Place, distance, distances

QUICK, SLOW = 50_000, 2_000


@dataclass(frozen=True)
class SpaceMetric:
    """The distance on M or, with a ``relaxation``, on the relaxed space."""

    space: Space
    relaxation: float | None = None

    @property
    def timed(self) -> bool:
        """Whether time is a coordinate of the domains."""
        return self.space.timed

    @property
    def budget(self) -> int:
        """Distances are quick where everything is affine, and solved one by one elsewhere."""
        return QUICK if self.space.affine else SLOW

    def convex(self, mode: str) -> bool:
        """Whether a mode's domain is known to be convex."""
        return self.space.domains[self._index(mode)].convex

    def between(self, p: Points, q: Points) -> tuple[Array, Array]:
        """Bound the distances of pairs from below and above."""
        lower, upper = np.zeros(len(p.t)), np.full(len(p.t), np.inf)
        waits = (p.edge != "") | (q.edge != "")
        flows = np.flatnonzero(~waits)
        if len(flows):
            lower[flows], upper[flows] = distances(
                self.space, p.mode, self._coordinates(p, flows), q.mode, self._coordinates(q, flows), self.relaxation
            )
        for k in np.flatnonzero(waits).tolist():
            found = distance(self.space, self._place(p, k), self._place(q, k), self.relaxation).interval
            lower[k], upper[k] = found.lower, found.upper
        return lower, upper

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
