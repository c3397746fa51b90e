"""Sums in coefficient k > 0 of a series, from its own earlier coefficients and those of its operands.

What a tape's lines do with them is in `tape`. Series are lists that hold at least the coefficients that a sum reads.
The formulas are in A. Griewank and A. Walther, *Evaluating Derivatives*, Sec. 13.2 (doi:10.1137/1.9780898717761).

Sums go from the middle outwards, two terms at a time: a processor can begin with them before the newest coefficients
are known. `runtime/c/hs_series.h` has the same functions and must add in the same order.
"""

from __future__ import annotations

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.kernel import Series

INTEGER_POWERS = 64  # of a series that begins with zero: repeated products


def pairs(k: int, a: Series, b: Series, first: int) -> Number:
    """Sum a[j] b[k - j] for j from ``first`` to k - ``first``."""
    low: Number = 0
    high: Number = 0 if k % 2 else a[k // 2] * b[k // 2]
    for j in range((k - 1) // 2, first - 1, -1):
        low = low + a[j] * b[k - j]
        high = high + a[k - j] * b[j]
    return low + high


def product(k: int, a: Series, b: Series) -> Number:
    """Coefficient k of a b."""
    return pairs(k, a, b, 0)


def behind(k: int, a: Series, b: Series) -> Number:
    """Sum a[j] b[k - j] for j from 1 to k: what is known of a product before b[k] is."""
    return pairs(k, a, b, 1) + a[k] * b[0]


def few(k: int, a: Series, b: Series, last: int) -> Number:
    """Sum the same for j from 1 to ``last`` > 0, where a has no further coefficients."""
    total = a[last] * b[k - last]
    for j in range(last - 1, 0, -1):
        total = total + a[j] * b[k - j]
    return total


def symmetric(k: int, a: Series, first: int) -> Number:
    """Sum a[j] a[k - j] for j from ``first`` to k - ``first``: all but the middle one come twice."""
    total: Number = 0
    for j in range((k - 1) // 2, first - 1, -1):
        total = total + a[j] * a[k - j]
    total = 2 * total
    return total if k % 2 else total + a[k // 2] * a[k // 2]


def square(k: int, a: Series) -> Number:
    """Coefficient k of a**2."""
    return symmetric(k, a, 0)


def root(k: int, z: Series, a: Number) -> Number:
    """Coefficient k of z = sqrt(a), ``a`` being coefficient k of the radicand."""
    return (a - symmetric(k, z, 1)) / (2 * z[0])


def power(k: int, z: Series, a: Series, c: Number) -> Number:
    """Coefficient k of z = a**c for a constant c; where a begins with zero only whole c have a series."""
    if a[0] == 0 and c == int(c) and 0 <= c <= INTEGER_POWERS:
        return _repeated(k, a, int(c))
    total = c * a[k] * k * z[0]
    for j in range(k - 1, 0, -1):
        total = total + (c * j - (k - j)) * a[j] * z[k - j]
    return total / (k * a[0])


def _repeated(k: int, a: Series, c: int) -> Number:
    z: list[Number] = [1] + [0] * k
    for _ in range(c):
        z = [z[0] * a[0], *(product(i, a, z) for i in range(1, k + 1))]
    return z[k]
