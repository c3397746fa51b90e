"""Coefficient k of a series from its own earlier coefficients and those of its operands: what a tape's lines do.

Series are lists that hold at least the coefficients that a formula reads. Sums go from left to right. The formulas are
in A. Griewank and A. Walther, *Evaluating Derivatives*, Sec. 13.2 (doi:10.1137/1.9780898717761).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hsdsl.arithmetic import Number

Series = Sequence[Number]
INTEGER_POWERS = 64  # of a series that begins with zero: repeated products


def product(k: int, a: Series, b: Series) -> Number:
    """Coefficient k of a b."""
    total = a[0] * b[k]
    for j in range(1, k + 1):
        total = total + a[j] * b[k - j]
    return total


def quotient(k: int, z: Series, a: Number, b: Series) -> Number:
    """Coefficient k of z = a / b, ``a`` being coefficient k of the numerator."""
    for j in range(1, k + 1):
        a = a - b[j] * z[k - j]
    return a / b[0]


def root(k: int, z: Series, a: Series, sqrt: Callable[[Number], Number]) -> Number:
    """Coefficient k of z = sqrt(a)."""
    if k == 0:
        return sqrt(a[0])
    total = a[k]
    for j in range(1, k):
        total = total - z[j] * z[k - j]
    return total / (2 * z[0])


def power(k: int, z: Series, a: Series, c: Number, pow: Callable[[Number, Number], Number]) -> Number:
    """Coefficient k of z = a**c for a constant c; where a begins with zero only whole c have a series."""
    if k == 0:
        return pow(a[0], c)
    if a[0] == 0 and c == int(c) and 0 <= c <= INTEGER_POWERS:
        return _repeated(k, a, int(c))
    total = c * a[k] * k * z[0]
    for j in range(1, k):
        total = total + (c * j - (k - j)) * a[j] * z[k - j]
    return total / (k * a[0])


def _repeated(k: int, a: Series, c: int) -> Number:
    zero = a[0]
    z = [zero + 1] + [zero] * k
    for _ in range(c):
        z = [product(i, a, z) for i in range(k + 1)]
    return z[k]


def integral(k: int, u: Series, g: Series) -> Number:
    """Coefficient k > 0 of z where z' = g u'."""
    total = u[1] * g[k - 1]
    for j in range(2, k + 1):
        total = total + j * u[j] * g[k - j]
    return total / k
