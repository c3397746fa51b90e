# pyright: basic
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Normal forms: expressions as polynomials with exact coefficients in which equal values look equal, and back.

The unknowns are *atoms*: names, pi, and calls such as ``sin(x + 1)``, a square root or the reciprocal of a sum, whose
arguments are polynomials again. ``sin(a)**2 + cos(a)**2`` becomes 1, and the square of a square root its argument. So a
landing of a reset on a surface is known to be exact. Every step is bounded: what would grow beyond :data:`MOST_TERMS`
stays a product.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import sympy as sp

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
    return Polynomial({UNIT: Fraction(value)} if value else {})


def alone(atom: Atom) -> Polynomial:
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


MOST_TERMS = 300
MOST_POWER = 12


class NormalForms:
    """Makes polynomials of expressions; atoms and results are kept, so that nothing is worked out twice."""

    def __init__(self) -> None:
        self._atoms: dict[tuple[Any, ...], Atom] = {}
        self._done: dict[Any, Polynomial] = {}

    def of(self, expr: Any) -> Polynomial:
        """The polynomial of a SymPy expression."""
        found = self._done.get(expr)
        if found is None:
            found = self._done[expr] = self._make(expr)
        return found

    def atom(self, kind: str, head: Any, arguments: tuple[Polynomial, ...] = (), degree: int = 1) -> Atom:
        """The atom of this description."""
        key = (kind, head, arguments, degree)
        if key not in self._atoms:
            self._atoms[key] = Atom(len(self._atoms), kind, head, arguments, degree)
        return self._atoms[key]

    def product(self, p: Polynomial, q: Polynomial) -> Polynomial:
        """The product, multiplied out unless that is large."""
        if len(p.terms) * len(q.terms) > MOST_TERMS:
            p, q = self._whole(p), self._whole(q)
        for one, other in ((p, q), (q, p)):
            if (value := one.number) is not None:
                return other.times(value)
        result = Polynomial({})
        for left, a in p.terms.items():
            for right, b in q.terms.items():
                result += self._joined(left, right).times(a * b)
        return result

    def power(self, p: Polynomial, exponent: int) -> Polynomial:
        """An integer power, multiplied out unless that is large."""
        if exponent == 1:
            return p
        if exponent < 0 or len(p.terms) == 1:
            return self._monomial_power(p if len(p.terms) == 1 else self._whole(p), exponent)
        if exponent > MOST_POWER or len(p.terms) ** exponent > MOST_TERMS**2:
            return self._monomial_power(self._whole(p), exponent)
        result = number(1)
        for _ in range(exponent):
            result = self.product(result, p)
        return result

    def substituted(self, p: Polynomial, values: Mapping[Any, Polynomial]) -> Polynomial:
        """The polynomial with names replaced, inside of atoms too."""
        if not p.names & values.keys():
            return p
        untouched = {m: c for m, c in p.terms.items() if not any(atom.names & values.keys() for atom, _ in m)}
        result = Polynomial(untouched)
        for monomial, coefficient in p.terms.items():
            if monomial in untouched:
                continue
            part = number(coefficient)
            for atom, exponent in monomial:
                part = self.product(part, self.power(self._replaced(atom, values), exponent))
            result += part
        return result

    def _replaced(self, atom: Atom, values: Mapping[Any, Polynomial]) -> Polynomial:
        if not atom.names & values.keys():
            return alone(atom)
        if atom.kind == "name":
            return values[atom.head]
        arguments = tuple(self.substituted(argument, values) for argument in atom.arguments)
        if atom.kind == "sum":
            return arguments[0]
        return self.root(arguments[0], atom.degree) if atom.kind == "root" else self._call(atom.head, arguments)

    def root(self, p: Polynomial, degree: int) -> Polynomial:
        """The root of a number where it is exact, else an atom."""
        value = p.number
        if value is not None and value >= 0:
            parts = [sp.integer_nthroot(int(part), degree) for part in (value.numerator, value.denominator)]
            if all(exact for _, exact in parts):
                return number(Fraction(int(parts[0][0]), int(parts[1][0])))
        return alone(self.atom("root", None, (p,), degree))

    def _make(self, expr: Any) -> Polynomial:
        if expr.is_Rational:
            return number(Fraction(int(expr.p), int(expr.q)))
        if expr.is_Symbol:
            return alone(self.atom("name", expr))
        if expr.is_Add:
            total: dict[Monomial, Fraction] = {}
            for term in expr.args:
                for monomial, coefficient in self.of(term).terms.items():
                    total[monomial] = total.get(monomial, Fraction(0)) + coefficient
            return Polynomial({m: c for m, c in total.items() if c})
        if expr.is_Mul:
            result = number(1)
            for factor in expr.args:
                result = self.product(result, self.of(factor))
            return result
        if expr.is_Pow and expr.exp.is_Rational:
            base = self.of(expr.base)
            if expr.exp.q != 1:
                base = self.root(base, int(expr.exp.q))
            return self.power(base, int(expr.exp.p)) if base.terms or expr.exp.p > 0 else self._opaque(expr)
        return alone(self.atom("constant", expr)) if expr.is_Atom else self._opaque(expr)

    def _opaque(self, expr: Any) -> Polynomial:
        return self._call(expr.func, tuple(self.of(argument) for argument in expr.args))

    def _call(self, head: Any, arguments: tuple[Polynomial, ...]) -> Polynomial:
        numbers = [argument.number for argument in arguments]
        if None not in numbers:  # SymPy folds sin(0), our own classes abs(-2)
            value = head(*(_rational(n) for n in numbers))
            if value.is_Rational:
                return number(Fraction(int(value.p), int(value.q)))
        return alone(self.atom("call", head, arguments))

    def _whole(self, p: Polynomial) -> Polynomial:
        return p if len(p.terms) == 1 else alone(self.atom("sum", None, (p,)))

    def _monomial_power(self, p: Polynomial, exponent: int) -> Polynomial:
        if not p.terms and exponent < 0:
            return alone(self.atom("call", sp.Pow, (p, number(exponent))))  # 0**-1: has no value
        ((monomial, coefficient),) = p.terms.items() if p.terms else ((UNIT, Fraction(0)),)
        raised = tuple((atom, power * exponent) for atom, power in monomial) if exponent else UNIT
        return self._joined(raised, UNIT).times(coefficient**exponent)

    def _joined(self, left: Monomial, right: Monomial) -> Polynomial:
        """The product of two monomials; roots and cosines raised too high are rewritten."""
        if not left or not right:
            powers = dict(left or right)
        else:
            powers = dict(left)
            for atom, exponent in right:
                powers[atom] = powers.get(atom, 0) + exponent
        extra: list[Polynomial] = []
        for atom, exponent in tuple(powers.items()):
            if atom.kind == "root" and abs(exponent) >= atom.degree:
                whole = int(exponent / atom.degree)
                powers[atom] = exponent - whole * atom.degree
                extra.append(self.power(atom.arguments[0], whole))
            elif atom.head is sp.cos and 2 <= exponent <= MOST_POWER:
                sine = self._call(sp.sin, atom.arguments)
                powers[atom] = exponent % 2
                extra.append(self.power(number(1) - self.power(sine, 2), exponent // 2))
        ordered = sorted((item for item in powers.items() if item[1]), key=lambda item: item[0].index)
        result = Polynomial({tuple(ordered): Fraction(1)})
        for factor in extra:
            result = self.product(result, factor)
        return result


def expression(p: Polynomial) -> Any:
    """The SymPy expression of a polynomial."""
    return sp.Add(*(sp.Mul(_rational(c), *(_expression(a) ** e for a, e in m)) for m, c in p.terms.items()))


def _expression(atom: Atom) -> Any:
    if atom.kind in ("name", "constant"):
        return atom.head
    arguments = [expression(argument) for argument in atom.arguments]
    if atom.kind == "sum":
        return arguments[0]
    return sp.Pow(arguments[0], sp.Rational(1, atom.degree)) if atom.kind == "root" else atom.head(*arguments)


def _rational(value: Any) -> Any:
    return sp.Rational(value.numerator, value.denominator)
