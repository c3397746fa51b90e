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
from numpy.typing import NDArray

from hsdsl.metrics.geometry import Array

ITERATIONS = 50
GAP = 1e-11
REACH = 0.98  # of the way to the boundary


@dataclass(frozen=True, eq=False)
class Family:
    """Problems that share ``matrices`` (n_i of N) and ``normals`` (m of N) and differ in offsets and levels."""

    matrices: list[Array]
    offsets: list[Array]  # (B, n_i)
    normals: Array
    levels: Array  # (B, m)

    def legs(self, s: Array) -> list[Array]:
        """The vectors whose norms are summed, for s (B, N)."""
        return [s @ m.T + o for m, o in zip(self.matrices, self.offsets, strict=True)]

    def lengths(self, s: Array) -> Array:
        """The sums of norms."""
        return sum((_norm(u) for u in self.legs(s)), np.zeros(len(s)))


def minimise(matrices: list[Array], offsets: list[Array], normals: Array, levels: Array) -> tuple[Array, Array, Array]:
    """Minimise ``sum_i |matrices[i] s + offsets[i]|`` where ``normals s <= levels``, for B problems.

    Parameters
    ----------
    matrices : list of (n_i, N) arrays
    offsets : list of (B, n_i) arrays
    normals : (m, N) array of unit rows
    levels : (m,) array

    Returns
    -------
    lower, upper : (B,) arrays
        Between which the minima lie, up to round-off.
    s : (B, N) array
        Where ``upper`` is attained.
    """
    stacked, joined = np.vstack(matrices), np.hstack(offsets)
    center = -joined @ np.linalg.pinv(stacked).T
    whole = Family(matrices, offsets, normals, np.broadcast_to(levels, (len(joined), len(levels))))
    sizes = 1e-15 * (np.abs(joined).max(axis=1, initial=0) + np.abs(levels).max(initial=0)) + 1e-300
    lower, upper, best = np.zeros(len(joined)), np.full(len(joined), np.inf), center
    unit = np.maximum(whole.lengths(_inside(normals, whole.levels, center)), sizes)
    for _ in range(2):
        todo = np.flatnonzero(upper - lower > np.maximum(10 * GAP * upper, sizes)) if _ else np.arange(len(joined))
        if not todo.size:
            break
        below, s = _around(whole, todo, center[todo], unit[todo])
        s = _inside(normals, whole.levels[todo], s)
        value = sum((_norm(s @ m.T + o[todo]) for m, o in zip(matrices, offsets, strict=True)), np.zeros(len(todo)))
        lower[todo] = np.fmax(lower[todo], below)
        better = value < upper[todo]
        best = best.copy()
        best[todo[better]], upper[todo[better]] = s[better], value[better]
        center, unit = best, np.maximum(upper, sizes)
    return np.minimum(lower, upper), upper, best


def _around(whole: Family, todo: NDArray[np.intp], center: Array, unit: Array) -> tuple[Array, Array]:
    """Solve in ``s = center + unit sigma``; returns lower bounds and proposals."""
    scaled = Family(
        whole.matrices,
        [(center @ m.T + o[todo]) / unit[:, None] for m, o in zip(whole.matrices, whole.offsets, strict=True)],
        whole.normals,
        (whole.levels[todo] - center @ whole.normals.T) / unit[:, None],
    )
    sigma, vectors, weights = _newton(scaled)
    return unit * dual_values(scaled, vectors, weights), center + unit[:, None] * sigma


def _newton(family: Family) -> tuple[Array, list[Array], Array]:
    count, size = len(family.levels), family.normals.shape[1]
    terms = len(family.matrices) + family.normals.shape[0]
    s = np.zeros((count, size))
    slack = np.maximum(family.levels, 1.0)
    vectors, weights = [0.5 * u / (1 + _norm(u))[:, None] for u in family.legs(s)], np.full_like(slack, 0.5)
    mu = np.full(count, 0.5)
    for _ in range(ITERATIONS):
        legs = family.legs(s)
        missing = family.levels - s @ family.normals.T - slack
        gap = sum(
            (_norm(u) - np.einsum("bi,bi->b", y, u) for u, y in zip(legs, vectors, strict=True)),
            np.einsum("bj,bj->b", slack, weights),
        )
        wrong = np.abs(missing).max(axis=1, initial=0)
        if np.all((gap <= GAP * (1e-3 + family.lengths(s))) & (wrong <= GAP)):
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
    size = family.normals.shape[1]
    ratio = weights / slack
    matrix = np.einsum("ja,bj,jc->bac", family.normals, ratio, family.normals)
    right = ((mu[:, None] - weights * missing) / slack) @ family.normals
    radii = [np.sqrt(np.einsum("bi,bi->b", u, u) + mu * mu) for u in legs]
    for m, u, y, r in zip(family.matrices, legs, vectors, radii, strict=True):
        across = (y @ m), (u @ m) / r[:, None]
        mixed = across[0][:, :, None] * across[1][:, None, :]
        matrix += ((m.T @ m)[None] - 0.5 * (mixed + mixed.transpose(0, 2, 1))) / r[:, None, None]
        right += (u / r[:, None]) @ m
    floor = 1e-15 * np.trace(matrix, axis1=1, axis2=2)[:, None, None] + 1e-300
    matrix += floor * np.eye(size)
    ds = cast(Array, np.linalg.solve(matrix, -right[:, :, None]))[:, :, 0]
    dslack = missing - ds @ family.normals.T
    dvectors: list[Array] = []
    for m, u, y, r in zip(family.matrices, legs, vectors, radii, strict=True):
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


def dual_values(family: Family, vectors: list[Array], weights: Array) -> Array:
    """The values ``sum y o - w d`` of the feasible duals nearest to proposals, at least 0.

    y is moved so that ``M'y + C'w = 0`` and shrunk into the unit balls; what rounding leaves of the equation is charged
    with the unknowns' size.
    """
    stacked = np.vstack(family.matrices)
    back = np.linalg.pinv(stacked)
    weights = np.maximum(weights, 0)
    flat = np.hstack(vectors)
    for _ in range(2):
        flat = flat - (flat @ stacked + weights @ family.normals) @ back
    ends = np.cumsum([len(m) for m in family.matrices])[:-1]
    longest = np.max([_norm(part) for part in np.split(flat, ends, axis=1)], axis=0)
    residual = _norm(flat @ stacked + weights @ family.normals)
    value = np.einsum("bi,bi->b", flat, np.hstack(family.offsets)) - np.einsum("bj,bj->b", weights, family.levels)
    return np.nan_to_num(np.maximum(0, (value - 10 * residual) / np.maximum(1.0, longest)))


def _inside(normals: Array, levels: Array, s: Array) -> Array:
    """Move points that are outside back inside, one inequality after the other."""
    for _ in range(20):
        beyond = s @ normals.T - levels
        if not beyond.size or beyond.max() <= 0:
            break
        worst = np.argmax(beyond, axis=1)
        rows = np.arange(len(s))
        s = s - np.maximum(beyond[rows, worst], 0)[:, None] * normals[worst]
    return s


def _norm(u: Array) -> Array:
    return np.sqrt(np.einsum("bi,bi->b", u, u))
