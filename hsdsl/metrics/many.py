"""Distances of many pairs of points in the same two modes: the search of `hsdsl.metrics.search`, for arrays.

Sequences of passages are gone through by length; each keeps only the pairs for which it can still be the shortest.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.metrics.chain import chain_of
from hsdsl.metrics.follow import may_follow
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.line import interval_of, minimise_on_line
from hsdsl.metrics.norms import minimise
from hsdsl.metrics.search import TOLERANCE, gaps
from hsdsl.metrics.sides import norms, to_side

ROUNDING = 16 * 2.0**-53
Indices = NDArray[np.intp]


@dataclass
class Pairs:
    """The pairs and what is known of them: ``upper`` the best path, ``lower`` the least of what was computed."""

    space: Space
    source: int
    p: Array
    target: int
    q: Array
    toll: float
    upper: Array
    lower: Array

    @classmethod
    def of(cls, space: Space, source: int, p: Array, target: int, q: Array, relaxation: float | None) -> Pairs:
        """Begin with the straight line, where both are in one mode."""
        straight = norms(p - q) if source == target else np.full(len(p), np.inf)
        return cls(space, source, p, target, q, relaxation or 0.0, straight, straight.copy())

    def least(self) -> Array:
        """A lower bound that holds everywhere: what no passage changes."""
        if self.space.kept is None:
            return np.zeros(len(self.p))
        own, other = list(self.space.kept[self.source]), list(self.space.kept[self.target])
        return norms(self.p[:, own] - self.q[:, other])

    def open(self, bounds: Array, indices: Indices) -> Indices:
        """Those of ``indices`` whose bound is still below the best path."""
        return indices[bounds < self.upper[indices] * (1 - TOLERANCE)]

    def widened(self) -> tuple[Array, Array]:
        """The bounds with rounding allowed for; pairs of one point are at distance 0."""
        sizes = np.abs(self.p).sum(axis=1) + np.abs(self.q).sum(axis=1)
        rounding = ROUNDING * (sizes + 2 * np.where(np.isfinite(self.upper), self.upper, 0))
        if self.source == self.target:
            rounding = np.where(np.all(self.p == self.q, axis=1), 0.0, rounding)
        lower = np.minimum(self.lower, self.upper)
        return np.maximum(lower - rounding, 0), self.upper + rounding


def search_many(pairs: Pairs, hops: int) -> None:
    """Improve ``pairs`` until no sequence of at most ``hops`` passages can be shorter."""
    space = pairs.space
    everything = np.arange(len(pairs.p))
    floor = pairs.least()
    layer: list[tuple[tuple[int, ...], Indices]] = [
        ((p.index,), pairs.open(floor, everything)) for p in space.passages if p.source == pairs.source
    ]
    enters, leaves = _entered(pairs), _left(pairs)
    between = between_passages(space, pairs.toll)
    while layer:
        following: list[tuple[tuple[int, ...], Indices]] = []
        for sequence, candidates in layer:
            active = _promising(pairs, sequence, candidates, floor, enters, leaves, between)
            if not active.size:
                continue
            if space.passages[sequence[-1]].target == pairs.target:
                _finish(pairs, sequence, active)
            longer = [(*sequence, g) for g in followers(space, sequence[-1])] if len(sequence) < hops else []
            if not longer:
                continue
            active = _still_open(pairs, sequence, pairs.open(floor[active], active), leaves, between)
            if active.size:
                following += [(one, active) for one in longer]
        layer = following


def around_guards(pairs: Pairs) -> Array:
    """A lower bound for paths with passages: to a guard, between guards, from one; 0 where guards are curved."""
    if pairs.space.curved_gates:
        return np.zeros(len(pairs.p))
    enters, leaves = _entered(pairs), _left(pairs)
    between = between_passages(pairs.space, pairs.toll)
    everything = np.arange(len(pairs.p))
    best = np.full(len(pairs.p), np.inf)
    for g in pairs.space.passages:
        if g.source == pairs.source:
            best = np.minimum(best, enters[g.index] + pairs.toll + _rest(between, leaves, g.index, everything))
    return best


def followers(space: Space, last: int) -> list[int]:
    """The passages that may come after one."""
    mode = space.passages[last].target
    return [g.index for g in space.passages if g.source == mode and all(may_follow(space, last, g.index))]


def _promising(
    pairs: Pairs,
    sequence: tuple[int, ...],
    candidates: Indices,
    floor: Array,
    enters: Array,
    leaves: Array,
    between: Array,
) -> Indices:
    """Drop by the cheapest bound: from p to the first guard, from guard to guard, from some last guard to q."""
    inner = gaps(pairs.space)
    fixed = sum(float(inner[a, b]) for a, b in pairwise(sequence)) + pairs.toll * len(sequence)
    rest = _rest(between, leaves, sequence[-1], candidates)
    bound = np.maximum(enters[sequence[0], candidates] + fixed + rest, floor[candidates] + pairs.toll * len(sequence))
    return pairs.open(bound, candidates)


def _still_open(pairs: Pairs, sequence: tuple[int, ...], active: Indices, leaves: Array, between: Array) -> Indices:
    """Drop by the way through the whole sequence so far."""
    if not active.size:
        return active
    space, toll = pairs.space, pairs.toll * len(sequence)
    chain = chain_of(space, sequence)
    rest = _rest(between, leaves, sequence[-1], active)
    zero = np.zeros(len(space.domains[pairs.source].coordinates))
    problem = chain.problem(zero, None)
    offsets = repeated(problem.offsets, len(active))
    offsets[0] = offsets[0] - pairs.p[active]
    active = active[
        _below(pairs, active, shortest(problem.matrices, offsets, chain.normals, chain.levels)[0] + toll + rest)
    ]
    if space.kept is None or not active.size:
        return active
    goals = pairs.q[active][:, list(space.kept[pairs.target])]
    problem = chain.problem(zero, np.zeros(len(space.kept[pairs.target])), kept=True)
    offsets = repeated(problem.offsets, len(active))
    offsets[0], offsets[-1] = offsets[0] - pairs.p[active], offsets[-1] - goals
    return active[_below(pairs, active, shortest(problem.matrices, offsets, chain.normals, chain.levels)[0] + toll)]


def _below(pairs: Pairs, active: Indices, bound: Array) -> NDArray[np.bool_]:
    return bound < pairs.upper[active] * (1 - TOLERANCE)


def _finish(pairs: Pairs, sequence: tuple[int, ...], active: Indices) -> None:
    """The paths through exactly this sequence."""
    chain = chain_of(pairs.space, sequence)
    domains = pairs.space.domains
    zeros = [np.zeros(len(domains[mode].coordinates)) for mode in (pairs.source, pairs.target)]
    problem = chain.problem(zeros[0], zeros[1])
    offsets = repeated(problem.offsets, len(active))
    offsets[0], offsets[-1] = offsets[0] - pairs.p[active], offsets[-1] - pairs.q[active]
    lower, upper, _ = shortest(problem.matrices, offsets, chain.normals, chain.levels)
    toll = pairs.toll * len(sequence)
    pairs.lower[active] = np.minimum(pairs.lower[active], lower + toll)
    pairs.upper[active] = np.minimum(pairs.upper[active], upper + toll)


def repeated(offsets: tuple[Array, ...], count: int) -> list[Array]:
    """The same offsets for every problem."""
    return [np.tile(o, (count, 1)) for o in offsets]


def shortest(
    matrices: tuple[Array, ...], offsets: list[Array], normals: Array, levels: Array
) -> tuple[Array, Array, Array]:
    """Minimise sums of norms by the method their number of unknowns allows."""
    size = normals.shape[1]
    if size == 0:
        value = sum((norms(o) for o in offsets), np.zeros(len(offsets[0])))
        return value, value, np.zeros((len(value), 0))
    if size == 1:
        low, high = interval_of(normals, levels)
        lower, upper, s = minimise_on_line([m[:, 0] for m in matrices], offsets, low, high)
        return lower, upper, s[:, None]
    return minimise(list(matrices), offsets, normals, levels)


def _entered(pairs: Pairs) -> Array:
    """For each passage, a lower bound on how far each p is from where it is entered (inf in another mode)."""
    passages = pairs.space.passages
    found = np.full((len(passages), len(pairs.p)), np.inf)
    for g in passages:
        if g.source == pairs.source:
            found[g.index] = to_side(g, g.enter, pairs.p)
    return found


def _left(pairs: Pairs) -> Array:
    """For each passage, a lower bound on how far each q is from where it is left (inf in another mode)."""
    passages = pairs.space.passages
    found = np.full((len(passages), len(pairs.q)), np.inf)
    for g in passages:
        if g.target == pairs.target:
            found[g.index] = to_side(g, g.leave, pairs.q)
    return found


def _rest(between: Array, leaves: Array, last: int, indices: Indices) -> Array:
    """What is left at least, once a passage has been left."""
    rows = np.flatnonzero(np.isfinite(between[last]))
    if not rows.size:
        return np.full(len(indices), np.inf)
    return np.min(between[last, rows][:, None] + leaves[np.ix_(rows, indices)], axis=0)


def between_passages(space: Space, toll: float) -> Array:
    """The least from leaving one passage to leaving another (0 to itself), tolls included: all pairs, Floyd's way."""
    key = ("between", toll)
    found: Any = space.cache.get(key)
    if found is None:
        count = len(space.passages)
        found = gaps(space) + toll
        found[np.arange(count), np.arange(count)] = 0.0
        for k in range(count):
            found = np.minimum(found, found[:, k, None] + found[None, k, :])
        space.cache[key] = found
    return found
