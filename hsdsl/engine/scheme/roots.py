"""Root isolation: where polynomials rise through zero, as hsdsl/engine/simulate/surfaces.py asks.

An interval is halved until the signs of the Bernstein coefficients show one root or none (Descartes' rule of signs).
"""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.polynomials import ROUNDING, split, value_and_slope, value_at_end, value_of
from hsdsl.engine.scheme.primitives import Room, Vector, fill_bernstein, inline, largest_of, least_of

MOST_REFINEMENTS = 300


@dataclass
class Cut:
    """A part [low, high] of an interval, and the Bernstein coefficients of a polynomial on it."""

    low: Number
    high: Number
    b: Room


@dataclass
class Roots:
    """Room to look for roots: own has the Bernstein coefficients on [0, 1] of the polynomial ``of``, if there is one.

    ``of`` is compared by address, so a caller that overwrites its coefficients clears it. ``binomials`` are those of
    all degrees, row by row. ``cuts`` is a stack of the parts that a search still has to examine: ``open`` of them, at
    most MORE_CUTS more than numbers have bits. Of a part that is cut, the half nearer to where the search begins is on
    top.
    """

    unit: Number
    binomials: Vector
    of: Vector
    own: Room
    left: Room
    cuts: list[Cut]


@dataclass
class Walk:
    """A walk along a surface, which has got to ``at`` on one piece; ``outside`` says whether it is beyond there.

    It is beyond round-off at the end of the step where it has ``risen``.
    """

    level: Number
    outside: bool
    risen: bool
    at: Number


@inline
def bernstein_of(roots: Roots, c: Vector, n: int) -> Vector:
    """Return the Bernstein coefficients of a polynomial, made once for it."""
    if roots.of is not c:
        fill_bernstein(roots.binomials, c, n, roots.own)
    roots.of = c
    return roots.own


def stays_below(roots: Roots, c: Vector, n: int, level: Number) -> bool:
    """Whether bounds prove that the polynomial is nowhere above a level on [0, 1]; if not, that proves nothing.

    Its values are convex combinations of the partial sums of its coefficients, and so are its Bernstein coefficients.
    """
    total = c[0]
    bound = c[0]
    for k in range(1, n + 1):
        total = total + c[k]
        if not total <= bound:
            bound = total
    return bound <= level or largest_of(bernstein_of(roots, c, n), n) <= level


def changes(b: Vector, n: int) -> int:
    """Count the sign changes of Bernstein coefficients, without zeros; not-a-number counts as negative."""
    count = 0
    before = 0
    for i in range(n + 1):
        sign = (b[i] > 0) - (not b[i] >= 0)
        count += sign * before < 0
        before = before if sign == 0 else sign
    return count


def rises(roots: Roots, c: Vector, n: int, sign: Number, level: Number, start: Number) -> Number | None:
    """Find a point from start on where sign times the polynomial is above a level, not having come back down before it.

    That is the start itself where it is above there. None where it is nowhere above, up to intervals shorter than a
    unit of round-off.
    """
    own = bernstein_of(roots, c, n)
    first = roots.cuts[0].b
    for i in range(n + 1):
        first[i] = sign * own[i] - level
    if start > 0:
        split(first, n, start, roots.left)
    roots.cuts[0].low = start
    roots.cuts[0].high = 1
    open = 1
    while open > 0:
        open -= 1
        cut = roots.cuts[open]
        b, low, high = cut.b, cut.low, cut.high
        if largest_of(b, n) <= 0:
            continue
        if b[0] > 0:  # already above where this part begins
            return low
        if b[n] > 0 and (changes(b, n) == 1 or high - low <= roots.unit):
            return high
        if high - low > roots.unit:
            nearer = roots.cuts[open + 1]
            middle = (low + high) / 2
            split(b, n, 0.5, nearer.b)
            cut.low = middle
            nearer.low, nearer.high = low, middle
            open += 2
    return None


def towards(roots: Roots, c: Vector, n: int, end: Number, other: Number, sign: Number) -> tuple[Number, Number]:
    """Halve the way to an end of a bracket until the polynomial has the sign: a smaller bracket, or the end twice.

    An end that is a root up to round-off may be where the polynomial comes back, not where it rises.
    """
    far = other
    while True:
        middle = (end + far) / 2
        if middle in (end, far) or abs(end - far) <= roots.unit * roots.unit:
            return end, end
        if sign * value_of(c, n, middle) > 0:
            return middle, far
        far = middle


