"""Where polynomials change sign on [0, 1], with the Bernstein form as the certificate.

A polynomial's Bernstein coefficients on an interval enclose its values there, and it has at most as many roots inside
as they have changes of sign, and as many up to an even number (Descartes' rule). An interval is cut until these decide;
no root between two samples can be missed. See R. T. Farouki, The Bernstein polynomial basis: a centennial
retrospective, Computer Aided Geometric Design 29, 2012 (doi:10.1016/j.cagd.2012.03.001).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from itertools import pairwise
from math import comb

from hsdsl.base.numbers.arithmetic import Number

Coefficients = Sequence[Number]  # of 1, s, s**2, ...
MOST_REFINEMENTS = 300
ROUNDING = 8  # units of round-off in evaluating a polynomial, relative to the sum of its terms


@cache
def _binomials(degree: int) -> tuple[int, ...]:
    return tuple(comb(degree, k) for k in range(degree + 1))


def total(terms: Iterable[Number], zero: Number) -> Number:
    """Sum from left to right (Python's own ``sum`` compensates round-off from 3.12 on, and C does not)."""
    for term in terms:
        zero = zero + term
    return zero


def bernstein(c: Coefficients) -> list[Number]:
    """Return the Bernstein coefficients on [0, 1] of c_0 + c_1 s + ...: b_i = sum_k C(i, k) c_k / C(n, k).

    The sums are made as in Pascal's triangle, without products.
    """
    b = [a / n for a, n in zip(c, _binomials(len(c) - 1), strict=True)]
    for k in range(1, len(b)):
        for i in range(len(b) - 1, k - 1, -1):
            b[i] = b[i] + b[i - 1]
    return b


def stays_below(c: Coefficients, level: Number) -> bool:
    """Whether bounds prove that the polynomial is nowhere above ``level`` on [0, 1]; False proves nothing."""
    return total((a for a in c[1:] if a > 0), c[0]) <= level or max(bernstein(c)) <= level


def split(b: list[Number], s: Number) -> tuple[list[Number], list[Number]]:
    """Cut an interval at the share s: Bernstein coefficients on both parts (de Casteljau)."""
    left, right = [b[0]], [b[-1]]
    row: list[Number] = b
    rest = 1 - s
    while len(row) > 1:
        row = [rest * a + s * c for a, c in pairwise(row)]
        left.append(row[0])
        right.append(row[-1])
    right.reverse()
    return left, right


def value(c: Coefficients, s: Number) -> Number:
    """Evaluate c_0 + c_1 s + ... (Horner)."""
    total = c[-1]
    for k in range(len(c) - 2, -1, -1):
        total = c[k] + s * total
    return total


def value_and_slope(c: Coefficients, s: Number) -> tuple[Number, Number]:
    """Evaluate a polynomial and its derivative (Horner)."""
    total = c[-1]
    slope = total * 0
    for k in range(len(c) - 2, -1, -1):
        slope = total + s * slope
        total = c[k] + s * total
    return total, slope


def changes(b: list[Number]) -> int:
    """Count the changes of sign of a list of numbers, zeros left out."""
    signs = [x > 0 for x in b if x != 0]
    return sum(one != two for one, two in pairwise(signs))


def rises(c: Coefficients, level: Number, start: Number, tiny: Number) -> Number | None:
    """Find a point from ``start`` on where the polynomial is above ``level``, not having come back down before it.

    None where it is nowhere above, up to intervals shorter than ``tiny``.
    """
    b = [x - level for x in bernstein(c)]
    pieces = [((split(b, start)[1] if start > 0 else b), start, start * 0 + 1)]
    while pieces:
        b, low, high = pieces.pop()
        if max(b) <= 0:
            continue
        if b[0] > 0:
            return low
        if b[-1] > 0 and (changes(b) == 1 or high - low <= tiny):
            return high
        if high - low > tiny:
            left, right = split(b, (low * 0 + 1) / 2)
            middle = (low + high) / 2
            pieces += [(right, middle, high), (left, low, middle)]
    return None


def last_root(c: Coefficients, start: Number, end: Number, tiny: Number, b: list[Number]) -> Number | None:
    """Find the last point in [start, end] where the polynomial rises through 0, knowing that it is positive at ``end``.

    None where it is positive all the way; ``b`` are the Bernstein coefficients of ``c`` on [0, 1].
    """
    one = end * 0 + 1
    if end < 1:
        b = split(b, end)[0]
    if start > 0:
        b = split(b, start / end)[1]
    pieces = [(b, start, end)]
    while pieces:
        b, low, high = pieces.pop()
        if min(b) > 0:
            continue
        if b[0] <= 0 < b[-1] and changes(b) <= 1:
            return _refined(c, low, high, tiny)
        if high - low <= tiny:
            if b[0] > 0:  # what it rose through lies before
                continue
            return low
        left, right = split(b, one / 2)
        middle = (low + high) / 2
        pieces += [(left, low, middle), (right, middle, high)]
    return None


def _towards(c: Coefficients, end: Number, other: Number, sign: int, tiny: Number) -> tuple[Number, Number]:
    """Halve the way to an end of a bracket until the polynomial has the sign: a smaller bracket, or ``end`` twice.

    An end that is a root up to round-off may be where the polynomial comes back, not where it rises.
    """
    while True:
        middle = (end + other) / 2
        if middle in (end, other) or abs(end - other) <= tiny * tiny:
            return end, end
        if sign * value(c, middle) > 0:
            return middle, other
        other = middle


def _refined(c: Coefficients, a: Number, b: Number, tiny: Number) -> Number:
    """Solve for the root in a bracket P(a) <= 0 < P(b) (Newton's method, a bisection where it leaves the bracket)."""
    fa, fb = value(c, a), value(c, b)
    noise = ROUNDING * tiny * total(map(abs, c), fa * 0)
    if not fa < -noise:
        a, b = _towards(c, a, b, -1, tiny)
    if not fb > noise:
        b, a = _towards(c, b, a, 1, tiny)
    fa, fb = value(c, a), value(c, b)
    if a == b or not fa < 0:
        return a
    s = a - fa * (b - a) / (fb - fa)
    for _ in range(MOST_REFINEMENTS):
        if not a < s < b:
            s = (a + b) / 2
            if not a < s < b:
                return a
        f, slope = value_and_slope(c, s)
        if f < 0:
            a = s
        else:
            b = s
        after = s - f / slope if slope > 0 else a
        if slope > 0 and a <= after <= b and (after - s) * (after - s) <= tiny * after * after:
            return after
        s = after
    return a
