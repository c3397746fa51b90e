"""Paths through guards and domains that are not affine: their length, what must hold on them, and all derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate, pairwise

import numpy as np

from hsdsl.analysis.metrics.geometry import TOLERANCE, Array, CurvedGate, Domain, Formula, Gate, Space, affine, stacked
from hsdsl.analysis.metrics.guard_clearance import OUTSIDE, segments_inside

# Where a leg that is held is held: dense towards its ends, at which it may leave a boundary it begins on.
SHARES = (0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999)


@dataclass(frozen=True, eq=False)
class Crossing:
    """A guard passed in one direction, any guard: the unknown is the point x on it.

    ``room`` are functions of the image that are at most 0 in its domain. A crossing without an edge is a bend: a point
    of a domain at which a path turns.
    """

    edge: str | None
    source: int
    target: int
    guard_mode: int
    forward: bool
    surface: Formula
    conditions: Formula
    reset: Formula
    room: Formula

    def sides(self, x: Array) -> tuple[Array, Array]:
        """Where the passage is entered and left."""
        image = self.reset.value(x)
        return (x, image) if self.forward else (image, x)

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """The derivatives of both sides."""
        own, image = np.eye(len(x)), self.reset.jacobian(x)
        return (own, image) if self.forward else (image, own)


def crossings(space: Space) -> tuple[Crossing, ...]:
    """Every guard in both directions."""
    return space.remembered("crossings", lambda: tuple(_crossings(space)))


def _crossings(space: Space) -> Iterator[Crossing]:
    for gate in (*space.gates, *space.curved_gates):
        curved = isinstance(gate, CurvedGate)
        what = (gate.surface, gate.conditions, gate.reset) if curved else _as_formulas(gate)
        room = inequalities(space.domains[gate.target])
        yield Crossing(gate.edge, gate.source, gate.target, gate.source, True, *what, room)
        yield Crossing(gate.edge, gate.target, gate.source, gate.source, False, *what, room)


def inequalities(domain: Domain) -> Formula:
    """All of a domain's inequalities, as functions that are at most 0."""
    return stacked([affine(domain.normals, -domain.levels), *domain.curved])


def bend(space: Space, mode: int) -> Crossing:
    """A point of a domain at which a path turns."""
    n = len(space.domains[mode].coordinates)
    nothing, identity = affine(np.zeros((0, n)), np.zeros(0)), affine(np.eye(n), np.zeros(n))
    return Crossing(None, mode, mode, mode, True, nothing, nothing, identity, inequalities(space.domains[mode]))


def _as_formulas(gate: Gate) -> tuple[Formula, Formula, Formula]:
    """Surface, conditions and reset of an affine guard, in the coordinates of its mode."""
    (base, frame), (image_base, image_frame) = ((side[:, 0], side[:, 1:]) for side in gate.sides)
    normal = np.linalg.svd(frame.T)[2][-1:] if gate.size else np.ones((1, len(base)))
    along, image = gate.normals @ frame.T, image_frame @ frame.T
    conditions = affine(along, -along @ base - gate.levels)
    reset = affine(image, image_base - image @ base)
    return affine(normal, -normal @ base), stacked([conditions, *gate.curved]), reset


