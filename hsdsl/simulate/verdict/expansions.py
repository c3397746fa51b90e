"""Expansions of generated routines along parts of steps, many at once: what a formula is there up to third order.

An expansion is a function of u from -1 to 1, no further than its rest from a polynomial. An operation is *resolved*
where what it makes beyond third order is no more than an eighth of its terms: its result is as smooth as the part is
long. What the others may add is carried along as hidden. So a narrow pulse is hidden, however small it is against the
terms that it is added to, and a term that varies with the part is not, however large. ``runtime/c/expansions.c`` does
the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.enclosures import Range, as_range

Array = NDArray[np.float64]

ORDER = 3
ROUNDED = 2.0**-48  # of all terms together: more than rounding makes of a coefficient
RESOLVED = 8  # terms are so many times what is beyond them; what moves a state by so many errors is seen


@dataclass(frozen=True, eq=False)
class Expansion:
    """Functions along parts, element by element.

    Attributes
    ----------
    terms : array, shape (4, N)
        Coefficients of 1, u, u**2 and u**3.
    rest : array, shape (N,)
        How far the function may be from these; infinite where nothing is known.
    hidden : array, shape (N,)
        How much of that no smooth function explains.
    moved : array, shape (N,)
        How much the errors of states change it, where no terms cancel.
    """

    terms: Array
    rest: Array
    hidden: Array
    moved: Array

    @property
    def turn(self) -> Array:
        """How far the polynomial may be from its value in the middle."""
        return np.abs(self.terms[1:]).sum(axis=0)

    @property
    def shown(self) -> Array:
        """How far the polynomial may be from zero."""
        return np.abs(self.terms).sum(axis=0)

    @property
    def mean(self) -> Array:
        """The mean of the polynomial."""
        return self.terms[0] + self.terms[2] / 3

    @property
    def reach(self) -> Array:
        """How far the function may be from that."""
        return self.turn + self.rest

    @property
    def size(self) -> Array:
        """How far it may be from zero."""
        return self.shown + self.rest

    @property
    def range(self) -> Range:
        """All that it may be."""
        return Range(self.terms[0] - self.reach, self.terms[0] + self.reach)

    def __neg__(self) -> Expansion:
        return Expansion(-self.terms, self.rest, self.hidden, self.moved)

    def __add__(self, other: Expansion) -> Expansion:
        rest = self.rest + other.rest + (self.size + other.size) * ROUNDED
        return _known(self.terms + other.terms, rest, self.hidden + other.hidden, self.moved + other.moved)

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
    return Expansion(np.stack([value, slope, zero, zero]), np.abs(value) * ROUNDED, zero, zero)


def polynomial(powers: Array, moved: Array) -> Expansion:
    """A polynomial of u; ``powers`` has shape (N, degree + 1)."""
    sizes = np.abs(powers)
    terms = np.zeros((ORDER + 1, len(powers)))
    terms[: powers.shape[1]] = powers[:, : ORDER + 1].T
    rest = sizes[:, ORDER + 1 :].sum(axis=1) + sizes[:, : ORDER + 1].sum(axis=1) * ROUNDED
    return Expansion(terms, rest, np.zeros(len(powers)), moved)


def _known(terms: Array, rest: Array, hidden: Array, moved: Array) -> Expansion:
    """An expansion, or one of which nothing is known."""
    lost = ~np.isfinite(rest)
    if lost.any():
        terms, moved = np.where(lost, 0.0, terms), np.where(lost, 0.0, moved)
        rest, hidden = np.where(lost, np.inf, rest), np.where(lost, np.inf, hidden)
    return Expansion(terms, rest, hidden, moved)


def _flat(value: Range, moved: Any = 0.0) -> Expansion:
    """A constant, and anything within a range."""
    half = (value.high - value.low) / 2
    terms = np.zeros((ORDER + 1, *np.shape(half)))
    terms[0] = value.low + half
    return _known(terms, half + np.abs(terms[0]) * ROUNDED, half, moved + np.zeros(half.shape))


def chosen(which: Any, one: Expansion, other: Expansion) -> Expansion:
    """One of two, element by element."""
    return Expansion(
        np.where(which, one.terms, other.terms),
        np.where(which, one.rest, other.rest),
        np.where(which, one.hidden, other.hidden),
        np.where(which, one.moved, other.moved),
    )


def at_most(found: Expansion, function: Callable[..., Any], *arguments: Expansion) -> Expansion:
    """The constant instead, where less is hidden in all that a function may be."""
    if not (found.hidden > 0).any():
        return found
    flat = _flat(as_range(function(*(a.range for a in arguments))), found.moved)
    better = reduce(np.logical_and, [np.isfinite(a.rest) for a in arguments], flat.hidden < found.hidden)
    return chosen(better, flat, found)


def product(a: Expansion, b: Expansion) -> Expansion:
    """A b, by its series alone."""
    whole = np.zeros((2 * ORDER + 1, *np.broadcast_shapes(a.rest.shape, b.rest.shape)))
    for k, each in enumerate(a.terms):
        whole[k : k + ORDER + 1] += each * b.terms
    terms, beyond = whole[: ORDER + 1], np.abs(whole[ORDER + 1 :]).sum(axis=0)
    sizes = np.abs(a.terms[0]), np.abs(b.terms[0])
    together = a.turn * (sizes[1] + b.turn) + sizes[0] * b.turn - beyond
    off, size = beyond + a.rest * b.size + b.rest * (a.size - a.rest), a.size * b.size
    hidden = np.where(beyond * RESOLVED <= together, a.hidden * b.size + b.hidden * a.size, off)
    return _known(terms, off + size * ROUNDED, hidden, sizes[0] * b.moved + a.moved * sizes[1])


def reciprocal(a: Expansion) -> Expansion:
    """1/a."""
    v = 1 / a.terms[0]
    return composed(a, (v, -(v**2), v**3, -(v**4)), np.abs(v) * geometric(a.reach * np.abs(v)))


def geometric(share: Array) -> Array:
    """The powers of a share from the fourth on."""
    return np.where(share < 1, share**4 / (1 - share), np.inf)


def composed(a: Expansion, c: Sequence[Array], further: Array) -> Expansion:
    """A function with coefficients around the value of an expansion; ``further`` bounds its powers from the fourth."""
    _, first, second, third = a.terms
    by, one = a.reach, np.abs(first)
    slope, bend, twist = (np.abs(each) for each in c[1:])
    together = by * (slope + by * (bend + by * twist))
    beyond = bend * (by * by - one * (one + 2 * np.abs(second))) + twist * (by**3 - one**3) + further
    off, gain = slope * a.rest + beyond, slope + by * (2 * bend + 3 * by * twist)
    hidden = np.where(beyond * RESOLVED <= together, a.hidden * gain, off)
    terms = [
        c[0],
        c[1] * first,
        c[1] * second + c[2] * first * first,
        c[1] * third + first * (2 * c[2] * second + c[3] * first * first),
    ]
    return _known(np.stack(terms), off + (np.abs(c[0]) + together) * ROUNDED, hidden, slope * a.moved)


NOTHING_KNOWN = Expansion(np.zeros((ORDER + 1, 1)), np.full(1, np.inf), np.full(1, np.inf), np.zeros(1))
