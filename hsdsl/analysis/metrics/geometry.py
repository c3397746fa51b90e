"""Domains, guards and passages as float64 geometry, made in rational numbers and rounded once.

A domain is a polyhedron, a guard a polyhedron inside a plane of its mode, a reset an affine map: exact for models whose
surfaces, conditions and resets are affine. What is not affine stands beside it as a `Formula` that is at most 0 where
the point is allowed, so that the polyhedra contain the sets they stand for: lower bounds stay valid.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.base.numbers.bernstein import UNIT, Array
from hsdsl.base.numbers.enclosures import ENCLOSED, as_range, hull
from hsdsl.base.numbers.rational import Exact, about, after, axes, deepest, matrix, maximise, orthogonal, plane, zeros
from hsdsl.engine.backends.python import compile_routines
from hsdsl.mathematics.program import Routines

T = TypeVar("T")
TOLERANCE = 1e-9  # how far beyond a surface a point still counts as on it, relative to the size of the points


@dataclass(frozen=True, eq=False)
class Domain:
    """A mode's domain: ``normals @ x <= levels`` (m unit rows of n) and ``curved(x) <= 0``.

    ``rows`` (m, n + 1) are the inequalities without rounding, see :mod:`hsdsl.base.numbers.rational`.
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
        worst = max(range(len(beyond)), key=lambda k: np.inf if np.isnan(beyond[k]) else beyond[k], default=None)
        return (0.0, None) if worst is None else (beyond[worst], self.texts[worst])


def _beyond(formula: Formula, x: Array) -> float:
    value = formula(x)
    slope = float(np.linalg.norm(formula.gradient(x))) if value > 0 else 1.0
    return value / slope if slope > 0 else value * np.inf


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
        exact = self.exact._replace(rows=self.exact.rows[:0])
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


class ExactGate(NamedTuple):
    """A gate in rational numbers: guard and image as maps of s (base, then frame), the inequalities, and ``inner``."""

    sides: tuple[Exact, Exact]
    rows: Exact
    inner: Exact


class CurvedGate(NamedTuple):
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

    def remembered(self, key: Any, work: Callable[[], T]) -> T:
        """What was worked out under a key, once for a space."""
        if key not in self.cache:
            self.cache[key] = work()
        return self.cache[key]

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


Boxes = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Formula:
    """m functions of n coordinates, and their derivatives.

    ``value`` maps (n,) to (m,), NaN outside the functions' real domain, and ``jacobian`` to (m, n). ``ranges`` and
    ``slopes`` bound both over boxes, given by corners of shape (B, n): (B, m) and (B, m, n). Slopes bound difference
    quotients where functions have kinks, and are unbounded where functions may jump.
    """

    value: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]
    ranges: Boxes
    slopes: Boxes

    def __call__(self, x: Array) -> float:
        """The first function's value."""
        return float(self.value(x)[0])

    def gradient(self, x: Array) -> Array:
        """The first function's derivatives."""
        return self.jacobian(x)[0]


def affine(matrix: Array, constant: Array) -> Formula:
    """``matrix @ x + constant``."""
    positive, negative = np.maximum(matrix, 0.0), np.minimum(matrix, 0.0)

    def ranges(low: Array, high: Array) -> tuple[Array, Array]:
        below = low @ positive.T + high @ negative.T + constant
        above = high @ positive.T + low @ negative.T + constant
        largest = np.maximum(np.abs(low), np.abs(high))
        sizes = (matrix.shape[1] + 4) * UNIT * (largest @ np.abs(matrix).T + np.abs(constant))
        return below - sizes, above + sizes

    def slopes(low: Array, _: Array) -> tuple[Array, Array]:
        same = np.broadcast_to(matrix, (len(low), *matrix.shape))
        return same, same

    return Formula(lambda x: matrix @ x + constant, lambda _: matrix, ranges, slopes)


def compiled(text: Routines, shape: tuple[int, int], jumps: bool) -> Formula:
    """A formula of m functions of n coordinates from routines ``value`` and ``jacobian`` (row by row) over x0, x1, ...

    Where functions may jump, derivatives say nothing of differences.
    """
    value, jacobian = compile_routines(text, FLOAT64, "geometry")()
    over: list[Callable[..., Sequence[Any]]] = []

    def enclosed(k: int, low: Array, high: Array, size: tuple[int, ...]) -> tuple[Array, Array]:
        if not over:  # compiled at the first use
            over.extend(compile_routines(text, ENCLOSED, "geometry over boxes")())
        with np.errstate(all="ignore"):
            found = [as_range(r) for r in over[k](*hull(low, high))]
        ends = ([np.broadcast_to(getattr(r, end), len(low)) for r in found] for end in ("low", "high"))
        flat, whole = (len(found), len(low)), (len(low), *size)  # also where there are no boxes
        below, above = (np.array(end, dtype=float).reshape(flat).T.reshape(whole) for end in ends)
        return below, above

    def slopes(low: Array, high: Array) -> tuple[Array, Array]:
        if jumps:
            return np.full((len(low), *shape), -np.inf), np.full((len(low), *shape), np.inf)
        return enclosed(1, low, high, shape)

    return Formula(
        lambda x: _at(value, x, (shape[0],)),
        lambda x: _at(jacobian, x, shape),
        lambda low, high: enclosed(0, low, high, (shape[0],)),
        slopes,
    )


