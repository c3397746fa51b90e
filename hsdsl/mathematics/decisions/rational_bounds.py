# pyright: basic
"""Exact bounds of polynomials: from bounds of their atoms, and from what rows (a polynomial, its sign) have in common.

An end is a fraction, or infinite. Floats are infinite here, and never computed with: a fraction may be too large.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import reduce
from math import inf
from typing import Any

from hsdsl.mathematics.decisions.polynomial import UNIT, Atom, Monomial, Polynomial
from hsdsl.mathematics.decisions.question import Relation
from hsdsl.mathematics.decisions.straight_line_program import enclosure

End = Fraction | float
RationalBounds = tuple[End, End]
Row = tuple[Polynomial, Relation]
_EVERYTHING = (-inf, inf)
_ALWAYS = {"sin": (-1, 1), "cos": (-1, 1), "tanh": (-1, 1), "sign": (-1, 1)}
_ALWAYS |= {"exp": (0, inf), "cosh": (1, inf), "absolute": (0, inf)}


class Contradiction(Exception):
    """The constraints exclude each other."""


def bounds_of(p: Polynomial, names: Mapping[Any, RationalBounds]) -> RationalBounds:
    """Bounds of a polynomial from bounds of its names, term by term, exact."""
    low = high = p.terms.get(UNIT, Fraction(0))
    for monomial, coefficient in p.terms.items():
        if monomial:
            parts = (_raised(_of_atom(atom, names), exponent) for atom, exponent in monomial)
            first, last = reduce(_times, parts, (coefficient, coefficient))
            low, high = _plus(low, first), _plus(high, last)
    return low, high


def _of_atom(atom: Atom, names: Mapping[Any, RationalBounds]) -> RationalBounds:
    """What is known of a name, of a constant, or of all values of a function."""
    if atom.kind == "name":
        return names[atom.head]
    if atom.kind == "constant":
        return enclosure(atom.head) or _EVERYTHING
    if atom.kind == "root":
        return Fraction(0), inf
    low, high = _ALWAYS.get(getattr(atom.head, "__name__", ""), _EVERYTHING) if atom.kind == "call" else _EVERYTHING
    return low if low == -inf else Fraction(low), high if high == inf else Fraction(high)


def _plus(a: End, b: End) -> End:
    return a if isinstance(a, float) else b if isinstance(b, float) else a + b


def _product(a: End, b: End) -> End:
    if not (a and b):
        return Fraction(0)
    if isinstance(a, float) or isinstance(b, float):
        return inf if (a > 0) == (b > 0) else -inf
    return a * b


def _times(left: RationalBounds, right: RationalBounds) -> RationalBounds:
    corners = [_product(a, b) for a in left for b in right]
    return min(corners), max(corners)


def _raised(base: RationalBounds, exponent: int) -> RationalBounds:
    low, high = base
    if exponent < 0:
        if low <= 0 <= high:
            return (Fraction(0), inf) if exponent % 2 == 0 else _EVERYTHING
        low, high = (Fraction(0) if isinstance(end, float) else 1 / end for end in (high, low))
    ends = low ** abs(exponent), high ** abs(exponent)
    if exponent % 2:
        return ends
    return Fraction(0) if low <= 0 <= high else min(ends), max(ends)


def holds(bounds: RationalBounds, relation: Relation) -> bool | None:
    """Whether a sign is known to hold, or not to hold, within bounds; None where they do not say."""
    low, high = bounds
    if relation == "= 0":
        return True if low == high == 0 else False if low > 0 or high < 0 else None
    strict = relation == "< 0"
    if high < 0 or (high == 0 and not strict):
        return True
    return False if low > 0 or (low == 0 and strict) else None


def tighten(rows: Sequence[Row], bounds: dict[Any, RationalBounds]) -> None:
    """Narrow ``bounds`` by what rows say of names; raise :class:`Contradiction` where they exclude each other."""
    # Of each direction the largest lower end, with whether it is open, and the least upper one: with whether closed.
    directions: dict[tuple[tuple[Monomial, Fraction], ...], list[tuple[End, bool]]] = {}
    for p, relation in rows:
        key, level, rising = _direction(p)
        ends = directions.setdefault(key, [(-inf, False), (inf, True)])
        if relation == "= 0" or not rising:
            ends[0] = max(ends[0], (level, relation == "< 0"))
        if relation == "= 0" or rising:
            ends[1] = min(ends[1], (level, relation != "< 0"))
    for key, ((low, is_open), (high, closed)) in directions.items():
        if low > high or (low == high and (is_open or not closed)):
            raise Contradiction
        if (name := _name(key)) is not None:
            first, last = bounds[name]
            bounds[name] = max(first, low), min(last, high)
            if bounds[name][0] > bounds[name][1]:
                raise Contradiction
    for p, relation in rows:  # of a name alone all is known by now
        if (
            _name([item for item in p.terms.items() if item[0]]) is None
            and holds(bounds_of(p, bounds), relation) is False
        ):
            raise Contradiction


def _name(terms: Sequence[tuple[Monomial, Fraction]]) -> Any | None:
    """The name that terms are a multiple of."""
    if len(terms) != 1 or len(terms[0][0]) != 1:
        return None
    ((atom, exponent),) = terms[0][0]
    return atom.head if atom.kind == "name" and exponent == 1 else None


def _direction(p: Polynomial) -> tuple[tuple[tuple[Monomial, Fraction], ...], Fraction, bool]:
    """A polynomial as a multiple of ``direction - level``, and whether that multiple is positive."""
    terms = sorted(((m, c) for m, c in p.terms.items() if m), key=lambda item: [(atom.index, e) for atom, e in item[0]])
    lead = terms[0][1]
    return tuple((m, c / lead) for m, c in terms), -p.terms.get(UNIT, Fraction(0)) / lead, lead > 0
