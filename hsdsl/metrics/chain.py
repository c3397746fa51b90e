"""The shortest path through a given sequence of passages, as a convex problem.

With unknowns s (a point on each guard, in its own coordinates) every straight leg of the path is ``M s + o``, so its
length is a norm of affine functions, to be minimised over a polyhedron: a second-order cone problem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hsdsl.metrics.geometry import Array, Passage, Space


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise the sum of ``|matrices[i] @ s + offsets[i]|`` over ``normals @ s <= levels``."""

    matrices: tuple[Array, ...]
    offsets: tuple[Array, ...]
    normals: Array
    levels: Array

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.normals.shape[1]

    def length(self, s: Array) -> float:
        """The path's length at s."""
        return float(sum(np.linalg.norm(m @ s + o) for m, o in zip(self.matrices, self.offsets, strict=True)))


class Chain:
    """A sequence of passages: its matrices, to which the two ends are added by :meth:`problem`.

    ``points(s)`` gives the guard points. The legs are the one from p, those between passages, and the one to q.
    """

    def __init__(self, space: Space, passages: Sequence[Passage]) -> None:
        self.space = space
        self.passages = tuple(passages)
        sizes = [p.gate.size for p in passages]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
        self.slices = [slice(a, b) for a, b in pairwise(starts.tolist())]
        self.size = int(starts[-1])
        rows = sum(len(p.gate.levels) for p in passages)
        self.normals = np.zeros((rows, self.size))
        row = 0
        for passage, where in zip(passages, self.slices, strict=True):
            m = len(passage.gate.levels)
            self.normals[row : row + m, where] = passage.gate.normals
            row += m
        self.levels = np.concatenate([np.zeros(0), *(p.gate.levels for p in passages)])
        self.enters = [self._wide(p.enter, w) for p, w in zip(passages, self.slices, strict=True)]
        self.leaves = [self._wide(p.leave, w) for p, w in zip(passages, self.slices, strict=True)]
        between = list(zip(self.leaves, self.enters[1:], strict=False))
        self.inner = [(into[1] - out[1], into[0] - out[0]) for out, into in between]

    def _wide(self, side: tuple[Array, Array], where: slice) -> tuple[Array, Array]:
        base, frame = side
        wide = np.zeros((len(base), self.size))
        wide[:, where] = frame
        return base, wide

    def problem(self, p: Array | None, q: Array | None, kept: bool = False) -> Problem:
        """The problem between p and q; without a first or last leg where they are None.

        With ``kept`` the last leg measures only the coordinates that no passage changes, to a q in any mode given by
        those coordinates alone: a lower bound for whatever comes after.
        """
        legs = list(self.inner)
        if p is not None:
            base, frame = self.enters[0]
            legs.insert(0, (frame, base - p))
        if q is not None:
            base, frame = self.leaves[-1]
            if kept and self.space.kept is not None:
                rows = list(self.space.kept[self.passages[-1].target])
                base, frame = base[rows], frame[rows]
            legs.append((frame, base - q))
        return Problem(tuple(m for m, _ in legs), tuple(o for _, o in legs), self.normals, self.levels)

    def sides(self, s: Array) -> list[tuple[Array, Array]]:
        """Where each passage is entered and left, for unknowns s."""
        return [
            (enter[0] + enter[1] @ s, leave[0] + leave[1] @ s)
            for enter, leave in zip(self.enters, self.leaves, strict=True)
        ]


def chain_of(space: Space, indices: tuple[int, ...]) -> Chain:
    """The chain of a sequence of passages, made once."""
    key = ("chain", indices)
    found = space.cache.get(key)
    if not isinstance(found, Chain):
        found = Chain(space, [space.passages[i] for i in indices])
        space.cache[key] = found
    return found
