"""How far points are at least from the sides of affine passages, many at once."""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.geometry import Array, Passage
from hsdsl.metrics.line import interval_of
from hsdsl.metrics.rounding import UNIT, norm

ROUNDINGS = 32  # in one coordinate, more than those of the few products that make it


def to_entry(passage: Passage, points: Array) -> Array:
    """A lower bound on the distance from points to where a passage is entered."""
    return _to_side(passage, passage.enter, passage.across[0], points)


def to_exit(passage: Passage, points: Array) -> Array:
    """A lower bound on the distance from points to where a passage is left."""
    return _to_side(passage, passage.leave, passage.across[1], points)


def _to_side(passage: Passage, side: tuple[Array, Array], across: tuple[Array, Array], points: Array) -> Array:
    """Less than rounding from exact on guards of at most one dimension, else to the whole plane."""
    base, frame = side
    gate = passage.gate
    if gate.size > 1:
        vectors, levels = across
        rounding = norm(points) + float(np.linalg.norm(levels))
        apart = norm(points @ vectors.T - levels)
    else:
        away, far = points - base, np.zeros(len(points))
        if gate.size == 1:
            low, high = interval_of(gate.normals, gate.levels)
            slope = frame[:, 0]
            square = float(slope @ slope)
            s = np.clip(away @ slope / square if square else far, low, high)
            far = np.abs(s) * np.sqrt(square)
            away = away - s[:, None] * slope
        rounding = norm(points) + float(np.linalg.norm(base)) + far
        apart = norm(away)
    return np.maximum(0.0, apart - (ROUNDINGS + points.shape[1]) * UNIT * rounding)
