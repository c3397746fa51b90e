"""Distances of many pairs of points in the same two modes: the search of `hsdsl.metrics.search`, for arrays.

Sequences of passages are gone through by length; each keeps only the pairs for which it can still be the shortest.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.dominance import followers, hops_of, may_follow, passage_number
from hsdsl.metrics.gate_sequence import GateSequence, gate_sequence
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.interval import CERTIFIED, Interval, up_to_hops, weakest
from hsdsl.metrics.line import on_line
from hsdsl.metrics.norms import minimise
from hsdsl.metrics.rounding import norm
from hsdsl.metrics.search import TOLERANCE, gaps
from hsdsl.metrics.sides import to_entry, to_exit

ROUNDING = 64 * 2.0**-53  # of a norm or a short sum, relative to itself
Indices = NDArray[np.intp]


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

    def least(self) -> Array:
        """A lower bound that holds everywhere: what no passage changes."""
        if self.space.kept is None:
            return np.zeros(len(self.p))
        own, other = list(self.space.kept[self.source]), list(self.space.kept[self.target])
        return norm(self.p[:, own] - self.q[:, other]) * (1 - ROUNDING)

    def bounds(self) -> tuple[Array, Array, str]:
        """What is known: lower and upper ends, and what they rest on.

        Raises
        ------
        EndsCross
            A lower end is above its upper one.
        """
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
    ways = Ways.of(pairs, budget)
    while layer:
        following: list[tuple[tuple[int, ...], Indices]] = []
        for sequence, candidates in layer:
            if budget.spent():
                pairs.leave(floor[candidates], candidates)
                continue
            active = _promising(pairs, sequence, candidates, floor, ways)
            if hops_of(sequence) > hops:
                if active.size:
                    pairs.cut(_through(pairs, sequence, active, ways), active, hops)
                continue
            if active.size and space.passages[passage_number(sequence[-1])].target == pairs.target:
                _finish(pairs, sequence, active)
            longer = [(*sequence, g) for g in followers(space, sequence) if all(may_follow(space, sequence[-1], g))]
            active = pairs.open(floor[active], active) if longer else active[:0]
            if active.size:
                active = pairs.open(_through(pairs, sequence, active, ways), active)
            if active.size:
                following += [(one, active) for one in longer]
        layer = following


def around_guards(pairs: Pairs, budget: Budget) -> Array:
    """A lower bound for paths with passages: to a guard, between guards, from one; 0 where guards are curved."""
    if pairs.space.curved_gates:
        return np.zeros(len(pairs.p))
    ways = Ways.of(pairs, budget)
    everything = np.arange(len(pairs.p))
    best = np.full(len(pairs.p), np.inf)
    for g in pairs.space.passages:
        if g.source == pairs.source:
            best = np.minimum(best, ways.enters[g.index] + pairs.toll + ways.rest(g.index, everything))
    return best * (1 - ROUNDING)


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


def _through(pairs: Pairs, sequence: tuple[int, ...], active: Indices, ways: Ways) -> Array:
    """The least that paths beginning with a sequence can have."""
    space, toll = pairs.space, pairs.toll * hops_of(sequence)
    chain = gate_sequence(space, sequence)
    rest = ways.rest(passage_number(sequence[-1]), active)
    bound = _shortest(pairs, chain, active, None)[0] + toll + rest
    if space.kept is not None:
        goals: Array = pairs.q[active][:, list(space.kept[pairs.target])]
        bound = np.maximum(bound, _shortest(pairs, chain, active, goals, kept=True)[0] + toll)
    return bound * (1 - ROUNDING)


def _finish(pairs: Pairs, sequence: tuple[int, ...], active: Indices) -> None:
    """The paths through exactly this sequence."""
    lower, upper = _shortest(pairs, gate_sequence(pairs.space, sequence), active, pairs.q[active])
    toll = pairs.toll * hops_of(sequence)
    pairs.lower[active] = np.minimum(pairs.lower[active], (lower + toll) * (1 - ROUNDING))
    if min(sequence) < 0:
        return
    pairs.upper[active] = np.minimum(pairs.upper[active], (upper + toll) * (1 + ROUNDING))


def _shortest(
    pairs: Pairs, chain: GateSequence, active: Indices, goals: Array | None, kept: bool = False
) -> tuple[Array, Array]:
    """Bounds on the shortest ways from p through a chain, to goals if there are any."""
    zero = np.zeros(len(pairs.space.domains[pairs.source].coordinates))
    problem = chain.problem(zero, None if goals is None else 0.0 * goals[0], kept)
    offsets = [np.tile(o, (len(active), 1)) for o in problem.offsets]
    starts = pairs.p[active]
    offsets[0] = offsets[0] - starts
    numbers = problem.numbers + norm(starts)
    if goals is not None:
        offsets[-1] = offsets[-1] - goals
        numbers = numbers + norm(goals)
    if problem.shape.size < 2:
        return on_line(problem.shape, offsets, numbers)[:2]
    return minimise(problem.shape, offsets, numbers)[:2]


@dataclass(frozen=True, eq=False)
class Ways:
    """Lower bounds on ways, for P passages and N pairs.

    Attributes
    ----------
    enters, leaves : array, shape (P, N)
        From p to where a passage is entered, and from where it is left to q; infinite in other modes.
    inner, between : array, shape (P, P)
        From leaving one passage to entering another, and to leaving it with all between (0 to itself), tolls included.
    """

    enters: Array
    leaves: Array
    inner: Array
    between: Array

    @classmethod
    def of(cls, pairs: Pairs, budget: Budget) -> Ways:
        """Those of some pairs."""
        passages = pairs.space.passages
        enters: Array = np.full((len(passages), len(pairs.p)), np.inf)
        leaves: Array = np.full_like(enters, np.inf)
        for g in passages:
            if g.source == pairs.source:
                enters[g.index] = to_entry(g, pairs.p)
            if g.target == pairs.target:
                leaves[g.index] = to_exit(g, pairs.q)
        return cls(enters, leaves, gaps(pairs.space, budget), between_passages(pairs.space, pairs.toll, budget))

    def rest(self, last: int, indices: Indices) -> Array:
        """What is left at least, once a passage has been left."""
        rows = np.flatnonzero(np.isfinite(self.between[last]))
        if not rows.size:
            return np.full(len(indices), np.inf)
        return np.min(self.between[last, rows][:, None] + self.leaves[np.ix_(rows, indices)], axis=0)


def between_passages(space: Space, toll: float, budget: Budget) -> Array:
    """The least from leaving one passage to leaving another (0 to itself), tolls included: all pairs, Floyd's way."""
    key = ("between", toll)
    found: Any = space.cache.get(key)
    if found is None:
        count = len(space.passages)
        found = (gaps(space, budget) + toll) * (1 - ROUNDING * count)
        found[np.arange(count), np.arange(count)] = 0.0
        for k in range(count):
            found = np.minimum(found, found[:, k, None] + found[None, k, :])
        if not budget.ran_out:
            space.cache[key] = found
    return found
