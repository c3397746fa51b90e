# pyright: basic
"""What rows have in common: bounds of names and of directions, and contradictions between them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from hsdsl.lint.analysis.polynomial import Atom, Monomial, Polynomial
from hsdsl.lint.analysis.question import Relation
from hsdsl.lint.analysis.rational_bounds import RationalBounds, bounds_of, holds, of_constant

Row = tuple[Polynomial, Relation]


class Contradiction(Exception):
    """The constraints exclude each other."""


def tighten(rows: Sequence[Row], bounds: dict[Any, RationalBounds]) -> None:
    """Narrow ``bounds`` by what rows say of names.

    Raises
    ------
    Contradiction
        Some rows exclude each other, or the bounds.
    """
    directions: dict[tuple[tuple[Monomial, Fraction], ...], list[Any]] = {}
    for p, relation in rows:
        key, level, rising = _direction(p)
        ends = directions.setdefault(key, [None, None])
        if relation == "= 0" or not rising:
            _raise(ends, level, relation == "< 0")
        if relation == "= 0" or rising:
            _lower(ends, level, relation == "< 0")
    for key, (low, high) in directions.items():
        if low is not None and high is not None and (low[0] > high[0] or (low[0] == high[0] and (low[1] or high[1]))):
            raise Contradiction
        ((atom, exponent), *others), *more = key[0][0], *key[1:]
        if atom.kind == "name" and exponent == 1 and not others and not more:
            _narrow(bounds, atom.head, low and low[0], high and high[0])

    def of_atom(atom: Atom) -> RationalBounds:
        return bounds[atom.head] if atom.kind == "name" else of_constant(atom)

    for p, relation in rows:  # of a name alone all is known by now
        if not _is_name(p) and holds(bounds_of(p, of_atom), relation) is False:
            raise Contradiction


def _is_name(p: Polynomial) -> bool:
    """Whether a polynomial is a multiple of one name, and a constant."""
    monomials = [m for m in p.terms if m]
    if len(monomials) != 1 or len(monomials[0]) != 1:
        return False
    ((atom, exponent),) = monomials[0]
    return atom.kind == "name" and exponent == 1


def _direction(p: Polynomial) -> tuple[tuple[tuple[Monomial, Fraction], ...], Fraction, bool]:
    """A polynomial as a multiple of ``direction - level``, and whether that multiple is positive."""
    terms = sorted(((m, c) for m, c in p.terms.items() if m), key=lambda item: [(atom.index, e) for atom, e in item[0]])
    lead = terms[0][1]
    if lead == 1:
        return tuple(terms), -p.terms.get((), Fraction(0)), True
    return tuple((m, c / lead) for m, c in terms), -p.terms.get((), Fraction(0)) / lead, lead > 0


def _raise(ends: list[Any], level: Fraction, strict: bool) -> None:
    if ends[0] is None or (level, strict) > ends[0]:
        ends[0] = (level, strict)


def _lower(ends: list[Any], level: Fraction, strict: bool) -> None:
    if ends[1] is None or (level, not strict) < (ends[1][0], not ends[1][1]):
        ends[1] = (level, strict)


def _narrow(bounds: dict[Any, RationalBounds], symbol: Any, low: Fraction | None, high: Fraction | None) -> None:
    first, last = bounds[symbol]
    if low is not None and (first is None or low > first):
        first = low
    if high is not None and (last is None or high < last):
        last = high
    if first is not None and last is not None and first > last:
        raise Contradiction
    bounds[symbol] = first, last
