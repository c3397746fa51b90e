"""The Bernstein form on [0, 1]: a polynomial lies between the least and the largest of its coefficients.

A curve lies in the convex hull of its coefficients, and is no longer than the polygon through them.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import Any

import numpy as np

Array = np.ndarray[tuple[Any, ...], np.dtype[np.float64]]  # numpy.typing would be imported for its one name
UNIT = 2.0**-53  # round-off of one operation, relative


@cache
def from_powers(degree: int) -> Array:
    """From coefficients of powers, a row, to Bernstein coefficients: b_i = sum_k C(i, k)/C(n, k) c_k."""
    return np.array([[comb(i, k) / comb(degree, k) for i in range(degree + 1)] for k in range(degree + 1)])


@cache
def halving(degree: int) -> tuple[Array, Array]:
    """From Bernstein coefficients, a row, to those of both halves (de Casteljau)."""
    left = np.array([[comb(i, k) / 2.0**i for i in range(degree + 1)] for k in range(degree + 1)])
    return left, left[::-1, ::-1]


@cache
def around_middle(degree: int) -> Array:
    """From Bernstein coefficients, a row, to those of powers of u, where u goes from -1 to 1 over [0, 1].

    b_i times C(n, i) s**i (1 - s)**(n - i), with s = (1 + u)/2: C(n, i)/2**n (1 + u)**i (1 - u)**(n - i).
    """
    rows = list[list[float]]()
    for i in range(degree + 1):
        powers = [comb(degree, i)]
        for k in range(degree):
            sign = 1 if k < i else -1
            powers = [a + sign * b for a, b in zip([*powers, 0], [0, *powers], strict=True)]
        rows.append([each / 2.0**degree for each in powers])
    return np.array(rows)


def restrict(coefficients: Array, begin: Array, end: Array) -> Array:
    """Write polynomials, powers of s with shape (n, p + 1, w), by powers of u: s = begin + u (end - begin)."""
    result = coefficients.copy()
    degree = coefficients.shape[1] - 1
    at = begin[:, None]
    for i in range(degree):
        for m in range(degree - 1, i - 1, -1):
            result[:, m] += at * result[:, m + 1]
    width = (end - begin)[:, None]
    scale = width
    for k in range(1, degree + 1):
        result[:, k] *= scale
        scale = scale * width
    return result


def bernstein(coefficients: Array) -> Array:
    """Turn powers (n, p + 1, w) into Bernstein coefficients of the same shape."""
    return from_powers(coefficients.shape[1] - 1).T @ coefficients


def degree_raised(coefficients: Array, degree: int) -> Array:
    """Pad powers with zeros up to a degree."""
    missing = degree + 1 - coefficients.shape[1]
    return np.pad(coefficients, ((0, 0), (0, missing), (0, 0))) if missing > 0 else coefficients


def largest_norm(coefficients: Array) -> Array:
    """Bound the Euclidean norm of each polynomial (by powers) on [0, 1] from above, shape (n,); rounded outwards."""
    norms = np.sqrt(np.max(np.sum(bernstein(coefficients) ** 2, axis=2), axis=1))
    return norms + _rounding(coefficients)


def length(coefficients: Array) -> Array:
    """Bound the length of each curve on [0, 1] from above by that of its control polygon; rounded outwards."""
    moving = coefficients.copy()
    moving[:, 0] = 0.0  # where it begins does not count, nor does that number's rounding
    steps = np.diff(bernstein(moving), axis=1)
    return np.sum(np.sqrt(np.sum(steps**2, axis=2)), axis=1) + 2 * coefficients.shape[1] * _rounding(moving)


def sizes(coefficients: Array) -> Array:
    """Add up the norms of each polynomial's coefficients, shape (n,)."""
    return np.sqrt(np.einsum("nkw,nkw->nk", coefficients, coefficients)).sum(axis=1)


def _rounding(coefficients: Array) -> Array:
    """Bound what rounding does to any of a polynomial's Bernstein coefficients and its norm."""
    _, count, width = coefficients.shape
    return (2 * count + width + 8) * UNIT * sizes(coefficients)
