"""Sums of norms of affine functions of one unknown, minimised over an interval: many at once, to round-off."""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.geometry import Array

HALVINGS = 64


def minimise_on_line(
    matrices: list[Array], offsets: list[Array], low: float, high: float
) -> tuple[Array, Array, Array]:
    """Minimise ``sum_i |matrices[i] s + offsets[i]|`` over ``low <= s <= high``.

    Parameters
    ----------
    matrices : list of (n_i,) arrays
        Slopes, the same for every problem.
    offsets : list of (N, n_i) arrays
        Offsets, a row for each of N problems.
    low, high : float
        The interval, which may be unbounded.

    Returns
    -------
    (N,) lower bounds, (N,) values attained, (N,) where
        They differ by round-off.
    """
    count = len(offsets[0])
    slopes = [float(m @ m) for m in matrices]
    kinks = [np.clip(-(o @ m) / a, low, high) for m, o, a in zip(matrices, offsets, slopes, strict=True) if a > 0]
    if not kinks:
        s = np.full(count, np.clip(0.0, low, high))
        value = _length(matrices, offsets, s)
        return value, value, s
    a, b = np.min(kinks, axis=0), np.max(kinks, axis=0)
    best, where = _best(matrices, offsets, kinks)
    wide = np.flatnonzero(b - a > 4e-16 * (np.abs(a) + np.abs(b)))
    lower = best.copy()
    if wide.size:
        some = [o[wide] for o in offsets]
        low_wide, value, at = _bisect(matrices, some, a[wide], b[wide])
        better = value < best[wide]
        best[wide] = np.where(better, value, best[wide])
        where[wide] = np.where(better, at, where[wide])
        lower[wide] = np.minimum(low_wide, best[wide])
    return lower, best, where


def _bisect(matrices: list[Array], offsets: list[Array], a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Halve by the sign of the slope; the lower bound is where the slopes at the two ends meet."""
    for _ in range(HALVINGS):
        middle = 0.5 * (a + b)
        if np.all((middle <= a) | (middle >= b)):
            break
        rising = _slope(matrices, offsets, middle) > 0
        a, b = np.where(rising, a, middle), np.where(rising, middle, b)
    at_a, at_b = _length(matrices, offsets, a), _length(matrices, offsets, b)
    steepest = sum(float(np.linalg.norm(m)) for m in matrices)
    value = np.minimum(at_a, at_b)
    return value - steepest * (b - a), value, np.where(at_a <= at_b, a, b)


def _length(matrices: list[Array], offsets: list[Array], s: Array) -> Array:
    total = np.zeros(len(s))
    for m, o in zip(matrices, offsets, strict=True):
        total += _norm([o[:, i] + m[i] * s for i in range(len(m))])
    return total


def _slope(matrices: list[Array], offsets: list[Array], s: Array) -> Array:
    total = np.zeros(len(s))
    for m, o in zip(matrices, offsets, strict=True):
        parts = [o[:, i] + m[i] * s for i in range(len(m))]
        size = _norm(parts)
        along = sum((m[i] * parts[i] for i in range(len(m))), np.zeros(len(s)))
        total += np.divide(along, size, out=np.zeros_like(size), where=size > 0)
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
