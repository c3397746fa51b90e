"""Guards as polyhedra in the few coordinates they have: made in rational numbers, then rounded once."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from hsdsl.analysis.metrics.formulas import Formula
from hsdsl.analysis.metrics.geometry import Array, ExactGate, Gate
from hsdsl.analysis.metrics.rational import Exact, about, after, axes, deepest, matrix, orthogonal, plane, zeros


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
