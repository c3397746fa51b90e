"""Domains, guards and passages as float64 geometry.

A domain is a polyhedron, a guard a polyhedron inside a plane of its mode, a reset an affine map: exact for models whose
surfaces, conditions and resets are affine. What is not affine stands beside it as a function that is at most 0 where
the point is allowed, so that the polyhedra contain the sets they stand for: lower bounds stay valid.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.formulas import Formula
from hsdsl.analysis.metrics.rational import Exact, maximise
from hsdsl.base.numbers.enclosures import Array

TOLERANCE = 1e-9  # how far beyond a surface a point still counts as on it, relative to the size of the points


@dataclass(frozen=True, eq=False)
class Domain:
    """A mode's domain: ``normals @ x <= levels`` (m unit rows of n) and ``curved(x) <= 0``.

    ``rows`` (m, n + 1) are the inequalities without rounding, see :mod:`hsdsl.analysis.metrics.rational`.
    """

    mode: str
    coordinates: tuple[str, ...]
    normals: Array
    levels: Array
    curved: tuple[Formula, ...]
    texts: tuple[str, ...]
    rows: Exact

    @property
    def convex(self) -> bool:
        """Whether the polyhedron is the domain itself."""
        return not self.curved

    def excess(self, x: Array, size: float) -> tuple[float, str | None]:
        """How far a point is beyond the worst inequality, and that inequality's text.

        Relative to ``size``, the length of the compared points, and the inequality's level; to first order where it is
        curved.
        """
        size = max(size, float(np.linalg.norm(x)), 1e-300)
        flat = (self.normals @ x - self.levels) / (size + np.abs(self.levels))
        beyond = [*flat.tolist(), *(_beyond(value, x) / size for value in self.curved)]
        worst = max(range(len(beyond)), key=lambda k: _or_infinite(beyond[k]), default=None)
        return (0.0, None) if worst is None else (beyond[worst], self.texts[worst])


def _beyond(formula: Formula, x: Array) -> float:
    value = formula(x)
    slope = float(np.linalg.norm(formula.gradient(x))) if value > 0 else 1.0
    return value / slope if slope > 0 else value * np.inf


def _or_infinite(value: float) -> float:
    return np.inf if np.isnan(value) else value


@dataclass(frozen=True, eq=False)
class Gate:
    """A convex piece of a guard, and its image: two maps of s (base, then frame), with unit ``normals s <= levels``.

    The guard's frame has orthonormal columns, so lengths on the guard are lengths of s. Every number is that of
    ``exact``, rounded once. ``inner`` is a point s at which every inequality holds with some ``room``. ``across`` are
    unit vectors and levels, for the guard and for its image: ``vectors @ x = levels`` there. ``curved`` are conditions
    on the guard's points that are not affine; with any, the piece contains the guard and may be larger.
    """

    edge: str
    source: int
    target: int
    sides: tuple[Array, Array]
    normals: Array
    levels: Array
    inner: Array
    room: Array
    across: tuple[tuple[Array, Array], tuple[Array, Array]]
    exact: ExactGate
    curved: tuple[Formula, ...] = ()

    @property
    def size(self) -> int:
        """Dimension of the guard."""
        return self.sides[0].shape[1] - 1

    @cached_property
    def plane(self) -> Gate:
        """The same gate without inequalities."""
        none = np.zeros((0, self.size))
        exact = replace(self.exact, rows=self.exact.rows[:0])
        return replace(self, normals=none, levels=np.zeros(0), room=np.zeros(0), exact=exact, curved=())

    @cached_property
    def radius(self) -> float:
        """How far the guard reaches from its base at most; infinite where it has no end."""
        rows, inner = self.exact.rows, self.exact.inner
        ends: list[float] = []
        for k, axis in enumerate(np.eye(self.size, dtype=int).astype(object)):
            both = [maximise(sign * axis, rows, inner) for sign in (1, -1)]
            ends.append(max(np.inf if end is None else abs(float(end[0][k])) for end in both))
        return float(np.linalg.norm(ends)) * (1 + 1e-9)


@dataclass(frozen=True, eq=False)
class ExactGate:
    """A gate in rational numbers: guard and image as maps of s (base, then frame), the inequalities, and ``inner``."""

    sides: tuple[Exact, Exact]
    rows: Exact
    inner: Exact


@dataclass(frozen=True, eq=False)
class CurvedGate:
    """A guard whose surface or reset is not affine: ``surface(x) = 0``, ``conditions(x) <= 0``, ``reset(x)``.

    ``marks`` are functions of the target's coordinates that are 0 on the image.
    """

    edge: str
    source: int
    target: int
    surface: Formula
    conditions: Formula
    reset: Formula
    marks: Formula


@dataclass(frozen=True, eq=False)
class Passage:
    """A gate passed in one direction, from a source mode into a target.

    ``enter`` and ``leave`` are the sides where it is entered and left, as maps of s. ``across`` are unit vectors and
    levels of the planes that hold the two sides, and ``exact`` both sides in rational numbers.
    """

    index: int
    gate: Gate
    forward: bool
    source: int
    target: int
    enter: Array
    leave: Array
    across: tuple[tuple[Array, Array], tuple[Array, Array]]
    exact: tuple[Exact, Exact]

    @classmethod
    def through(cls, gate: Gate, index: int) -> Passage:
        """Forwards for even indices, else backwards."""
        a, b = (1, 0) if index % 2 else (0, 1)
        modes, sides, across, exact = (gate.source, gate.target), gate.sides, gate.across, gate.exact.sides
        pairs = (across[a], across[b]), (exact[a], exact[b])
        return cls(index, gate, index % 2 == 0, modes[a], modes[b], sides[a], sides[b], *pairs)


@dataclass(frozen=True, eq=False)
class Space:
    """A model's domains glued along its guards, for one set of parameter values.

    ``gates`` are the guards with affine surface and reset, in convex pieces; ``curved_gates`` the others. ``kept`` are,
    for each mode, the places of coordinates that every mode has and no passage changes: their Euclidean distance is a
    lower bound everywhere. Where ``timed``, time is the last coordinate of every domain.
    """

    modes: tuple[str, ...]
    domains: tuple[Domain, ...]
    gates: tuple[Gate, ...]
    curved_gates: tuple[CurvedGate, ...]
    kept: tuple[tuple[int, ...], ...] | None
    timed: bool
    cache: dict[Any, Any] = field(default_factory=dict[Any, Any], repr=False)

    def mode_index(self, name: str) -> int:
        """A mode's index by name."""
        try:
            return self.modes.index(name)
        except ValueError:
            raise KeyError(name) from None

    @cached_property
    def passages(self) -> tuple[Passage, ...]:
        """Every gate in both directions; gate i forwards is 2 i, backwards 2 i + 1."""
        return tuple(Passage.through(gate, 2 * i + k) for i, gate in enumerate(self.gates) for k in (0, 1))

    @cached_property
    def planes(self) -> tuple[Passage, ...]:
        """The passages without the inequalities of their gates."""
        return tuple(Passage.through(passage.gate.plane, passage.index) for passage in self.passages)

    def fewest(self, source: int) -> dict[int, int]:
        """The fewest passages to each mode that is connected with one."""
        steps, reached = {source: 0}, [source]
        for mode in reached:
            for gate in (*self.gates, *self.curved_gates):
                for here, there in ((gate.source, gate.target), (gate.target, gate.source)):
                    if here == mode and there not in steps:
                        steps[there] = steps[mode] + 1
                        reached.append(there)
        return steps

    @cached_property
    def affine(self) -> bool:
        """Whether everything is affine, so that both ends of a distance are certified."""
        return not self.curved_gates and all(d.convex for d in self.domains) and not any(g.curved for g in self.gates)
