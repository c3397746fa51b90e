"""Coefficient k > 0 of a series from its own earlier coefficients and those of its operands: what a tape's lines do.

Series are lists that hold at least the coefficients that a formula reads. ``last`` is the highest index up to which the
first series of a sum is asked: k, or less where it is a polynomial of time. The formulas are in A. Griewank and
A. Walther, *Evaluating Derivatives*, Sec. 13.2 (doi:10.1137/1.9780898717761).

Sums go from the middle outwards, each half by itself: a processor can begin with them before the newest coefficients
are known. `runtime/c/hs_series.h` has the same functions and must add in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.arithmetic import Number

Series = Sequence[Number]
INTEGER_POWERS = 64  # of a series that begins with zero: repeated products


def convolution(k: int, a: Series, b: Series, first: int, last: int) -> Number:
    """Sum a[j] b[k - j] for j from ``first`` to ``last``, which is not before it."""
    middle = max(first, min(k // 2, last))
    low = a[middle] * b[k - middle]
    for j in range(middle - 1, first - 1, -1):
        low = low + a[j] * b[k - j]
    if last == middle:
        return low
    high = a[middle + 1] * b[k - middle - 1]
    for j in range(middle + 2, last + 1):
        high = high + a[j] * b[k - j]
    return low + high


def product(k: int, a: Series, b: Series, last: int) -> Number:
    """Coefficient k of a b."""
    return convolution(k, a, b, 0, last)


def symmetric(k: int, a: Series, first: int) -> Number:
    """Sum a[j] a[k - j] for j from ``first`` to k - ``first``: all but the middle one come in pairs."""
    total: Number = 0
    for j in range((k - 1) // 2, first - 1, -1):
        total = total + a[j] * a[k - j]
    total = 2 * total
    return total if k % 2 else total + a[k // 2] * a[k // 2]


def square(k: int, a: Series) -> Number:
    """Coefficient k of a**2."""
    return symmetric(k, a, 0)


def quotient(k: int, z: Series, a: Number, b: Series, last: int) -> Number:
    """Coefficient k of z = a / b, ``a`` being coefficient k of the numerator."""
    return (a - convolution(k, b, z, 1, last)) / b[0]


def root(k: int, z: Series, a: Number) -> Number:
    """Coefficient k of z = sqrt(a), ``a`` being coefficient k of the radicand."""
    return (a - symmetric(k, z, 1)) / (2 * z[0])


def power(k: int, z: Series, a: Series, c: Number, last: int) -> Number:
    """Coefficient k of z = a**c for a constant c; where a begins with zero only whole c have a series."""
    if a[0] == 0 and c == int(c) and 0 <= c <= INTEGER_POWERS:
        return _repeated(k, a, int(c))
    total = c * a[k] * k * z[0]
    for j in range(min(k - 1, last), 0, -1):
        total = total + (c * j - (k - j)) * a[j] * z[k - j]
    return total / (k * a[0])


def _repeated(k: int, a: Series, c: int) -> Number:
    z: list[Number] = [1] + [0] * k
    for _ in range(c):
        z = [z[0] * a[0], *(product(i, a, z, i) for i in range(1, k + 1))]
    return z[k]


def integral(k: int, u: Series, g: Series, last: int) -> Number:
    """Coefficient k of z where z' = g u'."""
    middle = max(1, min(k // 2, last))
    low = middle * u[middle] * g[k - middle]
    for j in range(middle - 1, 0, -1):
        low = low + j * u[j] * g[k - j]
    if last == middle:
        return low / k
    high = (middle + 1) * u[middle + 1] * g[k - middle - 1]
    for j in range(middle + 2, last + 1):
        high = high + j * u[j] * g[k - j]
    return (low + high) / k
