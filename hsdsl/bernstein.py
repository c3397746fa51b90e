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
