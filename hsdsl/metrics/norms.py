"""Sums of Euclidean norms over a polyhedron, minimised for many offsets at once.

A primal-dual interior-point method (Andersen, Christiansen, Conn, Overton, "An efficient primal-dual interior-point
method for minimizing a sum of Euclidean norms", SIAM J. Sci. Comput. 22, 2000), with inequalities
added: Newton's method on

    sum M_i' y_i + C' w = 0,   r_i y_i = M_i s + o_i,   (d - C s) w = mu,   r_i^2 = |M_i s + o_i|^2 + mu^2

as mu goes to 0. Whatever it returns is judged afterwards, as a feasible path and as a feasible dual.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from hsdsl.metrics.gate_sequence import Shape
from hsdsl.metrics.geometry import Array
from hsdsl.metrics.rounding import brought_inside, charge, lengths, norm, proved_above, proved_below

ITERATIONS = 50
GAP = 1e-11
REACH = 0.98  # of the way to the boundary


@dataclass(frozen=True, eq=False)
class Family:
    """Problems of one shape that differ in offsets and levels."""

    shape: Shape
    offsets: list[Array]  # (B, n_i)
    levels: Array  # (B, m)

    def legs(self, s: Array) -> list[Array]:
        """The vectors whose norms are summed, for s (B, N)."""
        return [s @ m.T + o for m, o in zip(self.shape.matrices, self.offsets, strict=True)]


def minimise(shape: Shape, offsets: list[Array], numbers: Array) -> tuple[Array, Array, Array]:
    """Minimise ``sum_i |matrices[i] s + offsets[i]|`` where ``normals s <= levels``, for B problems.

    Parameters
    ----------
    shape : Shape
        What they share.
    offsets : list of (B, n_i) arrays
    numbers : (B,) array
        The size of the numbers that the offsets are made of.

    Returns
    -------
    lower, upper : (B,) arrays
        Between which the minima lie; see :mod:`hsdsl.metrics.rounding`.
    s : (B, N) array
        Where ``upper`` is attained.
    """
    count = len(numbers)
    center = -np.hstack(offsets) @ shape.back.T
    lower, upper, best = np.zeros(count), np.full(count, np.inf), center
    start = brought_inside(shape, center)[0]
    unit = np.maximum(lengths(shape, offsets, start), charge(shape, numbers, norm(start)) + 1e-300)
    todo = np.arange(count)
    for _ in range(2):
        some = [o[todo] for o in offsets]
        s, vectors, weights = _around(shape, some, center[todo], unit[todo])
        s, inside = brought_inside(shape, s)
        value = proved_above(shape, some, numbers[todo], s, inside)
        below = proved_below(shape, some, numbers[todo], s, vectors, weights)
        lower[todo] = np.maximum(lower[todo], below)
        better = value < upper[todo]
        best = best.copy()
        best[todo[better]], upper[todo[better]] = s[better], value[better]
        rounding = 2 * charge(shape, numbers, norm(best))
        todo = np.flatnonzero(upper - lower > np.maximum(10 * GAP * upper, rounding))
        if not todo.size:
            break
        center, unit = best, np.where(np.isfinite(upper), np.maximum(upper, rounding), unit)
    return lower, upper, best


def _around(shape: Shape, offsets: list[Array], center: Array, unit: Array) -> tuple[Array, Array, Array]:
    """Solve in ``s = center + unit sigma``; returns proposals for the unknowns and for the dual."""
    scaled = Family(
        shape,
        [(center @ m.T + o) / unit[:, None] for m, o in zip(shape.matrices, offsets, strict=True)],
        (shape.levels - center @ shape.normals.T) / unit[:, None],
    )
    sigma, vectors, weights = _newton(scaled)
    return np.nan_to_num(center + unit[:, None] * sigma), np.hstack(vectors), weights


def _newton(family: Family) -> tuple[Array, list[Array], Array]:
    count, size = len(family.levels), family.shape.normals.shape[1]
    terms = len(family.shape.matrices) + family.shape.normals.shape[0]
    s = np.zeros((count, size))
    slack = np.maximum(family.levels, 1.0)
    vectors, weights = [0.5 * u / (1 + norm(u))[:, None] for u in family.legs(s)], np.full_like(slack, 0.5)
    mu = np.full(count, 0.5)
    for _ in range(ITERATIONS):
        legs = family.legs(s)
        missing = family.levels - s @ family.shape.normals.T - slack
        gap = sum(
            (norm(u) - np.einsum("bi,bi->b", y, u) for u, y in zip(legs, vectors, strict=True)),
            np.einsum("bj,bj->b", slack, weights),
        )
        wrong = np.abs(missing).max(axis=1, initial=0)
        if np.all((gap <= GAP * (1e-3 + sum(map(norm, legs)))) & (wrong <= GAP)):
            break
        mu = np.clip(np.maximum(gap, 0) / terms * 0.1, mu * 1e-2, mu)
        mu = np.maximum(mu, 1e-14)
        ds, dslack, dvectors, dweights = _direction(family, legs, slack, missing, vectors, weights, mu)
        primal = _room(slack, dslack)
        dual = np.minimum(_room(weights, dweights), _room_in_balls(vectors, dvectors))
        s = s + primal[:, None] * ds
        slack = slack + primal[:, None] * dslack
        vectors = [y + dual[:, None] * dy for y, dy in zip(vectors, dvectors, strict=True)]
        weights = weights + dual[:, None] * dweights
    return s, vectors, weights


def _direction(
    family: Family, legs: list[Array], slack: Array, missing: Array, vectors: list[Array], weights: Array, mu: Array
) -> tuple[Array, Array, list[Array], Array]:
    """Newton's step for s, slack, y and w."""
    size = family.shape.normals.shape[1]
    ratio = weights / slack
    matrix = np.einsum("ja,bj,jc->bac", family.shape.normals, ratio, family.shape.normals)
    right = ((mu[:, None] - weights * missing) / slack) @ family.shape.normals
    radii = [np.sqrt(np.einsum("bi,bi->b", u, u) + mu * mu) for u in legs]
    for m, u, y, r in zip(family.shape.matrices, legs, vectors, radii, strict=True):
        across = (y @ m), (u @ m) / r[:, None]
        mixed = across[0][:, :, None] * across[1][:, None, :]
        matrix += ((m.T @ m)[None] - 0.5 * (mixed + mixed.transpose(0, 2, 1))) / r[:, None, None]
        right += (u / r[:, None]) @ m
    floor = 1e-15 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] + 1e-300
    matrix += floor * np.eye(size)
    ds = cast(Array, np.linalg.solve(matrix, -right[:, :, None]))[:, :, 0]
    dslack = missing - ds @ family.shape.normals.T
    dvectors: list[Array] = []
    for m, u, y, r in zip(family.shape.matrices, legs, vectors, radii, strict=True):
        du = ds @ m.T
        both = np.einsum("bi,bi->b", u, du)[:, None] * y + np.einsum("bi,bi->b", y, du)[:, None] * u
        dvectors.append((u + du - both / (2 * r[:, None])) / r[:, None] - y)
    return ds, dslack, dvectors, (mu[:, None] - weights * dslack) / slack - weights


def _room(values: Array, steps: Array) -> Array:
    """The part of a step that keeps values positive."""
    falling = steps < 0
    share = -values / np.where(falling, steps, -1.0)
    return np.minimum(1.0, REACH * np.where(falling, share, np.inf).min(axis=1, initial=np.inf))


def _room_in_balls(vectors: list[Array], steps: list[Array]) -> Array:
    """The part of a step that keeps every y inside the unit ball."""
    room = np.full(len(vectors[0]), np.inf)
    for y, dy in zip(vectors, steps, strict=True):
        a, b = np.einsum("bi,bi->b", dy, dy), np.einsum("bi,bi->b", y, dy)
        c = np.maximum(1 - np.einsum("bi,bi->b", y, y), 0)
        root = np.sqrt(b * b + a * c)
        inwards, outwards = (root - b) / np.maximum(a, 1e-300), c / np.maximum(np.abs(b) + root, 1e-300)
        room = np.minimum(room, cast(Array, np.where(b > 0, outwards, inwards)))
    return np.minimum(1.0, REACH * room)
