# pyright: basic
"""Exact bounds of polynomials, from bounds of their atoms, and which signs they leave."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from hsdsl.lint.analysis.polynomial import UNIT, Atom, Polynomial
from hsdsl.lint.analysis.question import Relation
from hsdsl.lint.analysis.straight_line_program import enclosure

RationalBounds = tuple[Fraction | None, Fraction | None]  # None: without end
_SIGNED = {"sin": (-1, 1), "cos": (-1, 1), "tanh": (-1, 1), "exp": (0, None), "cosh": (1, None), "absolute": (0, None)}
_SIGNED |= {"sign": (-1, 1)}


def bounds_of(p: Polynomial, of_atom: Callable[[Atom], RationalBounds]) -> RationalBounds:
    """RationalBounds of a polynomial from bounds of its atoms, term by term, exact."""
    low: Fraction | None = p.terms.get(UNIT, Fraction(0))
    high: Fraction | None = low
    for monomial, coefficient in p.terms.items():
        if not monomial:
            continue
        term: RationalBounds = (Fraction(1), Fraction(1))
        for atom, exponent in monomial:
            term = _times(term, _raised(of_atom(atom), exponent))
        first, last = term if coefficient > 0 else (term[1], term[0])
        low = None if low is None or first is None else low + coefficient * first
        high = None if high is None or last is None else high + coefficient * last
    return low, high


def _raised(base: RationalBounds, exponent: int) -> RationalBounds:
    low, high = base
    if exponent < 0:
        if low is not None and low > 0:
            base = (None if high is None else 1 / high, 1 / low)
            base = (Fraction(0) if base[0] is None else base[0], base[1])
        elif high is not None and high < 0:
            base = (1 / high, Fraction(0) if low is None else 1 / low)
        else:
            return (Fraction(0), None) if exponent % 2 == 0 else (None, None)
        low, high = base
        exponent = -exponent
    if exponent % 2 == 1:
        return (None if low is None else low**exponent, None if high is None else high**exponent)
    ends = [None if end is None else end**exponent for end in base]
    most = None if low is None or high is None else max(low**exponent, high**exponent)
    if low is not None and low >= 0:
        return ends[0], most
    if high is not None and high <= 0:
        return ends[1], most
    return Fraction(0), most


def _times(left: RationalBounds, right: RationalBounds) -> RationalBounds:
    corners: list[tuple[int, Fraction | None]] = []
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            if a == 0 or b == 0:
                corners.append((0, Fraction(0)))
            elif a is None or b is None:
                corners.append((_end_sign(a, i) * _end_sign(b, j), None))
            else:
                corners.append((0, a * b))
    finite = [value for _, value in corners if value is not None]
    endless = {sign for sign, value in corners if value is None}
    low = None if -1 in endless else min(finite, default=None)
    high = None if 1 in endless else max(finite, default=None)
    return low, high


def _end_sign(value: Fraction | None, end: int) -> int:
    if value is None:
        return 1 if end else -1
    return 1 if value > 0 else -1


def holds(bounds: RationalBounds, relation: Relation) -> bool | None:
    """Whether a sign is known to hold, or not to hold, within bounds; None where they do not say."""
    low, high = bounds
    if relation == "= 0":
        if low == high == 0:
            return True
        return False if (low is not None and low > 0) or (high is not None and high < 0) else None
    strict = relation == "< 0"
    if high is not None and (high < 0 or (high == 0 and not strict)):
        return True
    if low is not None and (low > 0 or (low == 0 and strict)):
        return False
    return None


def of_constant(atom: Atom) -> RationalBounds:
    """RationalBounds of an atom that has no name of its own: a constant, or the value of a function."""
    return enclosure(atom.head) or (None, None) if atom.kind == "constant" else _by_nature(atom)


def _by_nature(atom: Atom) -> RationalBounds:
    """What an atom's values always lie between."""
    if atom.kind == "root":
        return Fraction(0), None
    if atom.kind == "call":
        low, high = _SIGNED.get(getattr(atom.head, "__name__", ""), (None, None))
        return None if low is None else Fraction(low), None if high is None else Fraction(high)
    return None, None
