"""How far a point is at least from the guards and images of its mode: every path with a passage goes to one.

A function that is r at a point and whose gradient is at most G in the box of half width R around it has no zero nearer
than R while R G <= |r|. Enclosures give G.
"""

from __future__ import annotations

import numpy as np

from hsdsl.enclosures import Array
from hsdsl.metrics.formulas import Formula
from hsdsl.metrics.geometry import Passage, Space
from hsdsl.metrics.line import interval_of
from hsdsl.metrics.rounding import UNIT, norm

HALVINGS = 12
FARTHEST = 1e6  # times the points' size: no bound beyond it is looked for where a gradient vanishes
ROUNDING = 4 * UNIT
ROUNDINGS = 32  # in one coordinate, more than those of the few products that make it


def to_passages(space: Space, mode: int, x: Array) -> Array:
    """For points of a mode, (B, n), the least distance to where any passage begins or ends there; inf without any."""
    nearest = np.full(len(x), np.inf)
    for passage in space.passages:
        if passage.source == mode:
            nearest = np.minimum(nearest, to_entry(passage, x))
    for gate in space.curved_gates:
        if gate.source == mode:
            nearest = np.minimum(nearest, to_zeros(gate.surface, x))
        if gate.target == mode:
            nearest = np.minimum(nearest, to_zeros(gate.marks, x))
    return nearest


def to_zeros(formula: Formula, x: Array) -> Array:
    """A lower bound on the distance from points to where all of a formula's functions are 0."""
    below, above = formula.ranges(x, x)
    nearest = np.zeros(len(x))
    for k in range(below.shape[1]):
        size = np.maximum(np.maximum(below[:, k], -above[:, k]), 0.0)
        nearest = np.maximum(nearest, _free(formula, k, x, size))
    return nearest


def _free(formula: Formula, k: int, x: Array, size: Array) -> Array:
    """The largest half width found in whose box a function that is ``size`` at x has no zero."""
    near = np.zeros(len(x))
    with np.errstate(all="ignore"):
        cap = FARTHEST * (float(np.abs(x).max(initial=0.0)) or 1.0)
        far = np.fmin(size / _steepest(formula, k, x, near), cap)
        for n in range(HALVINGS):
            tried = far if n == 0 else (near + far) / 2
            free = tried * _steepest(formula, k, x, tried) * (1 + ROUNDING) <= size
            near, far = np.where(free, tried, near), np.where(free, far, tried)
    return near


def _steepest(formula: Formula, k: int, x: Array, half_width: Array) -> Array:
    """A bound on the length of the gradient in boxes."""
    low, high = x - half_width[:, None], x + half_width[:, None]
    below, above = formula.slopes(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))
    largest = np.maximum(np.abs(below[:, k]), np.abs(above[:, k]))
    return np.sqrt(np.sum(largest**2, axis=1)) * (1 + (x.shape[1] + 4) * ROUNDING)


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
