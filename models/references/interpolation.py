"""Closed forms between jumps in eighty digits, as polynomial pieces with a bound on their error.

A piece of length h interpolates the formula at K + 1 Chebyshev-Lobatto points, so that the pieces of a stretch join.
Its error is at most h^(K+1) M / ((K+1)! 4^K), M a bound on the derivative of order K + 1. The stated error adds
round-off of coefficients and of Horner's rule (to first order), and the effect of rounding transition times to floats.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from math import ceil, factorial, nextafter
from typing import Any

import numpy as np
from mpmath import MPContext  # pyright: ignore[reportMissingTypeStubs]

from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Array

Number = Any  # mpmath.mpf of the context below
Vector = tuple[Number, ...]

DIGITS = 80
mp: Any = MPContext()  # mpmath's global context stays as it is
mp.dps = DIGITS
TOLERANCE = 1e-14  # of the interpolation
UNIT = 2.0**-53


def number(value: Any, name: str = "the number") -> Number:
    """Turn an int, a float (its binary value), decimal text, a fraction or an mpmath number into a finite number.

    Raises UsageError: it is none of these.
    """
    try:
        exact = Fraction(value) if isinstance(value, (int, float, str, Fraction)) else None
        converted = mp.mpf(exact.numerator) / exact.denominator if exact is not None else mp.convert(value)
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        converted = mp.nan
    if not mp.isfinite(converted):
        raise UsageError(f"{name}: expected a finite number, got {value!r}")
    return converted


@dataclass(frozen=True)
class Stretch:
    """The closed form between two jumps, over [start, end] in one mode.

    Attributes
    ----------
    first, last : Vector
        The one-sided values at start and end.
    at : callable or None
        The state at a time; None: the line from ``first`` to ``last``.
    derivative : callable
        ``derivative(n)``: bounds on the absolute n-th derivatives of the states over the stretch.
    edge : str or None
        The transition that ends it; None where the state goes on, or the run ends.
    alternatives : tuple of str
        Edges reached at the same time and not taken.
    slack : float
        Bound on the distance to the true execution (a Zeno tail replaced by a line).
    """

    mode: str
    start: Number
    end: Number
    first: Vector
    last: Vector
    at: Callable[[Number], Vector] | None
    derivative: Callable[[int], Vector]
    edge: str | None = None
    alternatives: tuple[str, ...] = ()
    slack: float = 0.0


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
