"""Sums of norms of affine functions of one unknown, minimised over an interval: many at once, to round-off."""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.gate_sequence import ConeShape
from hsdsl.metrics.geometry import Array
from hsdsl.metrics.rounding import UNIT, charge, lengths

ITERATIONS = 100


def on_line(shape: ConeShape, offsets: list[Array], numbers: Array) -> tuple[Array, Array, Array]:
    """Minimise a shape's problems of at most one unknown, both ends charged with rounding; s is (N, 0) or (N, 1).

    Rounding moves the interval's ends by less than the legs are charged for.
    """
    if shape.size == 0:
        s, far = np.zeros((len(numbers), 0)), np.zeros(len(numbers))
        lower = upper = lengths(shape, offsets, s)
    else:
        low, high = interval_of(shape.normals, shape.levels)
        lower, upper, where, far = minimise_on_line([m[:, 0] for m in shape.matrices], offsets, low, high)
        s = where[:, None]
        if shape.least > 0:  # no shorter path is farther away
            far = np.minimum(far, np.abs(where) + 2 * upper / shape.least)
    rounding = charge(shape, numbers, far) + shape.operations * UNIT * upper
    return np.maximum(0.0, lower - rounding), upper + rounding, s


def minimise_on_line(
    matrices: list[Array], offsets: list[Array], low: float, high: float
) -> tuple[Array, Array, Array, Array]:
    """Minimise N sums of norms ``|matrices[i] s + offsets[i]|`` over ``low <= s <= high``; offsets are (N, n_i) arrays.

    Returns lower bounds, values attained (more by round-off), where, and how far from 0 the minimum can be.
    """
    count = len(offsets[0])
    slopes = [float(m @ m) for m in matrices]
    kinks = [np.clip(-(o @ m) / a, low, high) for m, o, a in zip(matrices, offsets, slopes, strict=True) if a > 0]
    if not kinks:
        s = np.full(count, np.clip(0.0, low, high))
        value = _length(matrices, offsets, s)
        return value, value, s, np.abs(s)
    a, b = np.min(kinks, axis=0), np.max(kinks, axis=0)
    best, where = _best(matrices, offsets, kinks)
    wide = np.flatnonzero(b - a > 4e-16 * (np.abs(a) + np.abs(b)))
    lower = best.copy()
    if wide.size:
        some = [o[wide] for o in offsets]
        low_wide, value, at = _newton(matrices, some, a[wide], b[wide])
        better = value < best[wide]
        best[wide] = np.where(better, value, best[wide])
        where[wide] = np.where(better, at, where[wide])
        lower[wide] = np.minimum(low_wide, best[wide])
    return lower, best, where, np.maximum(np.abs(a), np.abs(b))


def _newton(matrices: list[Array], offsets: list[Array], a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Newton's method on the slope, between a and b, halving where it leaves them.

    The sum is convex, so its tangent at any point bounds it from below.
    """
    s, lower, value = 0.5 * (a + b), np.full(len(a), -np.inf), np.full(len(a), np.inf)
    where = s.copy()
    steepest = sum(float(np.linalg.norm(m)) for m in matrices)
    left = np.arange(len(a))
    for _ in range(ITERATIONS):
        some = [o[left] for o in offsets]
        at, slope, bend = _expanded(matrices, some, s)
        loose = 4e-16 * steepest * (b - a)
        below = at + np.minimum(slope * (a - s), slope * (b - s)) - loose
        better = at < value[left]
        where[left] = np.where(better, s, where[left])
        value[left], lower[left] = np.minimum(value[left], at), np.maximum(lower[left], below)
        a, b = np.where(slope > 0, a, s), np.where(slope > 0, s, b)
        middle = 0.5 * (a + b)
        step = s - np.divide(slope, bend, out=np.full_like(s, np.inf), where=bend > 0)
        s = np.where((step > a) & (step < b), step, middle)
        open_ = (value[left] - lower[left] > 2 * loose + 2e-16 * value[left]) & (middle > a) & (middle < b)
        left, a, b, s = left[open_], a[open_], b[open_], s[open_]
        if not left.size:
            break
    return np.minimum(lower, value), value, where


def _expanded(matrices: list[Array], offsets: list[Array], s: Array) -> tuple[Array, Array, Array]:
    """The sum, its slope and its second derivative."""
    total, slope, bend = np.zeros(len(s)), np.zeros(len(s)), np.zeros(len(s))
    for m, o in zip(matrices, offsets, strict=True):
        parts = [o[:, i] + m[i] * s for i in range(len(m))]
        size = _norm(parts)
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        along = sum((m[i] * parts[i] for i in range(len(m))), np.zeros(len(s))) * inverse
        total += size
        slope += along
        bend += (float(m @ m) - along * along) * inverse
    return total, slope, bend


def _length(matrices: list[Array], offsets: list[Array], s: Array) -> Array:
    total = np.zeros(len(s))
    for m, o in zip(matrices, offsets, strict=True):
        total += _norm([o[:, i] + m[i] * s for i in range(len(m))])
    return total


def _norm(parts: list[Array]) -> Array:
    if len(parts) == 2:
        return np.hypot(parts[0], parts[1])
    return np.sqrt(sum((p * p for p in parts), np.zeros_like(parts[0]))) if parts else np.zeros(0)


def _best(matrices: list[Array], offsets: list[Array], candidates: list[Array]) -> tuple[Array, Array]:
    values = np.array([_length(matrices, offsets, s) for s in candidates])
    chosen = np.argmin(values, axis=0)
    columns = np.arange(len(candidates[0]))
    return values[chosen, columns], np.array(candidates)[chosen, columns]


def interval_of(normals: Array, levels: Array) -> tuple[float, float]:
    """The interval that inequalities leave to one unknown."""
    slopes = normals[:, 0]
    bounds = levels / slopes
    low = float(np.max(bounds[slopes < 0], initial=-np.inf))
    high = float(np.min(bounds[slopes > 0], initial=np.inf))
    return low, max(low, high)
