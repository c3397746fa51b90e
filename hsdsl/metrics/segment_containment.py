"""Whether straight pieces stay in a domain that is no polyhedron: certified by enclosures, many pieces at once."""

from __future__ import annotations

import numpy as np

from hsdsl.enclosures import Array
from hsdsl.metrics.formulas import Formula
from hsdsl.metrics.geometry import TOLERANCE, Space

ROUNDING = 32 * 2.0**-53  # of the points' size: within it an inequality counts as kept
HALVINGS = 24
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
        tolerance = _tolerance(formula, np.vstack([a, b])).reshape(2, len(a)).max(axis=0)
        verdict = np.minimum(verdict, _below(formula, a, b, tolerance))
    return verdict


def _tolerance(formula: Formula, x: Array) -> Array:
    """How far beyond an inequality points are, or may be by rounding."""
    below, above = formula.slopes(x, x)
    steepest = np.maximum(np.abs(below[:, 0]), np.abs(above[:, 0])).sum(axis=1)
    moved = steepest * np.abs(x).max(axis=1, initial=0.0)  # how much the size of the point makes
    moved = np.where(np.isfinite(moved), moved, 0.0)
    beyond = np.nan_to_num(formula.ranges(x, x)[1][:, 0], nan=0.0, neginf=0.0, posinf=0.0)
    return np.clip(beyond, ROUNDING * moved, TOLERANCE * moved)


def _below(formula: Formula, a: Array, b: Array, tolerance: Array) -> Array:
    """Judge ``formula <= tolerance`` along pieces: parts are halved until proved or seen to be wrong."""
    verdict = np.full(len(a), CERTAIN)
    piece, begin, end = np.arange(len(a)), np.zeros(len(a)), np.ones(len(a))
    for _ in range(HALVINGS):
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
    return _looked_at(formula, a, b, tolerance, verdict)


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
        rise = _sum(np.maximum(below[:, 0] * step, above[:, 0] * step))
        fall = _sum(np.minimum(below[:, 0] * step, above[:, 0] * step))
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
        change = _sum(np.maximum(np.abs(below[:, 0]), np.abs(above[:, 0])) * half)
    return np.minimum(formula.ranges(low, high)[1][:, 0], formula.ranges(middle, middle)[1][:, 0] + change)


def _sum(products: Array) -> Array:
    """The sum of each row; what is not a number comes of a coordinate that stays and a slope without bound."""
    return np.nan_to_num(products, nan=np.inf).sum(axis=1)


def _looked_at(formula: Formula, a: Array, b: Array, tolerance: Array, verdict: Array) -> Array:
    for k in np.flatnonzero(verdict == UNDECIDED).tolist():
        for share in np.linspace(0, 1, SAMPLES + 1).tolist():
            if not formula(a[k] + share * (b[k] - a[k])) <= tolerance[k]:
                verdict[k] = OUTSIDE
    return verdict