def refined(roots: Roots, c: Vector, n: int, start: Number, end: Number) -> Number:
    """Solve for the root in a bracket P(start) <= 0 < P(end) (Newton's method, a bisection where it leaves it)."""
    a, b = start, end
    fa = c[0] if a == 0 else value_of(c, n, a)
    fb = value_at_end(c, n) if b == 1 else value_of(c, n, b)
    sizes: Number = 0
    for k in range(n + 1):
        sizes = sizes + abs(c[k])
    noise = ROUNDING * roots.unit * sizes
    # falls: at a it may come back down to zero; stays: at b it may not have risen yet
    falls = not fa < -noise
    stays = not fb > noise
    if falls:
        a, b = towards(roots, c, n, a, b, -1)
    if stays:
        b, a = towards(roots, c, n, b, a, 1)
    if falls or stays:
        fa = value_of(c, n, a)
        fb = value_of(c, n, b)
    if a == b or not fa < 0:
        return a
    s = a - fa * (b - a) / (fb - fa)
    for _count in range(MOST_REFINEMENTS):
        if not a < s < b:
            s = (a + b) / 2
            if not a < s < b:
                return a
        f, slope = value_and_slope(c, n, s)
        if f < 0:
            a = s
        else:
            b = s
        after = s - f / slope if slope > 0 else a
        if slope > 0 and a <= after <= b and (after - s) * (after - s) <= roots.unit * after * after:
            return after
        s = after
    return a


def last_root(roots: Roots, c: Vector, n: int, taken: int, start: Number, end: Number) -> Number | None:
    """Find the last point in [start, end] where P rises through 0, knowing that it is positive at the end.

    None where it is positive all the way. The polynomial c is P or, with 1 taken, P times s: then its Bernstein
    coefficients after the first, times n / k, are those of P, and have their signs.
    """
    whole = bernstein_of(roots, c, n)
    own, p, m = whole[taken:], c[taken:], n - taken
    if start == 0 and end == 1 and own[0] <= 0 and own[m] > 0 and changes(own, m) <= 1:
        return refined(roots, p, m, start, end)
    first = roots.cuts[0].b
    for k in range(m + 1):
        first[k] = own[k] * n / (k + 1) if taken > 0 else own[k]
    if end < 1:
        split(first, m, end, roots.left)
        for k in range(m + 1):
            first[k] = roots.left[k]
    if start > 0:
        split(first, m, start / end, roots.left)
    roots.cuts[0].low = start
    roots.cuts[0].high = end
    open = 1
    while open > 0:
        open -= 1
        cut = roots.cuts[open]
        b, low, high = cut.b, cut.low, cut.high
        if least_of(b, m) > 0:
            continue
        if b[0] <= 0 and b[m] > 0 and changes(b, m) <= 1:
            return refined(roots, p, m, low, high)
        if high - low <= roots.unit:
            if b[0] > 0:  # what it rose through lies before
                continue
            return low
        later = roots.cuts[open + 1]
        middle = (low + high) / 2
        for k in range(m + 1):
            later.b[k] = b[k]
        split(later.b, m, 0.5, b)
        cut.high = middle
        later.low, later.high = middle, high
        open += 2
    return None


def root_of(roots: Roots, c: Vector, n: int, start: Number, end: Number) -> Number:
    """The last root before the end; a series that begins with zero has it taken out, so that tiny roots stay exact."""
    taken = 1 if start == 0 and c[0] == 0 and n > 0 else 0
    root = last_root(roots, c, n, taken, start, end)
    return start if root is None else root


def next_root(roots: Roots, walk: Walk, c: Vector, n: int, off: Number, last: bool) -> Number | None:
    """Walk on to the root before the next rise on a piece, which may be the last; None where it has no more.

    Polynomials that are off by as much tell nothing of lower rises.
    """
    sizes: Number = 0
    for k in range(n + 1):
        sizes = sizes + abs(c[k])
    above = max(walk.level, ROUNDING * roots.unit * sizes, off)
    if walk.outside:
        below = rises(roots, c, n, -1, 0, walk.at)
        if below is None:
            return None
        walk.at = below
        walk.outside = False
    high = rises(roots, c, n, 1, above, walk.at)
    if high is None:
        if not (last and walk.risen and walk.at < 1):
            return None
        high = 1
    root = root_of(roots, c, n, walk.at, high)
    walk.at = high
    walk.outside = True
    return root
