"""How far points are from the sides of affine passages, many at once."""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.geometry import Array, Passage
from hsdsl.metrics.line import interval_of


def norms(x: Array) -> Array:
    """Euclidean norms of rows."""
    return np.hypot(x[:, 0], x[:, 1]) if x.shape[1] == 2 else np.sqrt(np.einsum("ij,ij->i", x, x))


def to_side(passage: Passage, side: tuple[Array, Array], points: Array) -> Array:
    """The distance from points to one side of a passage: exact on guards of one dimension, else to its whole plane."""
    base, frame = side
    gate = passage.gate
    if gate.size == 0:
        return norms(points - base)
    if gate.size == 1:
        low, high = interval_of(gate.normals, gate.levels)
        slope = frame[:, 0]
        square = float(slope @ slope)
        s = np.clip((points - base) @ slope / square if square else np.zeros(len(points)), low, high)
        return norms(points - base - s[:, None] * slope)
    away = points - base
    return norms(away - away @ np.linalg.pinv(frame).T @ frame.T)
