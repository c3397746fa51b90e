"""Distances of many pairs of points in the same two modes: the search of `hsdsl.metrics.search`, for arrays.

Sequences of passages are gone through by length; each keeps only the pairs for which it can still be the shortest.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.dominance import followers, hops_of, may_follow, passage_number
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.interval import CERTIFIED, Interval, up_to_hops, weakest
from hsdsl.metrics.passage_bounds import ROUNDING, Indices, Ways
from hsdsl.metrics.rounding import norm
from hsdsl.metrics.search import TOLERANCE


@dataclass
class Pairs:
    """The pairs and what is known of them: ``upper`` the best path, ``lower`` the least that any path can have.

    ``status`` is what the bounds rest on.
    """

    space: Space
    source: int
    p: Array
    target: int
    q: Array
    toll: float
    upper: Array
    lower: Array
    status: str = CERTIFIED

    @classmethod
    def of(cls, space: Space, source: int, p: Array, target: int, q: Array, relaxation: float | None) -> Pairs:
        """Begin with the straight line, where both are in one mode."""
        straight = norm(p - q) if source == target else np.full(len(p), np.inf)
        return cls(space, source, p, target, q, relaxation or 0.0, straight * (1 + ROUNDING), straight * (1 - ROUNDING))

    def ways(self, budget: Budget) -> Ways:
        """Their bounds by passages."""
        return Ways(self.space, self.source, self.p, self.target, self.q, self.toll, budget)

    def least(self) -> Array:
        """A lower bound that holds everywhere: what no passage changes."""
        if self.space.kept is None:
            return np.zeros(len(self.p))
        own, other = list(self.space.kept[self.source]), list(self.space.kept[self.target])
        return norm(self.p[:, own] - self.q[:, other]) * (1 - ROUNDING)

    def bounds(self) -> tuple[Array, Array, str]:
        """Lower and upper ends, and what they rest on; raises :class:`EndsCross` where they contradict."""
        if np.any(self.lower > self.upper):
            worst = int(np.argmax(self.lower > self.upper))
            Interval(float(self.lower[worst]), float(self.upper[worst]))
        return self.lower, self.upper, self.status

    def open(self, bounds: Array, indices: Indices) -> Indices:
        """Those of ``indices`` whose bound is still below the best path; the lower end remembers the others."""
        still = bounds < self.upper[indices] * (1 - TOLERANCE)
        if not still.all():
            self.leave(bounds[~still], indices[~still])
        return indices[still]

    def cut(self, bounds: Array, indices: Indices, hops: int) -> None:
        """Leave out paths with more passages; where one of them could be shorter, the status says so."""
        if self.open(bounds, indices).size:
            self.status = weakest(self.status, up_to_hops(hops))
        self.leave(bounds, indices)

    def leave(self, bounds: Array, indices: Indices) -> None:
        """Look no further at paths that are at least so long."""
        self.lower[indices] = np.minimum(self.lower[indices], bounds)


def search_batch(pairs: Pairs, hops: int, budget: Budget) -> None:
    """Improve ``pairs`` until no sequence of at most ``hops`` passages can be shorter, or the time is over."""
    space = pairs.space
    everything = np.arange(len(pairs.p))
    floor = pairs.least()
    beginning = [p.index for p in space.passages if p.source == pairs.source]
    layer: list[tuple[tuple[int, ...], Indices]] = []
    if beginning and (active := pairs.open(floor, everything)).size:
        layer = [((index,), active) for index in beginning]
    if not layer:
        return
    ways = pairs.ways(budget)
    while layer:
        following: list[tuple[tuple[int, ...], Indices]] = []
        for sequence, candidates in layer:
            if budget.spent():
                pairs.leave(floor[candidates], candidates)
                continue
            active = _promising(pairs, sequence, candidates, floor, ways)
            if hops_of(sequence) > hops:
                if active.size:
                    pairs.cut(_beginning(ways, sequence, active), active, hops)
                continue
            if active.size and space.passages[passage_number(sequence[-1])].target == pairs.target:
                _finish(pairs, sequence, active, ways)
            longer = [(*sequence, g) for g in followers(space, sequence) if all(may_follow(space, sequence[-1], g))]
            active = pairs.open(floor[active], active) if longer else active[:0]
            if active.size:
                active = pairs.open(_beginning(ways, sequence, active), active)
            if active.size:
                following += [(one, active) for one in longer]
        layer = following


def _promising(
    pairs: Pairs,
    sequence: tuple[int, ...],
    candidates: Indices,
    floor: Array,
    ways: Ways,
) -> Indices:
    """Drop by the cheapest bound: from p to the first guard, from guard to guard, from some last guard to q."""
    tolls, numbers = pairs.toll * hops_of(sequence), [passage_number(i) for i in sequence]
    fixed = sum(float(ways.inner[a, b]) for a, b in pairwise(numbers)) + tolls
    rest = ways.rest(numbers[-1], candidates)
    bound = np.maximum(ways.enters[numbers[0], candidates] + fixed + rest, floor[candidates] + tolls)
    return pairs.open(bound * (1 - ROUNDING * len(sequence)), candidates)


def _beginning(ways: Ways, sequence: tuple[int, ...], active: Indices) -> Array:
    """The least that paths beginning with a sequence can have."""
    return np.maximum(ways.beginning(sequence, active), ways.beginning_kept(sequence, active))


def _finish(pairs: Pairs, sequence: tuple[int, ...], active: Indices, ways: Ways) -> None:
    """The paths through exactly this sequence."""
    lower, upper, _ = ways.through(sequence, active)
    pairs.leave(lower, active)
    if min(sequence) >= 0:
        pairs.upper[active] = np.minimum(pairs.upper[active], upper)
