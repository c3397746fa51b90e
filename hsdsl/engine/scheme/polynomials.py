"""Values and slopes of polynomials c_0 + c_1 s + ...: in C also of lanes, so no branch depends on a number."""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.primitives import Room, Vector, inline

ROUNDING = 8  # units of round-off in evaluating a polynomial, relative to the sum of its terms


@inline
def value_of(c: Vector, n: int, s: Number) -> Number:
    """Evaluate c_0 + c_1 s + ... (Horner)."""
    total = c[n]
    for k in range(n - 1, -1, -1):
        total = c[k] + s * total
    return total


@inline
def value_at_end(c: Vector, n: int) -> Number:
    """Evaluate c_0 + c_1 + ..., the value at 1."""
    total = c[n]
    for k in range(n - 1, -1, -1):
        total = c[k] + total
    return total


@inline
def value_and_slope(c: Vector, n: int, s: Number) -> tuple[Number, Number]:
    """Evaluate a polynomial and its derivative (Horner)."""
    total = c[n]
    slope = total * 0
    for k in range(n - 1, -1, -1):
        slope = total + s * slope
        total = c[k] + s * total
    return total, slope


def slope_of(c: Vector, n: int, s: Number) -> Number:
    """Evaluate the derivative of c_0 + c_1 s + ... (Horner)."""
    slope = s * 0
    for k in range(n, 0, -1):
        slope = k * c[k] + s * slope
    return slope


def split(b: Room, n: int, s: Number, left: Room) -> None:
    """Cut an interval at the share s: left gets the coefficients before it, b those after it (de Casteljau)."""
    rest = 1 - s
    left[0] = b[0]
    for j in range(1, n + 1):
        for i in range(n - j + 1):
            b[i] = rest * b[i] + s * b[i + 1]
        left[j] = b[0]
