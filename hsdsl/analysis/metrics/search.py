"""The shortest connected curve (Def. 4, 5 and 12) as a search over sequences of passages, the most promising first.

Each open sequence carries, for every pair of points that it matters to, a lower bound on all its continuations: the
shortest way through it so far, plus the least that is left to q. A pair leaves a sequence once that bound reaches its
best path.

Sequences that a cheaper one always replaces are left out, by three rules, each proved from the geometry alone, for any
ends of the path:

1. f then g back into the mode that f left: useless where the straight way from where f is entered to where g is left is
   never longer than the way between the two on the other side. So e then e backwards goes where the reset shortens no
   length along the guard, and e backwards then e where it lengthens none.
2. a passage g that stays in its mode, after f: useless where every point at which f can leave is as near to where
   g leaves as to where g is entered.
3. such a g before h: useless where every point at which h can be entered is as near to where g is entered.

A fourth rule bounds runs back and forth through one gate, which could go on for ever. Moves on one side of a gate add
up, so a run longer than ``RUN`` is no shorter than two or three passages, of which the second need not keep the gate's
inequalities. That passage is written ``~i`` for passage i.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import pairwise, takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsdsl.analysis.metrics.gate_sequence import ROUNDS, gate_sequence, norm, one_thread, solve
from hsdsl.analysis.metrics.geometry import Array, Passage, Space
from hsdsl.analysis.metrics.guard_clearance import to_entry, to_exit
from hsdsl.analysis.metrics.interval import Budget
from hsdsl.base.numbers.rational import Exact, maximise, never_negative

Indices = NDArray[np.intp]
TOLERANCE = 2e-10  # relative: bounds this near to the best path are not examined; the lower end allows for it
NEAR = 1e-3  # relative: a bound so near to the best path is examined more closely
NEIGHBOURS_AT = {16, 128, 1024}  # sequences examined: when the best path's neighbours are
MOST_CHANGES = 20
HOPS = 8  # more than the fewest that lead from one mode to the other
Bound = Callable[[tuple[int, ...], Indices, int], Array]  # of paths that begin with a sequence


class End(NamedTuple):
    """Where N paths end: points (N, n) of a domain, the cost to be there, and a passage they must take (in a strip)."""

    mode: int
    x: Array
    cost: float = 0.0
    bound: int | None = None


@dataclass
class SearchResult:
    """What a search knows of N distances: the best paths, and the least that anything else can have.

    ``upper``, ``lower`` and ``cut`` are arrays (N,). ``lower`` is the least of what was examined or left out as too
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
        """The pairs for which paths that are at least so long are examined; the lower end remembers the others."""
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
                own, upper = least(sequence, rows, 1) + self.fixed, self.found.upper[rows]
                near = (upper * (1 - NEAR) < own) & (own < upper * (1 - TOLERANCE))
                if near.any():  # a closer bound may decide
                    own[near] = np.maximum(own[near], least(sequence, rows[near], ROUNDS) + self.fixed)
                rows, bounds = self._left(rows, np.maximum(bounds, own))
        return rows, bounds


ROUNDING = 64 * 2.0**-53  # of a norm or a short sum, relative to itself


