"""What rounding does to the two ends of a distance: charges that both pay, so that they hold for the exact numbers.

Floats stand for a model's exact numbers, each rounded once. A path is made to keep its inequalities by more than that,
and pays for what its guard points may be off. A bound from below holds for the exact legs and rows, wherever the
unknowns of a path as short as the one at hand can be.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hsdsl.analysis.metrics.gate_sequence import ConeShape
    from hsdsl.base.numbers.enclosures import Array

UNIT = 2.0**-53
ROUNDS = 20  # of moving points onto the inequality that is broken most


def norm(rows: Array) -> Array:
    """Euclidean norms of rows."""
    if rows.shape[1] == 2:
        return np.hypot(rows[:, 0], rows[:, 1])
    return np.sqrt(np.einsum("bi,bi->b", rows, rows))


def lengths(shape: ConeShape, offsets: Array, s: Array) -> Array:
    """The lengths of B paths at unknowns s, shape (B, N), to rounding."""
    legs = s @ shape.stacked.T + offsets
    return sum((norm(legs[:, part]) for part in shape.parts), np.zeros(len(s)))


def charge(shape: ConeShape, numbers: Array, far: Array) -> Array:
    """What the legs' rounding amounts to, for unknowns whose vectors are as long as ``far``."""
    return shape.operations * UNIT * (numbers + shape.spread * far)


def brought_inside(shape: ConeShape, s: Array) -> tuple[Array, Array]:
    """Move points to where all exact inequalities hold, and say which got there.

    First onto the inequality that is broken most, again and again; what is left goes towards the inner point.
    """
    normals, levels = shape.normals, shape.levels
    if not len(levels):
        return s, np.ones(len(s), dtype=bool)
    beyond = _beyond(shape, s)
    for _ in range(ROUNDS):
        out = np.flatnonzero(beyond.max(axis=1) > 0)
        if not out.size:
            return s, np.ones(len(s), dtype=bool)
        worst = np.argmax(beyond[out], axis=1)
        s = s.copy()
        # Twice the margin, else it would be broken again by rounding.
        over = beyond[out, worst] + _margin(shape, s[out])[np.arange(len(out)), worst]
        s[out] -= over[:, None] * normals[worst]
        beyond = _beyond(shape, s)
    if shape.inner is not None and shape.room is not None:
        over = np.where(beyond > 0, beyond + _margin(shape, s), 0.0)  # twice the margin, as above
        room = np.maximum(shape.room - _margin(shape, shape.inner[None]), 1e-300)
        share = np.minimum(1.0, (1 + 1e-9) * (over / (over + room)).max(axis=1))
        s = s + share[:, None] * (shape.inner - s)
        beyond = _beyond(shape, s)
    return s, beyond.max(axis=1) <= 0


def _beyond(shape: ConeShape, s: Array) -> Array:
    return s @ shape.normals.T - shape.levels + _margin(shape, s)


def _margin(shape: ConeShape, s: Array) -> Array:
    return shape.operations * UNIT * (norm(s)[:, None] + np.abs(shape.levels))


def proved_above(shape: ConeShape, offsets: Array, numbers: Array, s: Array, inside: Array) -> Array:
    """The lengths of paths, charged; infinite for those that are not inside."""
    value = lengths(shape, offsets, s)
    above = value * (1 + shape.operations * UNIT) + charge(shape, numbers, norm(s))
    return np.where(inside, above, np.inf)


def proved_below(shape: ConeShape, offsets: Array, numbers: Array, s: Array, vectors: Array, weights: Array) -> Array:
    """Lower bounds on the minima from proposals for a dual: a unit vector y for each leg, a weight w for each row.

    For any unknowns s' of a path no longer than that at s, with the legs u at s and the residual ``r = M'y + C'w``,

        sum |M s' + o| >= y u - w (d - C s) + r (s' - s),

    and s' is not far from s: the legs of both are known to be short. Longer paths are longer than that at s.
    """
    weights = np.maximum(np.nan_to_num(weights), 0.0)
    flat = np.nan_to_num(vectors)
    for _ in range(2):
        flat = flat - (flat @ shape.stacked + weights @ shape.normals) @ shape.back
    longest = np.max([norm(flat[:, where]) for where in shape.parts], axis=0)
    shrink = (1 - shape.operations * UNIT) / np.maximum(1.0, longest)
    flat, weights = flat * shrink[:, None], weights * shrink[:, None]
    value = np.einsum("bi,bi->b", flat, s @ shape.stacked.T + offsets)
    value -= np.einsum("bj,bj->b", weights, shape.levels - s @ shape.normals.T)
    longest_path, far = lengths(shape, offsets, s), norm(s)
    if np.all(value <= charge(shape, numbers, far)):  # nothing is left of it, wherever the unknowns may be
        return np.zeros(len(value))
    near = _reach(shape, numbers, longest_path, far)
    heavy = weights.sum(axis=1)
    residual = norm(flat @ shape.stacked + weights @ shape.normals)
    with np.errstate(invalid="ignore"):  # nothing times an unbounded reach: no bound
        rounding = charge(shape, numbers, far + near) + residual * near
        rounding += shape.operations * UNIT * (heavy * (far + near) + weights @ np.abs(shape.levels))
        value = np.nan_to_num(value - rounding)
    return np.maximum(0.0, np.minimum(value, longest_path * (1 - shape.operations * UNIT)))


def _reach(shape: ConeShape, numbers: Array, length: Array, far: Array) -> Array:
    """How far from s the unknowns of a path can be that is no longer than the one at s."""
    if shape.least > 0:
        return (2 * length + charge(shape, numbers, far)) * (1 + 1e-9) / shape.least
    return shape.radius + far
