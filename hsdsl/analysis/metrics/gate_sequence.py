"""Sequences of passages, and the shortest paths through them as convex problems.

With unknowns s (a point on each guard, in its own coordinates) every straight leg of the path is ``M s + o``, so its
length is a norm of affine functions, to be minimised over a polyhedron: a second-order cone problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.geometry import Array, Gate, Passage, Space
from hsdsl.analysis.metrics.rounding import UNIT, norm


@dataclass(eq=False)
class ConeShape:
    """What problems share: minimise the sum of ``|matrices[i] @ s + offset|`` over unit ``normals @ s <= levels``.

    A problem's offsets, one leg after the other, are those of its two ends and ``bases``; ``numbers`` is the size of
    all these. ``inner`` is a point at which every inequality holds with some ``room``, if one is known, and ``gates``
    are those whose coordinates the unknowns are.
    """

    matrices: tuple[Array, ...]
    normals: Array
    levels: Array
    inner: Array | None = None
    room: Array | None = None
    gates: tuple[Gate, ...] = ()
    bases: Array = field(default_factory=lambda: np.zeros(0))
    numbers: float = 0.0
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
    def back(self) -> Array:
        """Its pseudo-inverse."""
        found: Any = np.linalg.pinv(self.stacked, rcond=max(self.stacked.shape) * 2 * UNIT)
        return found

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
        values = np.linalg.svd(self.stacked, compute_uv=False)
        least = float(values[-1]) if len(values) == self.size else 0.0
        return max(0.0, least - self.operations * UNIT * float(np.linalg.norm(self.stacked)))

    @cached_property
    def radius(self) -> float:
        """How long the vector of unknowns can be; infinite where a guard has no end, or none is known."""
        return float(np.linalg.norm([gate.radius for gate in self.gates])) if self.gates else np.inf


class GateSequence:
    """A sequence of passages: its legs, to which the two ends are added by :meth:`problem`.

    ``enters`` and ``leaves`` are the points where each is entered and left, as maps of all unknowns: base, then frame.
    """

    def __init__(self, space: Space, passages: Sequence[Passage]) -> None:
        self.space, self.passages = space, tuple(passages)
        self.gates = tuple(p.gate for p in passages)
        firsts = np.cumsum([0, *(gate.size for gate in self.gates)]).tolist()
        rows = np.cumsum([0, *(len(gate.levels) for gate in self.gates)]).tolist()
        self.normals = np.zeros((rows[-1], firsts[-1]))
        self.enters: list[Array] = []
        self.leaves: list[Array] = []
        for passage, first, row in zip(self.passages, firsts, rows, strict=False):
            gate = passage.gate
            self.normals[row : row + len(gate.levels), first : first + gate.size] = gate.normals
            for sides, side in ((self.enters, passage.enter), (self.leaves, passage.leave)):
                wide = np.zeros((len(side), 1 + firsts[-1]))
                wide[:, 0], wide[:, 1 + first : 1 + first + gate.size] = side[:, 0], side[:, 1:]
                sides.append(wide)
        self.shapes: dict[tuple[bool, bool, bool], ConeShape] = {}

    def problem(self, p: Array | None, q: Array | None, kept: bool = False) -> tuple[ConeShape, Array, Array]:
        """The problems between pairs, rows of p and q: their shape, offsets, and the size of their numbers.

        There is no first or last leg where p or q is None. With ``kept`` the last leg measures only the coordinates
        that no passage changes, to a q in any mode given by those coordinates alone: a lower bound for all that may
        come after.
        """
        shape = self.shape(p is not None, q is not None, kept)
        count = next((len(x) for x in (p, q) if x is not None), 1)
        offsets, numbers = np.tile(shape.bases, (count, 1)), np.full(count, shape.numbers)
        for end, leg in ((p, 0), (q, -1)):
            if end is not None:
                offsets[:, shape.parts[leg]] -= end
                numbers += norm(end)
        return shape, offsets, numbers

    def shape(self, first: bool, last: bool, kept: bool = False) -> ConeShape:
        """What problems with or without a first and a last leg share."""
        found = self.shapes.get((first, last, kept))
        if found is None:
            between = list(zip(self.leaves, self.enters[1:], strict=False))
            end = self.leaves[-1]
            if kept and self.space.kept is not None:
                end = end[list(self.space.kept[self.passages[-1].target])]
            legs = self.enters[:1] * first + [into - out for out, into in between] + [end] * last
            ends = [*self.enters[: int(first)], *(side for pair in between for side in pair), *[end] * last]
            levels, inner, room = (
                np.concatenate([np.zeros(0), *(getattr(gate, name) for gate in self.gates)])
                for name in ("levels", "inner", "room")
            )
            bases = np.concatenate([np.zeros(0), *(leg[:, 0] for leg in legs)])
            numbers = sum(float(np.linalg.norm(side[:, 0])) for side in ends)
            matrices = tuple(leg[:, 1:] for leg in legs)
            found = ConeShape(matrices, self.normals, levels, inner, room, self.gates, bases, numbers)
            self.shapes[first, last, kept] = found
        return found

    def sides(self, s: Array) -> list[tuple[Array, Array]]:
        """Where each passage is entered and left, for unknowns s."""
        at = np.append(1.0, s)
        return [(enter @ at, leave @ at) for enter, leave in zip(self.enters, self.leaves, strict=True)]


def gate_sequence(space: Space, indices: tuple[int, ...]) -> GateSequence:
    """The chain of a sequence of passages, made once."""
    key = ("chain", indices)
    found = space.cache.get(key)
    if not isinstance(found, GateSequence):
        found = GateSequence(space, [space.passages[i] if i >= 0 else space.planes[~i] for i in indices])
        space.cache[key] = found
    return found
