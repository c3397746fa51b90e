"""A stretch of a formula as polynomial pieces, and a bound on what they are off by.

On a piece of length h the formula is interpolated at K + 1 Chebyshev-Lobatto points, so that the pieces of a stretch
join, and the error is at most h^(K+1) M / ((K+1)! 4^K), M a bound on the derivative of order K + 1. What is stated adds
the round-off of coefficients and of Horner's rule (to first order), and what half a unit in the last place of a
transition's time makes.
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, factorial, nextafter

import numpy as np

from hsdsl.exact.numbers import Number, Vector, mp
from hsdsl.exact.scene import Stretch
from hsdsl.execution import Array

TOLERANCE = 1e-14  # of the interpolation
UNIT = 2.0**-53


def breakpoints(stretch: Stretch, degree: int) -> list[Number]:
    """Cut a stretch so that every piece keeps the tolerance; between its ends at floats."""
    length = stretch.end - stretch.start
    if stretch.at is None or degree == 0:
        return [stretch.start, stretch.end]
    worst = max(stretch.derivative(degree + 1))
    share = float(worst) / (factorial(degree + 1) * 4.0**degree * TOLERANCE)
    count = max(1, ceil(float(length) * share ** (1 / (degree + 1))))
    inner = sorted({float(stretch.start + length * k / count) for k in range(1, count)})
    low, high = nextafter(float(stretch.start), np.inf), nextafter(float(stretch.end), -np.inf)
    return [stretch.start, *(mp.mpf(t) for t in inner if low < t < high), stretch.end]


@lru_cache
def nodes(degree: int) -> tuple[list[Number], list[list[Number]]]:
    """Chebyshev-Lobatto points of [0, 1] but the first, and the matrix from values there (less the first) to powers."""
    points = [(1 - mp.cos(mp.pi * k / degree)) / 2 for k in range(1, degree + 1)]
    inverse = mp.inverse(mp.matrix([[s**m for m in range(1, degree + 1)] for s in points]))
    return points, inverse.tolist()


def coefficients(stretch: Stretch, begin: Number, end: Number, degree: int) -> Array:
    """Return the piece from ``begin`` to ``end`` by powers, shape (degree, states)."""
    piece = np.zeros((degree, len(stretch.first)))
    if degree == 0:
        return piece
    if stretch.at is None:
        piece[0] = [float(b - a) for a, b in zip(stretch.first, stretch.last, strict=True)]
        return piece
    points, inverse = nodes(degree)
    start = stretch.at(begin)
    rises = [[b - a for a, b in zip(start, stretch.at(begin + s * (end - begin)), strict=True)] for s in points]
    for m, weights in enumerate(inverse):
        piece[m] = [float(mp.fdot(weights, column)) for column in zip(*rises, strict=True)]
    return piece


def error_of(stretch: Stretch, begin: Number, end: Number, x: Vector, piece: Array) -> float:
    """Bound the error of a piece at any float time: interpolation, arithmetic, and its ends' times as floats."""
    degree, h = len(piece), float(end - begin)
    cut = [0.0] * len(x)
    if stretch.at is not None and degree > 0:
        size = h ** (degree + 1) / (factorial(degree + 1) * 4.0**degree)
        cut = [float(m) * size for m in stretch.derivative(degree + 1)]
    late = max(abs(float(float(t) - t)) for t in (begin, end))
    powers = np.arange(1, degree + 1)[:, None]
    arithmetic = UNIT * (2 * np.abs([float(a) for a in x]) + np.sum((5 * powers + 5) * np.abs(piece), axis=0))
    line = 4 * UNIT * np.array([abs(float(b - a)) for a, b in zip(stretch.first, stretch.last, strict=True)])
    if stretch.at is None or degree == 0 or h == 0:
        rates = np.array([float(rate) for rate in stretch.derivative(1)])
    else:
        rates = np.sum(powers * np.abs(piece), axis=0) / h
    return float(np.max(np.array(cut) + arithmetic + line + rates * late)) + stretch.slack
