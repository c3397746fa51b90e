"""Matrices of the Bernstein form on [0, 1]: a polynomial lies between the least and the largest of its coefficients."""

from __future__ import annotations

from functools import cache
from math import comb

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
