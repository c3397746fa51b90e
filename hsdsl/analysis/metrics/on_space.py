"""The distance on a hybrid space, or a relaxed one, as a distance that can be bounded over cells of two curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.metrics.bernstein import bernstein, largest_norm, length
from hsdsl.analysis.metrics.merge import Side
from hsdsl.analysis.metrics.points import ModePoints, SpaceMetric
from hsdsl.engine.execution import Array


@dataclass(frozen=True)
class OnSpace:
    """Distances on M, where a strip's point (z, tau) counts as z, or with ``strips`` on the relaxed space."""

    metric: SpaceMetric
    strips: bool

    def over(self, a: Side, b: Side) -> Array:
        """Bound by the difference of the two polynomials, where the straight lines between them stay in one domain."""
        bound = np.full(len(a.pieces), np.inf)
        same = np.flatnonzero(self._in_one_domain(a, b))
        if len(same):
            bound[same] = largest_norm(a.powers[same] - b.powers[same])
            if self.strips:
                apart = np.max(a.depth[same] + b.depth[same], axis=1)
                bound[same] += apart
        return bound + a.rounding + b.rounding

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float) -> tuple[Array, Array]:
        """Bound at single times, mode pair by mode pair."""
        lower, upper = np.zeros(len(a.pieces)), np.full(len(a.pieces), np.inf)
        x, y = a.at_end(end), b.at_end(end)
        pairs = np.stack([a.trace.mode[a.pieces], b.trace.mode[b.pieces]], axis=1)
        for i, j in np.unique(pairs, axis=0).tolist():
            here = np.flatnonzero((pairs[:, 0] == i) & (pairs[:, 1] == j))
            p = self._points(a[here], i, x[here], times[here], end)
            q = self._points(b[here], j, y[here], times[here], end)
            lower[here], upper[here] = self.metric.between(p, q, enough)
            enough = max(enough, float(lower[here].max()))
        rounding = a.rounding + b.rounding
        return np.maximum(0.0, lower - rounding), upper + rounding

    def motion(self, side: Side) -> Array:
        """Bound the way by the length of the control polygon, with the depth and the time where they count."""
        way = length(side.powers) + side.stray
        if self.strips:
            way += np.abs(side.depth[:, 1] - side.depth[:, 0])
        return way + side.duration if self.metric.timed else way

    def _points(self, side: Side, mode: int, x: Array, times: Array, end: int) -> ModePoints:
        name, columns = side.trace.modes[mode]
        edge = side.edge if self.strips else np.full(len(times), "")
        depth = side.depth[:, end] if self.strips else np.zeros(len(times))
        return ModePoints(name, x[:, list(columns)], times, edge, depth)

    def _in_one_domain(self, a: Side, b: Side) -> Array:
        inside = np.zeros(len(a.pieces), dtype=bool)
        for i, layout in enumerate(a.trace.modes):
            if layout not in b.trace.modes:
                continue
            other = b.trace.modes.index(layout)
            here = np.flatnonzero((a.trace.mode[a.pieces] == i) & (b.trace.mode[b.pieces] == other))
            if len(here):
                inside[here] = self.metric.contains(layout[0], *self._hull(a[here], b[here], list(layout[1])))
        return inside

    def _hull(self, a: Side, b: Side, columns: list[int]) -> tuple[Array, Array]:
        """Boxes around both curves; with the time as last coordinate where it is one."""
        points = np.concatenate([bernstein(a.powers), bernstein(b.powers)], axis=1)[:, :, columns]
        low, high = points.min(axis=1), points.max(axis=1)
        if self.metric.timed:
            begin = a.trace.start[a.pieces]
            low, high = np.column_stack([low, begin]), np.column_stack([high, a.trace.end[a.pieces]])
        return low, high
