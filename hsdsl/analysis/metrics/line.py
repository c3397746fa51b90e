"""Sums of norms of affine functions of one unknown, minimised over an interval: many at once, to round-off."""

from __future__ import annotations

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import ConeShape
from hsdsl.analysis.metrics.geometry import Array
from hsdsl.analysis.metrics.rounding import UNIT, charge, lengths, norm

ITERATIONS = 100


def on_line(shape: ConeShape, offsets: Array, numbers: Array) -> tuple[Array, Array, Array]:
    """Minimise a shape's problems of at most one unknown, both ends charged with rounding; s is (N, 0) or (N, 1).

    Rounding moves the interval's ends by less than the legs are charged for.
    """
    if shape.size == 0:
        s, far = np.zeros((len(numbers), 0)), np.zeros(len(numbers))
        lower = upper = lengths(shape, offsets, s)
    else:
        lower, upper, where, far = _minimised(shape, offsets)
        s = where[:, None]
        if shape.least > 0:  # no shorter path is farther away
            far = np.minimum(far, np.abs(where) + 2 * upper / shape.least)
    rounding = charge(shape, numbers, far) + shape.operations * UNIT * upper
    return np.maximum(0.0, lower - rounding), upper + rounding, s


def _minimised(shape: ConeShape, offsets: Array) -> tuple[Array, Array, Array, Array]:
    """Lower bounds, values attained (more by round-off), where, and how far from 0 the minimum can be."""
    low, high = interval_of(shape.normals, shape.levels)
    along = [(offsets[:, part], shape.stacked[part, 0]) for part in shape.parts]
    kinks = [np.clip(-(o @ m) / (m @ m), low, high) for o, m in along if m @ m > 0]
    kinks = np.array(kinks or [np.full(len(offsets), np.clip(0.0, low, high))])
    a, b = kinks.min(axis=0), kinks.max(axis=0)
    values = np.array([lengths(shape, offsets, s[:, None]) for s in kinks])
    first = np.argmin(values, axis=0)[None]
    best, where = (np.take_along_axis(x, first, axis=0)[0] for x in (values, kinks))
    wide = np.flatnonzero(b - a > 4e-16 * (np.abs(a) + np.abs(b)))
    lower = best.copy()
    if wide.size:
        low_wide, value, at = _newton(shape, offsets[wide], a[wide], b[wide])
        better = value < best[wide]
        best[wide] = np.where(better, value, best[wide])
        where[wide] = np.where(better, at, where[wide])
        lower[wide] = np.minimum(low_wide, best[wide])
    return lower, best, where, np.maximum(np.abs(a), np.abs(b))


def _newton(shape: ConeShape, offsets: Array, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Newton's method on the slope, between a and b, halving where it leaves them.

    The sum is convex, so its tangent at any point bounds it from below.
    """
    s, lower, value = 0.5 * (a + b), np.full(len(a), -np.inf), np.full(len(a), np.inf)
    where = s.copy()
    left = np.arange(len(a))
    for _ in range(ITERATIONS):
        at, slope, bend = _expanded(shape, offsets[left], s)
        loose = 4e-16 * shape.spread * (b - a)
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


def _expanded(shape: ConeShape, offsets: Array, s: Array) -> tuple[Array, Array, Array]:
    """The sum, its slope and its second derivative."""
    total, slope, bend = np.zeros((3, len(s)))
    for part in shape.parts:
        m = shape.stacked[part, 0]
        leg = offsets[:, part] + s[:, None] * m
        size = norm(leg)
        inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
        along = (leg @ m) * inverse
        total += size
        slope += along
        bend += (float(m @ m) - along * along) * inverse
    return total, slope, bend


def interval_of(normals: Array, levels: Array) -> tuple[float, float]:
    """The interval that inequalities leave to one unknown."""
    slopes = normals[:, 0]
    bounds = levels / slopes
    low = float(np.max(bounds[slopes < 0], initial=-np.inf))
    high = float(np.min(bounds[slopes > 0], initial=np.inf))
    return low, max(low, high)