@dataclass(frozen=True, eq=False)
class Ways:
    """N pairs of points, rows of p and q, and what separates them from P passages and those from each other."""

    space: Space
    source: int
    p: Array
    target: int
    q: Array
    toll: float
    budget: Budget

    @cached_property
    def enters(self) -> Array:
        """From p to where a passage is entered, shape (P, N); infinite in other modes."""
        found = np.full((len(self.space.passages), len(self.p)), np.inf)
        for g in self.space.passages:
            if g.source == self.source:
                found[g.index] = to_entry(g, self.p)
        return found

    @cached_property
    def leaves(self) -> Array:
        """From where a passage is left to q, shape (P, N); infinite in other modes."""
        found = np.full((len(self.space.passages), len(self.q)), np.inf)
        for g in self.space.passages:
            if g.target == self.target:
                found[g.index] = to_exit(g, self.q)
        return found

    def solve_leaves(self) -> None:
        """Replace bounds to planes by those to guards, as long as there is time."""
        for g in self.space.passages:
            if g.target == self.target and g.gate.size > 1 and not self.budget.spent():
                goal = gate_sequence(self.space, (g.index,)).problem(None, self.q)
                self.leaves[g.index] = np.maximum(self.leaves[g.index], solve(*goal)[0])

    @cached_property
    def inner(self) -> Array:
        """From leaving one passage to entering another, shape (P, P)."""
        return gaps(self.space, self.budget)

    @cached_property
    def between(self) -> Array:
        """From leaving one passage to leaving another (0 to itself), tolls included: all pairs, Floyd's way."""
        key = ("between", self.toll)
        found: Array | None = self.space.cache.get(key)
        if found is None:
            count = len(self.space.passages)
            found = (self.inner + self.toll) * (1 - ROUNDING * count)
            found[np.arange(count), np.arange(count)] = 0.0
            for k in range(count):
                found = np.minimum(found, found[:, k, None] + found[None, k, :])
            if not self.budget.ran_out:
                self.space.cache[key] = found
        return found

    def rest(self, last: int, indices: Indices) -> Array:
        """What is left at least, once a passage has been left."""
        between = self.between[passage_number(last)]
        rows = np.flatnonzero(np.isfinite(between))
        if not rows.size:
            return np.full(len(indices), np.inf)
        return np.min(between[rows, None] + self.leaves[np.ix_(rows, indices)], axis=0) * (1 - ROUNDING)

    def through(self, sequence: tuple[int, ...], rows: Indices, rounds: int = ROUNDS) -> tuple[Array, Array, Array]:
        """Bounds on the paths through exactly a sequence, tolls included, and their unknowns."""
        problem = gate_sequence(self.space, sequence).problem(self.p[rows], self.q[rows])
        lower, upper, s = solve(*problem, rounds)
        toll = self.toll * hops_of(sequence)
        return (lower + toll) * (1 - ROUNDING), (upper + toll) * (1 + ROUNDING), s

    def around(self, sequence: tuple[int, ...], rows: Indices, _: int = ROUNDS) -> Array:
        """The cheapest bound on paths that begin with a sequence: to its guards, from one to the next, and the rest."""
        numbers = [passage_number(i) for i in sequence]
        between = sum(float(self.inner[a, b]) for a, b in pairwise(numbers)) + self.toll * hops_of(sequence)
        found = self.enters[numbers[0], rows] + between + self.rest(sequence[-1], rows)
        return found * (1 - ROUNDING * len(sequence))

    @cached_property
    def unchanged(self) -> Array:
        """From p to q in the coordinates that no passage changes."""
        return unchanged(self.space, self.source, self.p, self.target, self.q)

    def beginning(self, sequence: tuple[int, ...], rows: Indices, rounds: int = ROUNDS) -> Array:
        """What paths that begin with a sequence are at least: through it, and the rest."""
        toll = self.toll * hops_of(sequence)
        problem = gate_sequence(self.space, sequence).problem(self.p[rows], None)
        return (solve(*problem, rounds)[0] + toll + self.rest(sequence[-1], rows)) * (1 - ROUNDING)

    def beginning_kept(self, sequence: tuple[int, ...], rows: Indices, rounds: int = ROUNDS) -> Array:
        """The same by the coordinates that no passage changes, up to q."""
        if self.space.kept is None:
            return np.zeros(len(rows))
        goals = self.q[rows][:, list(self.space.kept[self.target])]
        problem = gate_sequence(self.space, sequence).problem(self.p[rows], goals, kept=True)
        return (solve(*problem, rounds)[0] + self.toll * hops_of(sequence)) * (1 - ROUNDING)


def unchanged(space: Space, source: int, p: Array, target: int, q: Array) -> Array:
    """A lower bound on distances of points: those in the coordinates that no passage changes."""
    if space.kept is None:
        return np.zeros(len(p))
    return norm(p[:, list(space.kept[source])] - q[:, list(space.kept[target])]) * (1 - ROUNDING)


def gaps(space: Space, budget: Budget) -> Array:
    """A lower bound on the way from where one passage is left to where another is entered, inf in different modes.

    It is 0 where the time is over before it is known.
    """
    found: Array | None = space.cache.get("gaps")
    if found is None:
        count = len(space.passages)
        found = np.full((count, count), np.inf)
        for f in space.passages:
            for g in space.passages:
                if f.target == g.source and np.isinf(found[f.index, g.index]):
                    # Backwards, the same two sides face each other: passage i backwards is i ^ 1.
                    gap = 0.0
                    if not budget.spent() and f.index != g.index ^ 1:  # else it is taken back at once
                        gap = float(solve(*gate_sequence(space, (f.index, g.index)).problem(None, None), 1)[0][0])
                    found[f.index, g.index] = found[g.index ^ 1, f.index ^ 1] = gap
        if not budget.ran_out:
            space.cache["gaps"] = found
    return found


# A way may grow by this share where a pair is left out: far below rounding, and above what numbers that are not
# rational were rounded to.
SLACK = Fraction(1, 10**40)

SEEN = 1e-6  # relative: what is longer by so much is so in floats too

