"""The shortest connected curve (Def. 4, 5 and 12) as a search over sequences of passages, the most promising first.

Every open sequence carries a lower bound on all its continuations: the shortest way through it so far, plus the least
that is left to q. A sequence is dropped once that bound reaches the best path found.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.dominance import followers, hops_of, may_follow, passage_number
from hsdsl.metrics.gate_sequence import Problem, Shape, gate_sequence
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.serial import one_thread
from hsdsl.metrics.sides import to_entry, to_exit
from hsdsl.metrics.socp import ROUNDS, solve

TOLERANCE = 2e-10  # relative: bounds this near to the best path are not worth a look; the lower end allows for it
ROUNDING = 4 * 2.0**-53  # of a sum of bounds, for each of them
NEAR = 1e-3  # relative: a bound so near to the best path is worth a closer look
NEIGHBOURS_AT = {16, 128, 1024}  # sequences looked at: when the best path's neighbours are
MOST_CHANGES = 20
HOPS = 8  # more than the fewest that lead from one mode to the other


@dataclass(frozen=True, eq=False)
class End:
    """Where a path ends: a point of a domain, what it costs to be there, and a passage it is bound to (in a strip)."""

    mode: int
    x: Array
    cost: float = 0.0
    bound: int | None = None


@dataclass
class Found:
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
    route: list[tuple[str | None, bool]] = field(default_factory=list[tuple[str | None, bool]])
    legs: list[tuple[int, Array, Array]] = field(default_factory=list[tuple[int, Array, Array]])
    through: Any = None  # the route of a path by local solves, its guard points being ``unknowns``


def search(
    space: Space,
    starts: list[End],
    ends: list[End],
    relaxation: float,
    hops: int,
    limit: float,
    budget: Budget,
) -> Found:
    """Search between any of ``starts`` and any of ``ends``.

    Parameters
    ----------
    relaxation : float
        What each passage costs.
    hops : int
        The most passages on a path; what is cut there is kept apart in ``Found.cut``.
    limit : float
        Only paths shorter than this matter (inf: all).
    budget : Budget
        The time for it.
    """
    found = Found(upper=limit, lower=limit)
    with one_thread():
        for end in ends:
            for start in starts:
                _Search(space, start, end, relaxation, hops, found, budget).run()
    return found


class _Search:
    """One pair of ends."""

    def __init__(
        self, space: Space, start: End, end: End, relaxation: float, hops: int, found: Found, budget: Budget
    ) -> None:
        self.space, self.start, self.end, self.budget = space, start, end, budget
        self.relaxation, self.hops, self.found = relaxation, hops, found
        self.fixed = start.cost + end.cost
        self.heap: list[tuple[float, int, tuple[int, ...]]] = []
        self.rest = np.zeros(len(space.passages))

    def run(self) -> None:
        """Best first until nothing open can be shorter."""
        self._finish(())
        least = max(self.fixed, least_with_passages(self.space, self.start, self.end) + self.fixed)
        if self._left_out(least):
            return
        self.rest = remaining(self.space, self.end, self.relaxation, self.budget)
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
        inner, sequence = gaps(self.space, self.budget), tuple[int, ...]()
        while len(sequence) < self.hops:
            far = np.zeros(len(self.rest)) if not sequence else inner[sequence[-1]]
            open_ = [i for i in self._following(sequence) if i >= 0 and i not in sequence and self.rest[i] < np.inf]
            if not open_:
                return
            sequence = (*sequence, min(open_, key=lambda i: float(far[i] + self.rest[i])))
            if self.space.passages[sequence[-1]].target == self.end.mode:
                self._finish(sequence)
                return

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
            problem = gate_sequence(self.space, sequence).problem(self.start.x, self.end.x)
        else:
            problem = straight(self.start.x, self.end.x)
        lower, upper, s = solve(problem, rounds)
        toll = self.fixed + self.relaxation * hops_of(sequence)
        if min(sequence, default=0) >= 0 and upper + toll < self.found.upper:
            self.found.upper, self.found.sequence, self.found.unknowns = upper + toll, sequence, s
            self.found.start, self.found.end = self.start, self.end
        return lower + toll

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
        toll = self.fixed + self.relaxation * hops_of(sequence)
        rest = float(self.rest[passage_number(sequence[-1])])
        if rest == np.inf:
            return np.inf
        chain = gate_sequence(self.space, sequence)
        simple = self._least(chain.problem(self.start.x, None), rest + toll)
        if simple >= self.found.upper * (1 - TOLERANCE) or self.space.kept is None:
            return simple
        goal = self.end.x[list(self.space.kept[self.end.mode])]
        return max(simple, self._least(chain.problem(self.start.x, goal, kept=True), toll))

    def _least(self, problem: Problem, more: float) -> float:
        """A lower bound, closer where that may decide."""
        bound = solve(problem, 1)[0] + more
        near = self.found.upper * (1 - NEAR) < bound < self.found.upper * (1 - TOLERANCE)
        return max(bound, solve(problem)[0] + more) if near else bound


def straight(p: Array, q: Array) -> Problem:
    """The straight way: no numbers but the difference, which is exact to a share of itself."""
    nothing = np.zeros((len(p), 0))
    return Problem(Shape((nothing,), np.zeros((0, 0)), np.zeros(0)), (q - p,), 0.0)


def least_with_passages(space: Space, start: End, end: End) -> float:
    """A lower bound on ways with passages: to the nearest one and from one; infinite without any."""
    x, y = start.x[None], end.x[None]
    first = [float(to_entry(p, x)[0]) for p in space.passages if p.source == start.mode]
    last = [float(to_exit(p, y)[0]) for p in space.passages if p.target == end.mode]
    if not first or not last:
        return np.inf
    return (min(first) if start.bound is None else 0.0) + (min(last) if end.bound is None else 0.0)


def most_hops(space: Space, source: int, target: int, hops: int | None) -> int:
    """The cap on passages: the one given, or some more than the fewest that lead from one mode to the other."""
    return space.fewest(source)[target] + HOPS if hops is None else hops


def remaining(space: Space, end: End, relaxation: float, budget: Budget) -> Array:
    """For each passage, a lower bound on what is left to the end once it has been left (Bellman's recursion)."""
    total = len(space.passages)
    rest = np.full(total, np.inf)
    for passage in space.passages:
        if passage.target == end.mode:
            rest[passage.index] = to_exit(passage, end.x[None])[0]
            if passage.gate.size > 1 and not budget.spent():
                goal = gate_sequence(space, (passage.index,)).problem(None, end.x)
                rest[passage.index] = max(rest[passage.index], solve(goal)[0])
    between = gaps(space, budget)
    for _ in range(total):
        through = np.min(between + (rest + relaxation)[None, :], axis=1, initial=np.inf)
        closer = np.minimum(rest, through)
        if np.array_equal(closer, rest):
            break
        rest = closer
    return rest * (1 - total * ROUNDING)


def gaps(space: Space, budget: Budget) -> Array:
    """A lower bound on the way from where one passage is left to where another is entered, inf in different modes.

    It is 0 where the time is over before it is known.
    """
    found: Array | None = space.cache.get("gaps")
    if found is None:
        total = len(space.passages)
        found = np.full((total, total), np.inf)
        for f in space.passages:
            for g in space.passages:
                if f.target == g.source and np.isinf(found[f.index, g.index]):
                    # The same two sides face each other the other way round: passage i backwards is i with the last bit
                    # changed.
                    gap = 0.0 if budget.spent() else _gap(space, f.index, g.index)
                    found[f.index, g.index] = found[g.index ^ 1, f.index ^ 1] = gap
        if not budget.ran_out:
            space.cache["gaps"] = found
    return found


def _gap(space: Space, f: int, g: int) -> float:
    """0 where a passage is taken back at once."""
    return 0.0 if f == g ^ 1 else solve(gate_sequence(space, (f, g)).problem(None, None), 1)[0]
