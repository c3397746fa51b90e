"""Paths through guards and domains that are not affine: their length, and what must hold on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.metrics.geometry import Array, Curved, Gate, Space, VectorMap

INSIDE = 1e-9  # how far beyond an inequality a path may be, relative to the size of the numbers
SAMPLES = 16  # of a straight piece, where its domain is not a polyhedron


@dataclass(frozen=True, eq=False)
class Crossing:
    """A guard passed in one direction, any guard: the unknown is the point x on it."""

    edge: str
    source: int
    target: int
    guard_mode: int
    forward: bool
    surface: Curved
    conditions: tuple[Curved, ...]
    reset: VectorMap

    def sides(self, x: Array) -> tuple[Array, Array]:
        """Where the passage is entered and left."""
        image = self.reset(x)
        return (x, image) if self.forward else (image, x)


def crossings(space: Space) -> tuple[Crossing, ...]:
    """Every guard in both directions."""
    found: tuple[Crossing, ...] | None = space.cache.get("crossings")
    if found is None:
        both: list[Crossing] = []
        for gate in (*(_as_functions(g) for g in space.gates), *space.curved_gates):
            what = gate.surface, gate.conditions, gate.reset
            both.append(Crossing(gate.edge, gate.source, gate.target, gate.source, True, *what))
            both.append(Crossing(gate.edge, gate.target, gate.source, gate.source, False, *what))
        found = space.cache["crossings"] = tuple(both)
    return found


def _as_functions(gate: Gate) -> Crossing:
    normal = np.linalg.svd(gate.frame.T)[2][-1] if gate.size else np.ones(1)

    def surface(x: Array) -> float:
        return float(normal @ (x - gate.base))

    def beyond(row: int) -> Curved:
        return lambda x: float(gate.normals[row] @ (gate.frame.T @ (x - gate.base)) - gate.levels[row])

    def reset(x: Array) -> Array:
        return gate.image_base + gate.image_frame @ (gate.frame.T @ (x - gate.base))

    conditions = (*(beyond(row) for row in range(len(gate.levels))), *gate.curved)
    return Crossing(gate.edge, gate.source, gate.target, gate.source, True, surface, conditions, reset)


@dataclass(frozen=True, eq=False)
class Route:
    """A sequence of crossings between p and q; unknowns are the guard points, one after the other."""

    space: Space
    sequence: tuple[Crossing, ...]
    start: tuple[int, Array]
    end: tuple[int, Array]

    def points(self, unknowns: Array) -> list[Array]:
        """The guard points."""
        sizes = [len(self.space.domains[c.guard_mode].coordinates) for c in self.sequence]
        return np.split(unknowns, np.cumsum(sizes)[:-1]) if sizes else []

    def legs(self, unknowns: Array) -> list[tuple[int, Array, Array]]:
        """The straight pieces: mode, start and end."""
        at, mode = self.start[1], self.start[0]
        found: list[tuple[int, Array, Array]] = []
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            enter, leave = crossing.sides(x)
            found.append((mode, at, enter))
            at, mode = leave, crossing.target
        return [*found, (mode, at, self.end[1])]

    def length(self, unknowns: Array) -> float:
        """The path's length."""
        return float(sum(np.linalg.norm(b - a) for _, a, b in self.legs(unknowns)))

    def surfaces(self, unknowns: Array) -> Array:
        """What must be 0."""
        return np.array([c.surface(x) for c, x in zip(self.sequence, self.points(unknowns), strict=True)])

    def room(self, unknowns: Array) -> Array:
        """What must not be negative: guards' conditions, and images inside their domains."""
        values: list[float] = []
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            values += [-condition(x) for condition in crossing.conditions]
            image_mode = crossing.target if crossing.forward else crossing.source
            domain, image = self.space.domains[image_mode], crossing.reset(x)
            values += (domain.levels - domain.normals @ image).tolist()
            values += [-value(image) for value in domain.curved]
        return np.array(values)

    def allowed(self, unknowns: Array) -> bool:
        """Whether the path lies in the space: on its guards, and straight pieces in their domains."""
        size = INSIDE * (1 + float(np.abs(unknowns).max(initial=0)))
        on = np.abs(self.surfaces(unknowns)).max(initial=0) <= size
        inside = self.room(unknowns).min(initial=0) >= -size
        return bool(on and inside) and all(straight_inside(self.space, *leg) for leg in self.legs(unknowns))


def straight_inside(space: Space, mode: int, a: Array, b: Array) -> bool:
    """Whether a straight piece stays in its domain: looked at in points where the domain is not a polyhedron."""
    curved: Sequence[Curved] = space.domains[mode].curved
    size = INSIDE * (1 + float(max(np.abs(a).max(initial=0), np.abs(b).max(initial=0))))
    shares = np.linspace(0, 1, SAMPLES + 1) if curved else ()
    return all(value(a + share * (b - a)) <= size for share in shares for value in curved)
