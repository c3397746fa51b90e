"""Guards as polyhedra in the few coordinates they have: made in rational numbers, then rounded once."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from hsdsl.metrics.formulas import Formula
from hsdsl.metrics.geometry import Array, Exact, Gate
from hsdsl.metrics.rational import (
    ZERO,
    Plane,
    Row,
    Vector,
    about,
    axes,
    deepest,
    dot,
    orthogonal,
    plus,
    times,
)

Reset = tuple[tuple[Vector, ...], Vector]  # matrix by rows, and vector


def gate_of(
    edge: str,
    modes: tuple[int, int],
    surface: Row,
    inequalities: Sequence[Row],
    reset: Reset,
    image: Sequence[Row],
    curved: tuple[Formula, ...],
) -> Gate | None:
    """A guard as a gate, None where it is empty.

    ``surface`` is ``normal . x = level`` on it, ``inequalities`` hold besides, ``image`` holds in the domain that the
    affine reset leads into, and ``curved`` are conditions that are not affine.
    """
    if not any(surface[0]):
        return None
    matrix, offset = reset
    columns = list(zip(*matrix, strict=True)) or [()] * len(surface[0])
    pulled = [(times(columns, normal), level - dot(normal, offset)) for normal, level in image]
    found = _polyhedron(len(surface[0]), [surface], list(dict.fromkeys([*inequalities, *pulled])))
    if found is None:
        return None
    plane, frame, rows, inner = found
    sides = (
        (plane.point, tuple(frame)),
        (plus(times(matrix, plane.point), offset), tuple(times(matrix, f) for f in frame)),
    )
    return _rounded(edge, modes, Exact(sides, tuple(rows), inner), curved)


def _polyhedron(
    size: int, equations: list[Row], inequalities: list[Row]
) -> tuple[Plane, list[Vector], list[Row], Vector] | None:
    """The smallest plane that holds a polyhedron, its directions, what is left of the rows, and a point inside."""
    while True:
        plane = Plane(size, equations)
        if plane.empty:
            return None
        frame = plane.along()
        rows: list[Row] = []
        own: list[Row] = []
        for normal, level in inequalities:
            along, rest = times(frame, normal), level - dot(normal, plane.point)
            if any(along):
                rows.append((along, rest))
                own.append((normal, level))
            elif rest < 0:
                return None
        if not rows:
            return plane, frame, rows, (ZERO,) * len(frame)
        depth, inner, weights = deepest(rows)
        if depth < 0:
            return None
        if depth > 0:
            return plane, frame, rows, inner
        equations = [*equations, *(row for row, weight in zip(own, weights, strict=True) if weight > 0)]


def _rounded(edge: str, modes: tuple[int, int], exact: Exact, curved: tuple[Formula, ...]) -> Gate:
    normals, levels = unit_rows(exact.rows, len(exact.inner))
    (base, frame), (image_base, image_frame) = exact.sides
    inner = tuple(Fraction(float(v)) for v in exact.inner)
    room = [float((level - dot(normal, inner)) / about(normal)) for normal, level in exact.rows]
    own, image = ((floats(b), _columns(f, len(b))) for b, f in exact.sides)
    across = _across(base, frame), _across(image_base, image_frame)
    return Gate(edge, *modes, *own, *image, normals, levels, floats(inner), np.array(room), across, exact, curved)


def unit_rows(rows: Sequence[Row], size: int) -> tuple[Array, Array]:
    """Inequalities in floats, each divided by its length; one without a direction by its level."""
    lengths = [about(normal) or abs(level) or Fraction(1) for normal, level in rows]
    normals = [floats([v / length for v in normal]) for (normal, _), length in zip(rows, lengths, strict=True)]
    levels = [float(level / length) for (_, level), length in zip(rows, lengths, strict=True)]
    return np.array(normals).reshape(len(rows), size), np.array(levels)


def floats(x: Sequence[Fraction]) -> Array:
    """The nearest floats."""
    return np.array([float(v) for v in x])


def _columns(vectors: Sequence[Vector], size: int) -> Array:
    return np.array([floats(v) for v in vectors]).reshape(len(vectors), size).T.copy()


def _across(base: Vector, frame: Sequence[Vector]) -> tuple[Array, Array]:
    """Unit vectors orthogonal to a plane, and their products with its points."""
    found = orthogonal(axes(len(base)), orthogonal(frame))
    return unit_rows([(v, dot(v, base)) for v in found], len(base))
