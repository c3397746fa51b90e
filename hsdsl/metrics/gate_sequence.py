"""Sequences of passages, and the shortest paths through them as convex problems.

With unknowns s (a point on each guard, in its own coordinates) every straight leg of the path is ``M s + o``, so its
length is a norm of affine functions, to be minimised over a polyhedron: a second-order cone problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hsdsl.metrics.geometry import Array, Gate, Passage, Space
from hsdsl.metrics.rounding import UNIT, norm


@dataclass(eq=False)
class ConeShape:
    """What problems share: minimise the sum of ``|matrices[i] @ s + offsets[i]|`` over unit ``normals @ s <= levels``.

    ``inner`` is a point at which every inequality holds with some ``room``, if one is known, and ``gates`` are those
    whose coordinates the unknowns are.
    """

    matrices: tuple[Array, ...]
    normals: Array
    levels: Array
    inner: Array | None = None
    room: Array | None = None
    gates: tuple[Gate, ...] = ()
    cone: Any = None  # as the conic solver takes it, once it was needed

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.normals.shape[1]

    @cached_property
    def stacked(self) -> Array:
        """All matrices, one below the other."""
        return np.vstack(self.matrices)

    @cached_property
    def parts(self) -> list[slice]:
        """Which of its rows each matrix is."""
        ends = np.cumsum([0, *(len(m) for m in self.matrices)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    @cached_property
    def _factors(self) -> tuple[Array, Array, Array]:
        """Its singular vectors and values."""
        left, values, right = np.linalg.svd(self.stacked, full_matrices=False)
        return left, values, right

    @cached_property
    def back(self) -> Array:
        """Its pseudo-inverse."""
        left, values, right = self._factors
        kept = values > max(self.stacked.shape) * 2 * UNIT * values.max(initial=0.0)
        return (right[kept].T / values[kept]) @ left[:, kept].T

    @cached_property
    def spread(self) -> float:
        """How much the legs together can change with the unknowns, for each unit of their length."""
        return float(sum(np.linalg.norm(m) for m in self.matrices))

    @cached_property
    def operations(self) -> int:
        """How many roundings can meet in one number."""
        return sum(self.stacked.shape) + len(self.levels) + 10

    @cached_property
    def least(self) -> float:
        """How much the legs together change at least; 0 where rounding leaves that open."""
        if self.size == 0:
            return 0.0
        values = self._factors[1]
        least = float(values[-1]) if len(values) == self.size else 0.0
        return max(0.0, least - self.operations * UNIT * float(np.linalg.norm(self.stacked)))

    @cached_property
    def radius(self) -> float:
        """How long the vector of unknowns can be; infinite where a guard has no end, or none is known."""
        return float(np.linalg.norm([gate.radius for gate in self.gates])) if self.gates else np.inf


@dataclass(frozen=True, eq=False)
class ConeProblem:
    """B problems of one shape: offsets (B, n_i), and the size (B,) of the numbers that they are made of."""

    shape: ConeShape
    offsets: list[Array]
    numbers: Array


class GateSequence:
    """A sequence of passages: its matrices, to which the two ends are added by :meth:`problem`.

    The legs are the one from p, those between passages, and the one to q.
    """

    def __init__(self, space: Space, passages: Sequence[Passage]) -> None:
        self.space = space
        self.passages = tuple(passages)
        gates = [p.gate for p in passages]
        starts = np.concatenate([[0], np.cumsum([g.size for g in gates])]).astype(int)
        self.slices = [slice(a, b) for a, b in pairwise(starts.tolist())]
        self.size = int(starts[-1])
        self.normals = np.zeros((sum(len(g.levels) for g in gates), self.size))
        row = 0
        for gate, where in zip(gates, self.slices, strict=True):
            self.normals[row : row + len(gate.levels), where] = gate.normals
            row += len(gate.levels)
        self.levels, self.inner, self.room = (
            np.concatenate([np.zeros(0), *parts])
            for parts in ([g.levels for g in gates], [g.inner for g in gates], [g.room for g in gates])
        )
        self.enters = [self._wide(p.enter, w) for p, w in zip(passages, self.slices, strict=True)]
        self.leaves = [self._wide(p.leave, w) for p, w in zip(passages, self.slices, strict=True)]
        between = list(zip(self.leaves, self.enters[1:], strict=False))
        self.inner_legs = [(into[1] - out[1], into[0] - out[0]) for out, into in between]
        self.numbers = sum(float(np.linalg.norm(base)) for side in between for base, _ in side)
        self.shapes: dict[tuple[bool, bool, bool], ConeShape] = {}

    def _wide(self, side: tuple[Array, Array], where: slice) -> tuple[Array, Array]:
        base, frame = side
        wide = np.zeros((len(base), self.size))
        wide[:, where] = frame
        return base, wide

    def problem(self, p: Array | None, q: Array | None, kept: bool = False) -> ConeProblem:
        """The problems between pairs, rows of p and q; without a first or last leg where they are None.

        With ``kept`` the last leg measures only the coordinates that no passage changes, to a q in any mode given by
        those coordinates alone: a lower bound for whatever comes after.
        """
        ends = [x for x in (p, q) if x is not None]
        count = len(ends[0]) if ends else 1
        offsets = [np.tile(offset, (count, 1)) for _, offset in self.inner_legs]
        numbers = np.full(count, float(self.numbers))
        if p is not None:
            base = self.enters[0][0]
            offsets.insert(0, base - p)
            numbers += float(np.linalg.norm(base)) + norm(p)
        if q is not None:
            base = self._last(kept)[0]
            offsets.append(base - q)
            numbers += float(np.linalg.norm(base)) + norm(q)
        return ConeProblem(self.shape(p is not None, q is not None, kept), offsets, numbers)

    def shape(self, first: bool, last: bool, kept: bool = False) -> ConeShape:
        """What problems with or without a first and a last leg share."""
        found = self.shapes.get((first, last, kept))
        if found is None:
            legs = [self.enters[0][1]] * first + [matrix for matrix, _ in self.inner_legs]
            legs += [self._last(kept)[1]] * last
            gates = tuple(p.gate for p in self.passages)
            found = ConeShape(tuple(legs), self.normals, self.levels, self.inner, self.room, gates)
            self.shapes[first, last, kept] = found
        return found

    def _last(self, kept: bool) -> tuple[Array, Array]:
        base, frame = self.leaves[-1]
        if kept and self.space.kept is not None:
            rows = list(self.space.kept[self.passages[-1].target])
            return base[rows], frame[rows]
        return base, frame

    def sides(self, s: Array) -> list[tuple[Array, Array]]:
        """Where each passage is entered and left, for unknowns s."""
        return [
            (enter[0] + enter[1] @ s, leave[0] + leave[1] @ s)
            for enter, leave in zip(self.enters, self.leaves, strict=True)
        ]


def gate_sequence(space: Space, indices: tuple[int, ...]) -> GateSequence:
    """The chain of a sequence of passages, made once."""
    key = ("chain", indices)
    found = space.cache.get(key)
    if not isinstance(found, GateSequence):
        found = GateSequence(space, [space.passages[i] if i >= 0 else space.planes[~i] for i in indices])
        space.cache[key] = found
    return found
