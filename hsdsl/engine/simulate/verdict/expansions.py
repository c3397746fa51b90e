"""Expansions of generated routines along parts of steps, many at once: what a formula is there up to third order.

An expansion is a function of u from -1 to 1, no further than its remainder from a polynomial. An operation is
*resolved* where what it makes beyond third order is no more than an eighth of its terms: its result is as smooth as the
part is long. What the others may add is carried along as unresolved. So a narrow pulse is unresolved, however small it
is against the terms that it is added to, and a term that varies with the part is not, however large.
``runtime/c/expansions.c`` does the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from hsdsl.base.numbers.enclosures import Array, Range, as_range

ORDER = 3
EXPANSION_ROUNDOFF = 2.0**-48  # of all terms together: more than rounding makes of a coefficient
RESOLVED = 8  # terms are so many times what is beyond them; what moves a state by so many errors is seen


@dataclass(frozen=True, eq=False)
class Expansion:
    """Functions along parts, element by element.

    Attributes
    ----------
    terms : array, shape (4, N)
        Coefficients of 1, u, u**2 and u**3.
    remainder : array, shape (N,)
        How far the function may be from these; infinite where nothing is known.
    unresolved : array, shape (N,)
        How much of that no smooth function explains.
    error : array, shape (N,)
        How much the errors of states change it, where no terms cancel.
    """

    terms: Array
    remainder: Array
    unresolved: Array
    error: Array

    @property
    def variation(self) -> Array:
        """How far the polynomial may be from its value in the middle."""
        return np.abs(self.terms[1:]).sum(axis=0)

    @property
    def magnitude(self) -> Array:
        """How far the polynomial may be from zero."""
        return np.abs(self.terms).sum(axis=0)

    @property
    def mean(self) -> Array:
        """The mean of the polynomial."""
        return self.terms[0] + self.terms[2] / 3

    @property
    def deviation(self) -> Array:
        """How far the function may be from that."""
        return self.variation + self.remainder

    @property
    def size(self) -> Array:
        """How far it may be from zero."""
        return self.magnitude + self.remainder

    @property
    def range(self) -> Range:
        """All that it may be."""
        return Range(self.terms[0] - self.deviation, self.terms[0] + self.deviation)

    def __neg__(self) -> Expansion:
        return Expansion(-self.terms, self.remainder, self.unresolved, self.error)

    def __add__(self, other: Expansion) -> Expansion:
        remainder = self.remainder + other.remainder + (self.size + other.size) * EXPANSION_ROUNDOFF
        return _known(self.terms + other.terms, remainder, self.unresolved + other.unresolved, self.error + other.error)

    def __sub__(self, other: Expansion) -> Expansion:
        return self + -other

    def __mul__(self, other: Expansion) -> Expansion:
        if other is self:
            return at_most(product(self, self), _square, self)
        return at_most(product(self, other), Range.__mul__, self, other)

    def __truediv__(self, other: Expansion) -> Expansion:
        return at_most(product(self, reciprocal(other)), Range.__truediv__, self, other)


def _square(value: Range) -> Range:
    return value * value


def line(value: Any, slope: Any) -> Expansion:
    """A linear function, known up to rounding."""
    value, slope = np.broadcast_arrays(np.atleast_1d(np.asarray(value, dtype=float)), slope)
    zero = np.zeros(value.shape)
    return Expansion(np.stack([value, slope, zero, zero]), np.abs(value) * EXPANSION_ROUNDOFF, zero, zero)


def polynomial(powers: Array, error: Array) -> Expansion:
    """A polynomial of u; ``powers`` has shape (N, degree + 1)."""
    sizes = np.abs(powers)
    terms = np.zeros((ORDER + 1, len(powers)))
    terms[: powers.shape[1]] = powers[:, : ORDER + 1].T
    remainder = sizes[:, ORDER + 1 :].sum(axis=1) + sizes[:, : ORDER + 1].sum(axis=1) * EXPANSION_ROUNDOFF
    return Expansion(terms, remainder, np.zeros(len(powers)), error)


def _known(terms: Array, remainder: Array, unresolved: Array, error: Array) -> Expansion:
    """An expansion, or one of which nothing is known."""
    lost = ~np.isfinite(remainder)
    if lost.any():
        terms, error = np.where(lost, 0.0, terms), np.where(lost, 0.0, error)
        remainder, unresolved = np.where(lost, np.inf, remainder), np.where(lost, np.inf, unresolved)
    return Expansion(terms, remainder, unresolved, error)


def _flat(value: Range, error: Any = 0.0) -> Expansion:
    """A constant, and anything within a range."""
    half = (value.high - value.low) / 2
    terms = np.zeros((ORDER + 1, *np.shape(half)))
    terms[0] = value.low + half
    return _known(terms, half + np.abs(terms[0]) * EXPANSION_ROUNDOFF, half, error + np.zeros(half.shape))


def chosen(which: Any, one: Expansion, other: Expansion) -> Expansion:
    """One of two, element by element."""
    return Expansion(
        np.where(which, one.terms, other.terms),
        np.where(which, one.remainder, other.remainder),
        np.where(which, one.unresolved, other.unresolved),
        np.where(which, one.error, other.error),
    )


def at_most(found: Expansion, function: Callable[..., Any], *arguments: Expansion) -> Expansion:
    """The constant instead, where less is unresolved in all that a function may be."""
    if not (found.unresolved > 0).any():
        return found
    flat = _flat(as_range(function(*(a.range for a in arguments))), found.error)
    better = reduce(np.logical_and, [np.isfinite(a.remainder) for a in arguments], flat.unresolved < found.unresolved)
    return chosen(better, flat, found)


def product(a: Expansion, b: Expansion) -> Expansion:
    """A b, by its series alone."""
    whole = np.zeros((2 * ORDER + 1, *np.broadcast_shapes(a.remainder.shape, b.remainder.shape)))
    for k, each in enumerate(a.terms):
        whole[k : k + ORDER + 1] += each * b.terms
    terms, beyond = whole[: ORDER + 1], np.abs(whole[ORDER + 1 :]).sum(axis=0)
    sizes = np.abs(a.terms[0]), np.abs(b.terms[0])
    varies = a.variation * (sizes[1] + b.variation) + sizes[0] * b.variation - beyond
    off, size = beyond + a.remainder * b.size + b.remainder * (a.size - a.remainder), a.size * b.size
    unresolved = np.where(beyond * RESOLVED <= varies, a.unresolved * b.size + b.unresolved * a.size, off)
    return _known(terms, off + size * EXPANSION_ROUNDOFF, unresolved, sizes[0] * b.error + a.error * sizes[1])


def reciprocal(a: Expansion) -> Expansion:
    """1/a."""
    v = 1 / a.terms[0]
    return composed(a, (v, -(v**2), v**3, -(v**4)), np.abs(v) * geometric(a.deviation * np.abs(v)))


def geometric(share: Array) -> Array:
    """The powers of a share from the fourth on."""
    return np.where(share < 1, share**4 / (1 - share), np.inf)


def composed(a: Expansion, c: Sequence[Array], further: Array) -> Expansion:
    """A function with coefficients around the value of an expansion; ``further`` bounds its powers from the fourth."""
    _, first, second, third = a.terms
    by, one = a.deviation, np.abs(first)
    slope, bend, twist = (np.abs(each) for each in c[1:])
    varies = by * (slope + by * (bend + by * twist))
    beyond = bend * (by * by - one * (one + 2 * np.abs(second))) + twist * (by**3 - one**3) + further
    off, gain = slope * a.remainder + beyond, slope + by * (2 * bend + 3 * by * twist)
    unresolved = np.where(beyond * RESOLVED <= varies, a.unresolved * gain, off)
    terms = [
        c[0],
        c[1] * first,
        c[1] * second + c[2] * first * first,
        c[1] * third + first * (2 * c[2] * second + c[3] * first * first),
    ]
    return _known(np.stack(terms), off + (np.abs(c[0]) + varies) * EXPANSION_ROUNDOFF, unresolved, slope * a.error)


NOTHING_KNOWN = Expansion(np.zeros((ORDER + 1, 1)), np.full(1, np.inf), np.full(1, np.inf), np.zeros(1))
