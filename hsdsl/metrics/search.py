"""The shortest connected curve (Def. 4, 5 and 12) as a search over sequences of passages, the most promising first.

Every open sequence carries a lower bound on all its continuations: the shortest way through it so far, plus the least
that is left to q. A sequence is dropped once that bound reaches the best path found.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.dominance import followers, hops_of, may_follow, passage_number
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.passage_bounds import Indices, Ways
from hsdsl.metrics.socp import ROUNDS, one_thread

TOLERANCE = 2e-10  # relative: bounds this near to the best path are not worth a look; the lower end allows for it
ROUNDING = 16 * 2.0**-53  # of a short sum or a norm, relative to itself
NEAR = 1e-3  # relative: a bound so near to the best path is worth a closer look
NEIGHBOURS_AT = {16, 128, 1024}  # sequences looked at: when the best path's neighbours are
MOST_CHANGES = 20
ONE = np.zeros(1, dtype=int)  # the only pair of a search
HOPS = 8  # more than the fewest that lead from one mode to the other


@dataclass(frozen=True, eq=False)
class End:
    """Where a path ends: a point of a domain, what it costs to be there, and a passage it is bound to (in a strip)."""

    mode: int
    x: Array
    cost: float = 0.0
    bound: int | None = None


@dataclass
class SearchResult:
    """What a search knows: the best path, and the least that anything else can have.

    ``lower`` is the least of what was looked at or left out as too long, ``cut`` that of paths with more passages than
    the cap.
    """

    upper: float = np.inf
    lower: float = np.inf
    cut: float = np.inf
    sequence: tuple[int, ...] = ()
    unknowns: Array = field(default_factory=lambda: np.zeros(0))
    start: End | None = None
    end: End | None = None
    ended_early: bool = False
    local: bool = False
    proved: bool = True  # of a path through curved domains: that it stays inside
    through: Any = None  # the route of a path by local solves, its guard points being ``unknowns``


def search(
    space: Space,
    starts: list[End],
    ends: list[End],
    relaxation: float,
    hops: int,
    limit: float,
    budget: Budget,
) -> SearchResult:
    """Search between any of ``starts`` and any of ``ends``; only paths shorter than ``limit`` matter.

    Each passage costs the relaxation. Paths with more passages than ``hops`` are only bounded, in ``SearchResult.cut``.
    """
    found = SearchResult(upper=limit, lower=limit)
    with one_thread():
        for end in ends:
            for start in starts:
                _Search(space, start, end, relaxation, hops, found, budget).run()
    return found


class _Search:
    """One pair of ends."""

    def __init__(
        self, space: Space, start: End, end: End, relaxation: float, hops: int, found: SearchResult, budget: Budget
    ) -> None:
        self.space, self.start, self.end, self.budget = space, start, end, budget
        self.hops, self.found = hops, found
        self.ways = Ways(space, start.mode, start.x[None], end.mode, end.x[None], relaxation, budget)
        self.fixed = start.cost + end.cost
        self.heap: list[tuple[float, int, tuple[int, ...]]] = []

    def run(self) -> None:
        """Best first until nothing open can be shorter."""
        self._finish(())
        first, last = self.ways.enters[:, 0].min(initial=np.inf), self.ways.leaves[:, 0].min(initial=np.inf)
        if np.isinf(first + last):
            return
        least = float(first * (self.start.bound is None) + last * (self.end.bound is None)) * (1 - ROUNDING)
        least = max(self.fixed, least + self.fixed)
        if self._left_out(least):
            return
        self.ways.solve_leaves()
        self._straight_there()
        self._go_on((), least)
        for looked_at in count(1):
            if not self.heap:
                return
            bound, _, sequence = heapq.heappop(self.heap)
            if self._left_out(bound):
                break
            if self.budget.spent():
                self._open(bound)
                break
            self._finish(sequence, bound)
            self._go_on(sequence, bound)
            if looked_at in NEIGHBOURS_AT:
                self._shorten()

    def _straight_there(self) -> None:
        """Try the sequence that the bounds between passages make look shortest, so that some path is known early."""
        sequence = tuple[int, ...]()
        while len(sequence) < self.hops:
            open_ = [i for i in self._following(sequence) if i >= 0 and i not in sequence and self._rest(i) < np.inf]
            if not open_:
                return
            far = self.ways.inner[sequence[-1]] if sequence else np.zeros(len(self.space.passages))
            sequence = (*sequence, min(open_, key=lambda i: float(far[i]) + self._rest(i)))
            if self.space.passages[sequence[-1]].target == self.end.mode:
                self._finish(sequence)
                return

    def _rest(self, i: int) -> float:
        return float(self.ways.rest(i, ONE)[0])

    def _shorten(self) -> None:
        """Replace the best path by shorter ones whose sequences differ by one passage, as long as there are any."""
        if (self.start.bound, self.end.bound) != (None, None):
            return
        tried: set[tuple[int, ...]] = set()
        for _ in range(MOST_CHANGES):
            best = self.found.sequence
            for changed in self._changed(best):
                if self.budget.spent():
                    return
                if changed not in tried and hops_of(changed) <= self.hops:
                    tried.add(changed)
                    self._keep(changed, 1)
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

    def _left_out(self, bound: float) -> bool:
        """Whether no path that is at least so long is worth a look; the lower end remembers it."""
        if bound < self.found.upper * (1 - TOLERANCE):
            return False
        self.found.lower = min(self.found.lower, bound)
        return True

    def _open(self, bound: float) -> None:
        """Leave what is at least so long for want of time."""
        self.found.lower, self.found.ended_early = min(self.found.lower, bound), True

    def _go_on(self, sequence: tuple[int, ...], bound: float) -> None:
        for following in self._following(sequence):
            longer = (*sequence, following)
            if self.budget.spent():
                self._open(bound)
                return
            least = max(bound, self._bound(longer))
            if least == np.inf or self._left_out(least):
                continue
            if hops_of(longer) <= self.hops:
                heapq.heappush(self.heap, (least, len(longer), longer))
            else:
                self.found.cut = min(self.found.cut, least)

    def _finish(self, sequence: tuple[int, ...], least: float = 0.0) -> None:
        """The path through exactly this sequence, which is at least so long."""
        last = self.space.passages[passage_number(sequence[-1])].target if sequence else self.start.mode
        if last != self.end.mode:
            return
        if not sequence and (self.start.bound, self.end.bound) != (None, None):
            return
        if sequence and not self._bound_end(sequence):
            return
        lower = self._keep(sequence)
        self.found.lower = min(self.found.lower, max(lower, least))

    def _keep(self, sequence: tuple[int, ...], rounds: int = ROUNDS) -> float:
        """Keep the shortest path through a sequence where it is the best; a lower bound on it."""
        if sequence:
            lower, upper, s = (x[0] for x in self.ways.through(sequence, ONE, rounds))
        else:
            lower, upper, s = _straight(self.start.x, self.end.x)
        if min(sequence, default=0) >= 0 and upper + self.fixed < self.found.upper:
            self.found.upper, self.found.sequence, self.found.unknowns = float(upper + self.fixed), sequence, s
            self.found.start, self.found.end = self.start, self.end
        return float(lower + self.fixed)

    def _bound_end(self, sequence: tuple[int, ...]) -> bool:
        if self.end.bound is not None and passage_number(sequence[-1]) != self.end.bound:
            return False
        return len(sequence) < 2 or self._pair(
            sequence[-2], sequence[-1], len(sequence) - 2, self.end.bound is not None
        )

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

    def _bound(self, sequence: tuple[int, ...]) -> float:
        """The least any path beginning with this sequence can have."""
        if self._rest(sequence[-1]) == np.inf:
            return np.inf
        simple = self._least(self.ways.beginning, sequence)
        if simple >= self.found.upper * (1 - TOLERANCE) or self.space.kept is None:
            return simple
        return max(simple, self._least(self.ways.beginning_kept, sequence))

    def _least(self, bounds: Callable[[tuple[int, ...], Indices, int], Array], sequence: tuple[int, ...]) -> float:
        """A lower bound, closer where that may decide."""
        bound = float(bounds(sequence, ONE, 1)[0]) + self.fixed
        near = self.found.upper * (1 - NEAR) < bound < self.found.upper * (1 - TOLERANCE)
        return max(bound, float(bounds(sequence, ONE, ROUNDS)[0]) + self.fixed) if near else bound


def _straight(p: Array, q: Array) -> tuple[float, float, Array]:
    """The straight way: the difference is exact to a share of itself."""
    length, share = float(np.linalg.norm(q - p)), len(p) * 2.0**-53 + ROUNDING
    return length * (1 - share), length * (1 + share), np.zeros(0)


def most_hops(space: Space, source: int, target: int, hops: int | None) -> int:
    """The cap on passages: the one given, or some more than the fewest that lead from one mode to the other."""
    return space.fewest(source)[target] + HOPS if hops is None else hops
