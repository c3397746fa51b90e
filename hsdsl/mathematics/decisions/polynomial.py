# pyright: basic
"""Sums of products of atoms with exact coefficients: equal ones are equal objects.

The unknowns of such a polynomial are its *atoms*: names, pi, and calls such as ``sin(x + 1)``, a square root or the
reciprocal of a sum. Arguments of calls are polynomials again. `normal_form` makes them of expressions.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

Monomial = tuple[tuple["Atom", int], ...]
UNIT: Monomial = ()


@dataclass(frozen=True, eq=False)
class Atom:
    """What a polynomial is made of, one object for each: equal atoms are the same object.

    ``index`` is its place in the order of atoms. Its kind is ``name``, ``constant``, ``sum`` (a polynomial kept whole),
    ``root`` (the ``degree``-th root of its argument), or ``call`` of the SymPy function ``head``.
    """

    index: int
    kind: str
    head: Any
    arguments: tuple[Polynomial, ...] = ()
    degree: int = 1

    @cached_property
    def names(self) -> frozenset[Any]:
        """The symbols in it."""
        if self.kind == "name":
            return frozenset((self.head,))
        return frozenset().union(*(argument.names for argument in self.arguments))


class Polynomial:
    """A sum of products of atoms with exact coefficients; equal polynomials are equal objects to `==` and `hash`."""

    __slots__ = ("_hash", "_names", "terms")

    def __init__(self, terms: dict[Monomial, Fraction]) -> None:
        self.terms = terms
        self._hash: int | None = None
        self._names: frozenset[Any] | None = None

    def __hash__(self) -> int:
        if self._hash is None:
            self._hash = hash(frozenset(self.terms.items()))
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Polynomial) and self.terms == other.terms

    @property
    def names(self) -> frozenset[Any]:
        """The symbols in it."""
        if self._names is None:
            self._names = frozenset().union(*(atom.names for monomial in self.terms for atom, _ in monomial))
        return self._names

    @property
    def number(self) -> Fraction | None:
        """Its value, where it is an exact number."""
        if not self.terms:
            return Fraction(0)
        return self.terms.get(UNIT) if len(self.terms) == 1 else None

    def __add__(self, other: Polynomial) -> Polynomial:
        if not self.terms or not other.terms:
            return self if self.terms else other
        terms = dict(self.terms)
        for monomial, coefficient in other.terms.items():
            total = terms.get(monomial, 0) + coefficient
            if total:
                terms[monomial] = total
            else:
                terms.pop(monomial, None)
        return Polynomial(terms)

    def times(self, factor: Fraction) -> Polynomial:
        """The multiple by a number."""
        if factor == 1:
            return self
        return Polynomial({m: c * factor for m, c in self.terms.items()} if factor else {})

    def __neg__(self) -> Polynomial:
        return Polynomial({m: -c for m, c in self.terms.items()})

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + -other


def number(value: Fraction | int) -> Polynomial:
    """A number as a polynomial."""
    return Polynomial({UNIT: Fraction(value)} if value else {})


def alone(atom: Atom) -> Polynomial:
    """An atom as a polynomial."""
    return Polynomial({((atom, 1),): Fraction(1)})


def linear_in(p: Polynomial, symbol: Any) -> Fraction | None:
    """The coefficient of a name that occurs in one term only, times a number."""
    found: Fraction | None = None
    for monomial, coefficient in p.terms.items():
        for atom, exponent in monomial:
            if symbol in atom.names:
                if found is not None or atom.head is not symbol or exponent != 1 or len(monomial) != 1:
                    return None
                found = coefficient
    return found
