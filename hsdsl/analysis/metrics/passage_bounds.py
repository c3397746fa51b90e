"""Lower bounds on the ways between passages and from or to points, for one pair of points or many."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.dominance import hops_of, passage_number
from hsdsl.analysis.metrics.gate_sequence import gate_sequence
from hsdsl.analysis.metrics.geometry import Array, Space
from hsdsl.analysis.metrics.guard_clearance import to_entry, to_exit
from hsdsl.analysis.metrics.rounding import norm
from hsdsl.analysis.metrics.socp import ROUNDS, solve

ROUNDING = 64 * 2.0**-53  # of a norm or a short sum, relative to itself
Indices = NDArray[np.intp]


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
                    gap = 0.0 if budget.spent() else _gap(space, f.index, g.index)
                    found[f.index, g.index] = found[g.index ^ 1, f.index ^ 1] = gap
        if not budget.ran_out:
            space.cache["gaps"] = found
    return found


def _gap(space: Space, f: int, g: int) -> float:
    """0 where a passage is taken back at once."""
    return 0.0 if f == g ^ 1 else float(solve(*gate_sequence(space, (f, g)).problem(None, None), 1)[0][0])
