"""Domains and guards that are not affine, by enclosures: what straight pieces keep, and how far guards are.

Many straight pieces at once are judged. Every path with a passage goes to a guard or an image of its mode: a function
that is r at a point and whose gradient is at most G in the box of half width R around it has no zero nearer than R
while R G <= |r|. Enclosures give G.
"""

from __future__ import annotations

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import interval_of, norm
from hsdsl.analysis.metrics.geometry import TOLERANCE, Formula, Passage, Space
from hsdsl.base.numbers.bernstein import UNIT, Array

HALVINGS = 12
FARTHEST = 1e6  # times the points' size: no bound beyond it is looked for where a gradient vanishes
ROUNDING = 4 * UNIT
ROUNDINGS = 32  # in one coordinate, more than those of the few products that make it
KEPT = 32 * 2.0**-53  # of the points' size: within it an inequality counts as kept
CUTS = 24
MOST_PARTS = 64  # of one piece that are undecided at one time
SAMPLES = 16  # of a piece that enclosures do not decide

OUTSIDE, UNDECIDED, CERTAIN = 0, 1, 2


def segments_inside(space: Space, mode: int, a: Array, b: Array) -> Array:
    """Judge the straight pieces from a to b, (B, n) arrays of points of one mode.

    ``CERTAIN`` where every inequality holds all along, ``OUTSIDE`` where one does not, ``UNDECIDED`` where none is
    broken in ``SAMPLES`` places and enclosures are too wide for a proof. No place has to keep an inequality better than
    the ends.
    """
    verdict = np.full(len(a), CERTAIN)
    for formula in space.domains[mode].curved:
        x = np.vstack([a, b])
        below, above = formula.slopes(x, x)
        steepest = np.maximum(np.abs(below[:, 0]), np.abs(above[:, 0])).sum(axis=1)
        moved = steepest * np.abs(x).max(axis=1, initial=0.0)  # how much the size of the point makes
        moved = np.where(np.isfinite(moved), moved, 0.0)
        beyond = np.nan_to_num(formula.ranges(x, x)[1][:, 0], nan=0.0, neginf=0.0, posinf=0.0)
        tolerance = np.clip(beyond, KEPT * moved, TOLERANCE * moved).reshape(2, len(a)).max(axis=0)
        verdict = np.minimum(verdict, _below(formula, a, b, tolerance))
    return verdict


def _below(formula: Formula, a: Array, b: Array, tolerance: Array) -> Array:
    """Judge ``formula <= tolerance`` along pieces: parts are halved until proved or seen to be wrong."""
    verdict = np.full(len(a), CERTAIN)
    piece, begin, end = np.arange(len(a)), np.zeros(len(a)), np.ones(len(a))
    for _ in range(CUTS):
        bound, seen = _largest(formula, a[piece], b[piece], begin, end)
        verdict[piece[seen > tolerance[piece]]] = OUTSIDE
        open_ = ~(bound <= tolerance[piece]) & (verdict[piece] == CERTAIN)
        piece, begin, end = piece[open_], begin[open_], end[open_]
        if not len(piece):
            return verdict
        crowded = np.bincount(piece, minlength=len(a)) > MOST_PARTS
        verdict[crowded] = UNDECIDED
        kept = ~crowded[piece]
        piece, begin, end = piece[kept], begin[kept], end[kept]
        middle = (begin + end) / 2
        piece, begin, end = np.tile(piece, 2), np.append(begin, middle), np.append(middle, end)
    verdict[np.unique(piece)] = UNDECIDED
    for k in np.flatnonzero(verdict == UNDECIDED).tolist():
        for share in np.linspace(0, 1, SAMPLES + 1).tolist():
            if not formula(a[k] + share * (b[k] - a[k])) <= tolerance[k]:
                verdict[k] = OUTSIDE
    return verdict


def _largest(formula: Formula, a: Array, b: Array, begin: Array, end: Array) -> tuple[Array, Array]:
    """A bound on the largest value on parts of pieces, and the largest value seen at their ends.

    By the mean value theorem from either end, or by the values' own enclosure.
    """
    way = b - a
    first, last = a + begin[:, None] * way, a + end[:, None] * way
    low, high = np.minimum(first, last), np.maximum(first, last)
    below, above = formula.slopes(low, high)
    step = (end - begin)[:, None] * way
    with np.errstate(invalid="ignore"):
        rise = _sum(np.maximum(below[:, 0] * step, above[:, 0] * step), np.inf)
        fall = _sum(np.minimum(below[:, 0] * step, above[:, 0] * step), -np.inf)
    at_first, at_last = (formula.ranges(x, x)[1][:, 0] for x in (first, last))
    whole = formula.ranges(low, high)[1][:, 0]
    bound = np.minimum(whole, np.minimum(at_first + np.maximum(rise, 0), at_last + np.maximum(-fall, 0)))
    seen = np.maximum(*(formula.ranges(x, x)[0][:, 0] for x in (first, last)))
    return bound, seen


def highest(formula: Formula, low: Array, high: Array) -> Array:
    """A bound on the first function's values in boxes: its enclosure, or by its slopes from the middle."""
    middle, half = (low + high) / 2, (high - low) / 2
    below, above = formula.slopes(low, high)
    with np.errstate(invalid="ignore"):
        change = _sum(np.maximum(np.abs(below[:, 0]), np.abs(above[:, 0])) * half, np.inf)
    return np.minimum(formula.ranges(low, high)[1][:, 0], formula.ranges(middle, middle)[1][:, 0] + change)


def _sum(products: Array, unknown: float) -> Array:
    """The sum of each row; ``unknown`` where a coordinate stays and its slope has no bound, or two have none."""
    total = products.sum(axis=1)
    return np.where(np.isnan(total), unknown, total)


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
        near = np.zeros(len(x))
        with np.errstate(all="ignore"):
            cap = FARTHEST * (float(np.abs(x).max(initial=0.0)) or 1.0)
            far = np.fmin(size / _steepest(formula, k, x, near), cap)
            for n in range(HALVINGS):
                tried = far if n == 0 else (near + far) / 2
                free = tried * _steepest(formula, k, x, tried) * (1 + ROUNDING) <= size
                near, far = np.where(free, tried, near), np.where(free, far, tried)
        nearest = np.maximum(nearest, near)
    return nearest


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


def _to_side(passage: Passage, side: Array, across: tuple[Array, Array], points: Array) -> Array:
    """Less than rounding from exact on guards of at most one dimension, else to the whole plane."""
    base, frame = side[:, 0], side[:, 1:]
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