def _at(routine: Callable[..., Sequence[float]], x: Array, shape: tuple[int, ...]) -> Array:
    try:
        return np.array(routine(*x.tolist()), dtype=float).reshape(shape)
    except DOMAIN_ERRORS:
        return np.full(shape, np.nan)


def stacked(parts: Sequence[Formula]) -> Formula:
    """Several formulas of the same coordinates as one, one below the other."""

    def boxes(kind: str) -> Boxes:
        def over(low: Array, high: Array) -> tuple[Array, Array]:
            found = [getattr(part, kind)(low, high) for part in parts]
            return np.concatenate([f[0] for f in found], axis=1), np.concatenate([f[1] for f in found], axis=1)

        return over

    return Formula(
        lambda x: np.concatenate([part.value(x) for part in parts]),
        lambda x: np.vstack([part.jacobian(x) for part in parts]),
        boxes("ranges"),
        boxes("slopes"),
    )


def gate_of(
    edge: str,
    modes: tuple[int, int],
    surface: Exact,
    inequalities: Exact,
    reset: Exact,
    image: Exact,
    curved: tuple[Formula, ...],
) -> Gate | None:
    """A guard as a gate, None where it is empty.

    The affine function ``surface`` is 0 on it, and ``inequalities`` are at most 0; so are those of ``image`` in the
    domain that the affine ``reset`` leads into. ``curved`` are conditions that are not affine.
    """
    if not surface[1:].any():
        return None
    rows = dict.fromkeys(tuple[Fraction, ...](row) for row in (*inequalities, *after(image, reset)))
    found = _polyhedron(surface[None], matrix(rows, len(surface)))
    if found is None:
        return None
    side, rows, inner = found
    return _rounded(edge, modes, ExactGate((side, after(reset, side)), rows, inner), curved)


def _polyhedron(equations: Exact, inequalities: Exact) -> tuple[Exact, Exact, Exact] | None:
    """The smallest plane that holds a polyhedron, what is left of the rows in its coordinates, and a point inside."""
    while (side := plane(equations)) is not None:
        rows = after(inequalities, side)
        sloped = (rows[:, 1:] != 0).any(axis=1)
        if (rows[~sloped, 0] > 0).any():
            return None
        rows, own = rows[sloped], inequalities[sloped]
        if not len(rows):
            return side, rows, zeros(side.shape[1] - 1)
        depth, inner, weights = deepest(rows)
        if depth < 0:
            return None
        if depth > 0:
            return side, rows, inner
        equations = np.vstack([equations, own[weights > 0]])
    return None


def _rounded(edge: str, modes: tuple[int, int], exact: ExactGate, curved: tuple[Formula, ...]) -> Gate:
    normals, levels = unit_rows(exact.rows)
    inner = exact.inner.astype(float)
    depths = -exact.rows[:, 0] - exact.rows[:, 1:] @ np.array([Fraction(v) for v in inner.tolist()], dtype=object)
    room = np.array([float(depth / about(row[1:])) for depth, row in zip(depths, exact.rows, strict=True)])
    guard, image = exact.sides
    sides, across = (guard.astype(float), image.astype(float)), (_across(guard), _across(image))
    return Gate(edge, *modes, sides, normals, levels, inner, room, across, exact, curved)


def unit_rows(rows: Iterable[Exact]) -> tuple[Array, Array]:
    """Inequalities as float normals and levels, each divided by its length; one without a direction by its level."""
    rows = np.asarray(rows)
    lengths = [about(row[1:]) or abs(row[0]) or Fraction(1) for row in rows]
    scaled = np.array([row / length for row, length in zip(rows, lengths, strict=True)], dtype=float).reshape(
        rows.shape
    )
    return scaled[:, 1:], -scaled[:, 0]


def _across(side: Exact) -> tuple[Array, Array]:
    """Unit vectors orthogonal to a plane, and their products with its points."""
    size = len(side)
    found = orthogonal(axes(size), orthogonal(side[:, 1:].T))
    return unit_rows(matrix(([-(v @ side[:, 0]), *v] for v in found), size + 1))
