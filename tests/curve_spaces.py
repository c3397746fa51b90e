"""Point metrics with closed forms, so that distances of curves can be tested without searching for paths."""

from __future__ import annotations

import numpy as np

from hsdsl.analysis.metrics.interval import Budget


class Plane:
    """All modes are parts of one plane: the digital control system, or any model whose guards glue without moving."""

    timed = False
    evaluations = 50_000
    budget = Budget()
    status = "certified"

    def contains(self, mode, low, high):
        return np.ones(len(low), dtype=bool)

    def between(self, p, q, enough=0.0):
        apart = np.sqrt(np.sum((p.x - q.x) ** 2, axis=1)) + np.abs(p.depth - q.depth)
        return apart, apart


class Bent(Plane):
    """The same plane, but no domain is known to be convex: only single points and the way between them count."""

    def contains(self, mode, low, high):
        return np.zeros(len(low), dtype=bool)


class Line(Plane):
    """A ball on the ground h = 0 with restitution c is related to itself: (0, v) ~ (0, -c v) for v <= 0.

    The distance is the shortest of the straight way and the ways through one bounce of either point, searched for on a
    grid of the guard: an upper bound; the lower one is the difference of heights, which no passage changes.
    """

    def __init__(self, restitution, grid):
        self.c, self.grid = restitution, grid

    def between(self, p, q, enough=0.0):
        lower = np.abs(p.x[:, 0] - q.x[:, 0])
        v = self.grid[None, :]
        down = lambda x: np.hypot(x[:, :1], x[:, 1:] - v)  # noqa: E731
        up = lambda x: np.hypot(x[:, :1], x[:, 1:] + self.c * v)  # noqa: E731
        straight = np.sqrt(np.sum((p.x - q.x) ** 2, axis=1))
        bounced = np.minimum(np.min(down(p.x) + up(q.x), axis=1), np.min(up(p.x) + down(q.x), axis=1))
        return np.minimum(lower, straight), np.minimum(straight, bounced)


class Apart(Plane):
    """Modes that no edge connects."""

    def between(self, p, q, enough=0.0):
        if p.mode != q.mode:
            infinite = np.full(len(p.t), np.inf)
            return infinite, infinite
        return super().between(p, q)