RUN = 3  # passages back and forth through one gate, one after the other


def passage_number(i: int) -> int:
    """A passage's index, of itself or of its plane."""
    return i if i >= 0 else ~i


def hops_of(sequence: Sequence[int]) -> int:
    """The fewest passages that a sequence stands for."""
    return len(sequence) + (RUN - 1) * sum(i < 0 for i in sequence)


def followers(space: Space, sequence: tuple[int, ...]) -> Iterator[int]:
    """The passages into the mode that a sequence leads to, by rule 4 alone."""
    numbers = [passage_number(i) for i in reversed(sequence)]
    turned = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1] ^ 1, pairwise(numbers)))
    mode = space.passages[numbers[0]].target
    for passage in space.passages:
        back = passage.index == numbers[0] ^ 1
        if passage.source == mode and (not back or turned < RUN - 1):
            yield passage.index
        if back and not turned and may_run(space, passage.index):
            yield ~passage.index


def may_run(space: Space, i: int) -> bool:
    """Whether a shortest path may go back and forth through a gate more often than ``RUN``."""
    bounded = bool(space.passages[i].gate.normals.size)
    return bounded and space.remembered(("run", i | 1), lambda: all(may_follow(space, f, f ^ 1)[0] for f in (i, i ^ 1)))


def may_follow(space: Space, first: int, second: int) -> tuple[bool, bool, bool]:
    """Which of the three rules leave the pair standing; True: nothing is known against it.

    Rule 1 takes both passages away, rule 2 the second and rule 3 the first. A path that begins in the first one's strip
    or ends in the second one's is bound to it, so the rule that takes it away must not be used (rule 1: unless one
    of the two is free, when going back out of the strip is no longer than going on and coming back).
    """
    f, g = (space.passages[passage_number(i)] for i in (first, second))

    def found() -> tuple[bool, bool, bool]:
        after = g.source != g.target or not _never_nearer(g, *g.exact, f.exact[1], f)
        before = f.source != f.target or not _never_nearer(f, f.exact[1], f.exact[0], g.exact[0], g)
        return _worth_returning(f, g), after, before

    return space.remembered(("follow", f.index, g.index), found)


def _worth_returning(f: Passage, g: Passage) -> bool:
    if f.source != g.target:
        return True
    short, long = _difference(f.exact[0], g.exact[1]), _difference(f.exact[1], g.exact[0])
    return _seen_longer(short.astype(float), long.astype(float)) or not _never_longer(short, long)


def _seen_longer(short: Array, long: Array) -> bool:
    """Whether ``|short @ u| > |long @ u|`` for some u by far more than rounding; most pairs need no closer test."""
    excess, size = long.T @ long - short.T @ short, np.abs(np.vstack([long, short])).max(initial=0)
    return bool(np.linalg.eigvalsh(excess)[0] < -SEEN * size**2)


def _difference(one: Exact, other: Exact) -> Exact:
    """The matrix that takes (1, s, s') to the difference of two points."""
    return np.column_stack([one[:, 0] - other[:, 0], one[:, 1:], -other[:, 1:]])


def _never_longer(short: Exact, long: Exact) -> bool:
    """Whether ``|short u| <= (1 + slack) |long u|`` for every u."""
    if ((short != 0).any(axis=0) & (long == 0).all(axis=0)).any():
        return False
    return never_negative((1 + SLACK) * (long.T @ long) - short.T @ short)


def _never_nearer(g: Passage, far: Exact, near: Exact, side: Exact, other: Passage) -> bool:
    """Whether ``|y - far(s)| >= |y - near(s)|`` for all s in g and y on the other passage's side.

    Where far - near = (a s + b) w with one direction w, the difference of squares is that factor times
    ``w . (far + near - 2 y)``: it cannot be negative where both factors have one sign, two linear programs each.
    """
    apart = far - near
    w = next((column for column in apart.T if column.any()), None)
    if w is None:
        return True
    factor = w @ apart / (w @ w)
    if (apart - np.outer(w, factor)).any():
        return False
    forms = ((factor, g), (w @ (far + near), g), (-2 * (w @ side), other))

    def one_sign(sign: int) -> bool:
        own, middle, away = (_least(sign * form, gate) for form, gate in forms)
        return own is not None and middle is not None and away is not None and own >= 0 and middle + away >= 0

    return one_sign(1) or one_sign(-1)


def _least(form: Exact, passage: Passage) -> Fraction | None:
    """The minimum of ``form . (1, s)`` over a guard, None where there is none."""
    exact = passage.gate.exact
    found = maximise(-form[1:], exact.rows, exact.inner)
    return None if found is None else form[0] + form[1:] @ found[0]
