"""The shortest connected curve (Def. 4, 5 and 12) as a search over sequences of passages, the most promising first.

Each open sequence carries, for every pair of points that it matters to, a lower bound on all its continuations: the
shortest way through it so far, plus the least that is left to q. A pair leaves a sequence once that bound reaches its
best path.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.dominance import followers, hops_of, may_follow, passage_number
from hsdsl.analysis.metrics.geometry import Array, Space
from hsdsl.analysis.metrics.passage_bounds import ROUNDING, Indices, Ways
from hsdsl.analysis.metrics.rounding import norm
from hsdsl.analysis.metrics.socp import ROUNDS, one_thread

TOLERANCE = 2e-10  # relative: bounds this near to the best path are not worth a look; the lower end allows for it
NEAR = 1e-3  # relative: a bound so near to the best path is worth a closer look
NEIGHBOURS_AT = {16, 128, 1024}  # sequences looked at: when the best path's neighbours are
MOST_CHANGES = 20
HOPS = 8  # more than the fewest that lead from one mode to the other
Bound = Callable[[tuple[int, ...], Indices, int], Array]  # of paths that begin with a sequence


@dataclass(frozen=True, eq=False)
class End:
    """Where N paths end: points (N, n) of a domain, the cost to be there, and a passage they must take (in a strip)."""

    mode: int
    x: Array
    cost: float = 0.0
    bound: int | None = None


@dataclass
class SearchResult:
    """What a search knows of N distances: the best paths, and the least that anything else can have.

    ``upper``, ``lower`` and ``cut`` are arrays (N,). ``lower`` is the least of what was looked at or left out as too
    long, ``cut`` that of paths with more passages than the cap. The path is that of a single distance.
    """

    upper: Any = np.inf
    lower: Any = np.inf
    cut: Any = np.inf
    sequence: tuple[int, ...] = ()
    unknowns: Array = field(default_factory=lambda: np.zeros(0))
    start: End | None = None
    end: End | None = None
    ended_early: bool = False
    local: bool = False
    proved: bool = True  # of a path through curved domains: that it stays inside
    through: Any = None  # the route of a path by local solves, its guard points being ``unknowns``


@dataclass(frozen=True, eq=False)
class Query:
    """Distances to search for: between any of ``starts`` and any of ``ends``, each passage at the price of a toll.

    Only paths shorter than ``limit`` matter. Paths with more passages than ``most`` are only bounded: by default eight
    more than the fewest that lead from one mode to the other.
    """

    space: Space
    starts: list[End]
    ends: list[End]
    toll: float
    hops: int | None
    budget: Budget
    limit: float = np.inf

    @cached_property
    def most(self) -> int:
        """The cap on passages."""
        fewest = self.space.fewest(self.starts[0].mode)[self.ends[0].mode]
        return fewest + HOPS if self.hops is None else self.hops


def search(query: Query) -> SearchResult:
    """Search for N distances where guards, resets and domains are affine, or for bounds from below."""
    count = len(query.starts[0].x)
    found = SearchResult(np.full(count, query.limit), np.full(count, query.limit), np.full(count, np.inf))
    with one_thread():
        for end in query.ends:
            for start in query.starts:
                _Search(query, start, end, found).run()
    found.lower, found.cut = np.maximum(found.lower, 0.0), np.maximum(found.cut, 0.0)  # bounds less a strip's depth
    return found


class _Search:
    """One pair of ends."""

    def __init__(self, query: Query, start: End, end: End, found: SearchResult) -> None:
        self.space, self.start, self.end, self.budget = query.space, start, end, query.budget
        self.hops, self.found = query.most, found
        self.ways = Ways(query.space, start.mode, start.x, end.mode, end.x, query.toll, query.budget)
        self.fixed = start.cost + end.cost
        self.free = start.bound is None and end.bound is None
        self.pairs = np.arange(len(start.x))
        self.single = len(start.x) == 1
        self.solved = self.ways.beginning, self.ways.beginning_kept
        self.heap: list[tuple[float, int, tuple[int, ...], Indices, Array]] = []

    def run(self) -> None:
        """Best first until nothing open can be shorter."""
        self._finish((), self.pairs)
        first, last = (side.min(axis=0, initial=np.inf) for side in (self.ways.enters, self.ways.leaves))
        if np.isinf(first + last).all():
            return
        apart = (first * (self.start.bound is None) + last * (self.end.bound is None)) * (1 - ROUNDING)
        rows, bounds = self._left(self.pairs, np.maximum(apart, self.ways.unchanged) + self.fixed)
        if not rows.size:
            return
        if self.single:
            self.ways.solve_leaves()
            self._straight_there()
        self._go_on((), rows, bounds)
        looked_at = 0
        while self.heap:
            looked_at += 1
            *_, sequence, rows, bounds = heapq.heappop(self.heap)
            rows, bounds = self._left(rows, bounds)
            if not rows.size:
                continue
            if self.budget.spent():
                self._open(rows, bounds)
                continue
            self._finish(sequence, rows, bounds)
            self._go_on(sequence, rows, bounds)
            if self.single and looked_at in NEIGHBOURS_AT:
                self._shorten()

    def _straight_there(self) -> None:
        """Try the sequence that the bounds between passages make look shortest, so that some path is known early."""
        sequence = tuple[int, ...]()
        while len(sequence) < self.hops:
            rest = {i: float(self.ways.rest(i, self.pairs)[0]) for i in self._following(sequence) if i >= 0}
            open_ = [i for i in rest if i not in sequence and rest[i] < np.inf]
            if not open_:
                return
            far = self.ways.inner[sequence[-1]] if sequence else np.zeros(len(self.space.passages))
            sequence = (*sequence, min(open_, key=lambda i: float(far[i]) + rest[i]))
            if self.space.passages[sequence[-1]].target == self.end.mode:
                self._finish(sequence, self.pairs)
                return

    def _shorten(self) -> None:
        """Replace the best path by shorter ones whose sequences differ by one passage, as long as there are any."""
        tried: set[tuple[int, ...]] = set()
        for _ in range(MOST_CHANGES if self.free else 0):
            best = self.found.sequence
            for changed in self._changed(best):
                if self.budget.spent():
                    return
                if changed not in tried and hops_of(changed) <= self.hops:
                    tried.add(changed)
                    self._keep(changed, self.pairs, 1)
                    if self.found.sequence != best:
                        break
            else:
                return

    def _changed(self, sequence: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        """The sequences from mode to mode that differ by one passage."""
        passages = self.space.passages
        for k in range(len(sequence) + 1):
            for shorter in {k, min(k + 1, len(sequence))}:
                before, after = sequence[:k], sequence[shorter:]
                source = passages[before[-1]].target if before else self.start.mode
                target = passages[after[0]].source if after else self.end.mode
                fitting = [(p.index,) for p in passages if (p.source, p.target) == (source, target)]
                for middle in [()] * (source == target and shorter > k) + fitting:
                    yield before + middle + after

    def _left(self, rows: Indices, bounds: Array) -> tuple[Indices, Array]:
        """The pairs for which paths that are at least so long are worth a look; the lower end remembers the others."""
        still = bounds < self.found.upper[rows] * (1 - TOLERANCE)
        self._lower(rows[~still], bounds[~still])
        return rows[still], bounds[still]

    def _lower(self, rows: Indices, bounds: Array) -> None:
        self.found.lower[rows] = np.minimum(self.found.lower[rows], bounds)

    def _open(self, rows: Indices, bounds: Array) -> None:
        """Leave what is at least so long for want of time."""
        self._lower(rows, bounds)
        self.found.ended_early = True

    def _go_on(self, sequence: tuple[int, ...], rows: Indices, bounds: Array) -> None:
        longer = [(*sequence, i) for i in self._following(sequence)]
        kinds = (self.ways.around, *(self.solved if self.single else ()))
        if longer and sequence and not self.single:  # of many pairs most are settled before this is solved
            rows, bounds = self._bounded(self.solved, sequence, rows, bounds)
        for one in longer if rows.size else ():
            if self.budget.spent():
                self._open(rows, bounds)
                return
            some, least = self._bounded(kinds, one, rows, bounds)
            if not some.size:
                continue
            if hops_of(one) <= self.hops:
                heapq.heappush(self.heap, (float(least.min()), len(one), one, some, least))
            else:
                self.found.cut[some] = np.minimum(self.found.cut[some], least)

    def _finish(self, sequence: tuple[int, ...], rows: Indices, least: Array | float = 0.0) -> None:
        """The paths through exactly this sequence, which are at least so long."""
        last = self.space.passages[passage_number(sequence[-1])].target if sequence else self.start.mode
        if last == self.end.mode and (self._bound_end(sequence) if sequence else self.free):
            self._lower(rows, np.maximum(self._keep(sequence, rows), least))

    def _keep(self, sequence: tuple[int, ...], rows: Indices, rounds: int = ROUNDS) -> Array:
        """Keep the shortest paths through a sequence where they are the best; lower bounds on them."""
        if sequence:
            lower, upper, s = self.ways.through(sequence, rows, rounds)
        else:  # the difference of two points is exact to a share of itself
            length, s = norm(self.end.x - self.start.x), np.zeros((len(rows), 0))
            lower, upper = length * (1 - ROUNDING), length * (1 + ROUNDING)
        better = upper + self.fixed < self.found.upper[rows]
        if min(sequence, default=0) >= 0 and better.any():
            self.found.upper[rows[better]] = upper[better] + self.fixed
            self.found.sequence, self.found.unknowns = sequence, s[0]
            self.found.start, self.found.end = self.start, self.end
        return lower + self.fixed

    def _bound_end(self, sequence: tuple[int, ...]) -> bool:
        bound = self.end.bound is not None
        if bound and passage_number(sequence[-1]) != self.end.bound:
            return False
        return len(sequence) < 2 or self._pair(sequence[-2], sequence[-1], len(sequence) - 2, bound)

    def _following(self, sequence: tuple[int, ...]) -> Iterator[int]:
        if sequence:
            for i in followers(self.space, sequence):
                last = passage_number(i) == self.end.bound
                if self._pair(sequence[-1], i, len(sequence) - 1, last):
                    yield i
            return
        for passage in self.space.passages:
            i = passage.index
            if i == self.start.bound or (self.start.bound is None and passage.source == self.start.mode):
                yield i

    def _pair(self, first: int, second: int, position: int, last: bool) -> bool:
        worth, after, before = may_follow(self.space, first, second)
        begins = position == 0 and self.start.bound is not None
        return (worth or (begins and last)) and (after or last) and (before or begins)

    def _bounded(
        self, kinds: Sequence[Bound], sequence: tuple[int, ...], rows: Indices, bounds: Array
    ) -> tuple[Indices, Array]:
        """The pairs that a sequence matters to, and the least that any path beginning with it can have."""
        if rows.size and np.isinf(self.ways.rest(sequence[-1], rows)).all():
            return rows[:0], bounds[:0]
        for least in kinds:
            if rows.size:
                rows, bounds = self._left(rows, np.maximum(bounds, self._closer(least, sequence, rows)))
        return rows, bounds

    def _closer(self, least: Bound, sequence: tuple[int, ...], rows: Indices) -> Array:
        """Lower bounds, closer where that may decide."""
        bounds, upper = least(sequence, rows, 1) + self.fixed, self.found.upper[rows]
        near = (upper * (1 - NEAR) < bounds) & (bounds < upper * (1 - TOLERANCE))
        if near.any():
            bounds[near] = np.maximum(bounds[near], least(sequence, rows[near], ROUNDS) + self.fixed)
        return bounds