@dataclass(frozen=True, eq=False)
class Route:
    """A sequence of crossings between p and q; unknowns are the guard points, one after the other.

    ``held`` are legs that are made to stay in their domains, and by how much in their middle (a quarter of that).
    """

    space: Space
    sequence: tuple[Crossing, ...]
    start: tuple[int, Array]
    end: tuple[int, Array]
    held: tuple[tuple[int, float], ...] = ()

    @property
    def passages(self) -> int:
        """How many guards it passes; bends do not count."""
        return sum(c.edge is not None for c in self.sequence)

    def points(self, unknowns: Array) -> list[Array]:
        """The guard points."""
        return [unknowns[where] for where in self._slices]

    @cached_property
    def _slices(self) -> list[slice]:
        ends = list(accumulate((len(self.space.domains[c.guard_mode].coordinates) for c in self.sequence), initial=0))
        return [slice(a, b) for a, b in pairwise(ends)]

    def legs(self, unknowns: Array) -> list[tuple[int, Array, Array]]:
        """The straight pieces: mode, start and end."""
        at, mode = self.start[1], self.start[0]
        found: list[tuple[int, Array, Array]] = []
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            enter, leave = crossing.sides(x)
            found.append((mode, at, enter))
            at, mode = leave, crossing.target
        return [*found, (mode, at, self.end[1])]

    def _crossed(self, unknowns: Array) -> Iterator[tuple[Crossing, Array, Callable[[Array], Array]]]:
        """The crossings with their guard points, and what takes derivatives by these to those by all unknowns."""

        def wide(block: Array, where: slice) -> Array:
            found = np.zeros((len(block), len(unknowns)))
            found[:, where] = block
            return found

        for crossing, where in zip(self.sequence, self._slices, strict=True):
            yield crossing, unknowns[where], partial(wide, where=where)

    def leg_slopes(self, unknowns: Array) -> list[tuple[Array, Array]]:
        """The derivatives of each leg's start and end by all unknowns."""
        fixed = [np.zeros((len(end[1]), len(unknowns))) for end in (self.start, self.end)]
        sides = [wide(side) for c, x, wide in self._crossed(unknowns) for side in c.slopes(x)]
        ends = [fixed[0], *sides, fixed[1]]
        return list(zip(ends[::2], ends[1::2], strict=True))

    def length(self, unknowns: Array) -> float:
        """The path's length."""
        return float(sum(np.linalg.norm(b - a) for _, a, b in self.legs(unknowns)))

    def smooth_length(self, unknowns: Array, rounding: float) -> tuple[float, Array]:
        """The sum of sqrt(|leg|^2 + rounding^2), which has derivatives everywhere, and those."""
        total, gradient = 0.0, np.zeros(len(unknowns))
        for (_, a, b), (da, db) in zip(self.legs(unknowns), self.leg_slopes(unknowns), strict=True):
            size = float(np.sqrt((b - a) @ (b - a) + rounding**2))
            total += size
            gradient += (b - a) @ (db - da) / size
        return total, gradient

    def surfaces(self, unknowns: Array) -> Array:
        """What must be 0."""
        parts = [c.surface.value(x) for c, x in zip(self.sequence, self.points(unknowns), strict=True)]
        return np.concatenate([np.zeros(0), *parts])

    def surface_slopes(self, unknowns: Array) -> Array:
        """Its derivatives."""
        rows = [wide(c.surface.jacobian(x)) for c, x, wide in self._crossed(unknowns)]
        return np.vstack([np.zeros((0, len(unknowns))), *rows])

    def room(self, unknowns: Array) -> Array:
        """What must not be negative: guards' conditions, and images inside their domains."""
        parts: list[Array] = [np.zeros(0)]
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            parts += [-crossing.conditions.value(x), -crossing.room.value(crossing.reset.value(x))]
        legs = self.legs(unknowns) if self.held else []
        for k, depth in self.held:
            mode, a, b = legs[k]
            for share in SHARES:
                at = a + share * (b - a)
                parts += [-f.value(at) - depth * share * (1 - share) for f in self.space.domains[mode].curved]
        return np.concatenate(parts)

    def room_slopes(self, unknowns: Array) -> Array:
        """Its derivatives."""
        rows = [np.zeros((0, len(unknowns)))]
        for c, x, wide in self._crossed(unknowns):
            image = c.room.jacobian(c.reset.value(x)) @ c.reset.jacobian(x)
            rows += [-wide(c.conditions.jacobian(x)), -wide(image)]
        legs, slopes = (self.legs(unknowns), self.leg_slopes(unknowns)) if self.held else ([], [])
        for k, _ in self.held:
            (mode, a, b), (da, db) = legs[k], slopes[k]
            for share in SHARES:
                at, moves = a + share * (b - a), da + share * (db - da)
                rows += [-f.jacobian(at) @ moves for f in self.space.domains[mode].curved]
        return np.vstack(rows)

    def excess(self, unknowns: Array) -> float:
        """How far the guard points are, to first order, from where surfaces and inequalities let them be."""
        on, in_ = np.abs(self.surfaces(unknowns)), np.maximum(-self.room(unknowns), 0.0)
        if not (np.all(np.isfinite(on)) and np.all(np.isfinite(in_))):
            return np.inf
        parts = [(on, self.surface_slopes), (in_, self.room_slopes)]
        return max(_farthest(off, slopes(unknowns)) if off.any() else 0.0 for off, slopes in parts)

    def size(self, unknowns: Array) -> float:
        """The largest coordinate of its ends and guard points."""
        return float(np.abs(np.concatenate([self.start[1], unknowns, self.end[1]])).max(initial=0.0))

    def allowed(self, unknowns: Array) -> bool:
        """Whether guard points are on their guards and images in their domains, nearly; what is missing is charged."""
        return self.excess(unknowns) <= TOLERANCE * self.size(unknowns)

    def charged(self, unknowns: Array) -> float:
        """The path's length, and what it may take to put its guard points where they have to be."""
        excess = self.excess(unknowns)
        if not excess > 0:
            return self.length(unknowns)
        points = zip(self.sequence, self.points(unknowns), strict=True)
        moved = sum(float(np.linalg.norm(side)) for c, x in points for side in c.slopes(x))
        return self.length(unknowns) + 2 * excess * moved

    def judged(self, unknowns: Array) -> list[int]:
        """Containment of each leg in its domain, see :mod:`hsdsl.analysis.metrics.guard_clearance`."""
        if not np.all(np.isfinite(unknowns)):
            return [OUTSIDE]
        legs = self.legs(unknowns)
        return [int(segments_inside(self.space, mode, a[None], b[None])[0]) for mode, a, b in legs]


def beyond(space: Space, mode: int, a: Array, b: Array) -> float:
    """How far a straight piece is seen to leave its domain."""
    at = [a + share * (b - a) for share in SHARES]
    return max((f(x) for f in space.domains[mode].curved for x in at), default=0.0)


def _farthest(off: Array, slopes: Array) -> float:
    """The way to where functions that are ``off`` are not, along their steepest slopes."""
    with np.errstate(all="ignore"):
        return float(np.max(np.where(off > 0, off / np.linalg.norm(slopes, axis=1), 0.0)))
