"""Sums of terms c s^n exp(r s), the solutions of linear flows, with their derivatives and bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from references.interpolation import Number, Stretch, Vector, mp

Function = Callable[[Number], Number]


@dataclass(frozen=True)
class Terms:
    """The real part of a sum of c s^n exp(r s), over triples (c, n, r); s is the time since a start."""

    triples: tuple[tuple[Number, int, Number], ...]

    def __call__(self, s: Number) -> Number:
        """The value at s."""
        return mp.re(mp.fsum(c * s**n * mp.exp(r * s) for c, n, r in self.triples))

    def __add__(self, other: Terms) -> Terms:
        return Terms(self.triples + other.triples)

    def derivative(self, order: int = 1) -> Terms:
        """The derivative of an order."""
        if order == 0:
            return self
        rises = [(c * r, n, r) for c, n, r in self.triples if r != 0]
        falls = [(c * n, n - 1, r) for c, n, r in self.triples if n > 0]
        return Terms((*rises, *falls)).derivative(order - 1)

    def bound(self, length: Number) -> Number:
        """A bound on the absolute value over [0, length]."""
        return mp.fsum(abs(c) * length**n * mp.exp(max(0, mp.re(r)) * length) for c, n, r in self.triples)


def polynomial(*coefficients: Any) -> Terms:
    """c0 + c1 s + c2 s^2 + ..."""
    return Terms(tuple((mp.convert(c), n, mp.zero) for n, c in enumerate(coefficients)))


def exponential(limit: Any, rate: Any, start: Any) -> Terms:
    """From ``start`` to ``limit``, the distance growing or decaying as exp(rate s)."""
    return Terms(((mp.convert(limit), 0, mp.zero), (mp.convert(start) - limit, 0, mp.convert(rate))))


def wave(w: Any, x: Any, v: Any, centre: Any = 0) -> Terms:
    """The solution of x'' = -w^2 (x - centre) from position x and speed v."""
    amplitude = mp.mpc(mp.convert(x) - centre, -mp.convert(v) / w)
    return Terms(((mp.convert(centre), 0, mp.zero), (amplitude, 0, mp.mpc(0, w))))


def stretch(
    mode: str,
    start: Number,
    end: Number,
    functions: Sequence[Terms],
    edge: str | None = None,
    *,
    last: Vector | None = None,
    alternatives: tuple[str, ...] = (),
) -> Stretch:
    """The stretch of these functions of the time since ``start``; ``last`` replaces the values at the end."""

    def at(t: Number) -> Vector:
        return tuple(f(t - start) for f in functions)

    @cache
    def bounds(order: int) -> Vector:
        return tuple(f.derivative(order).bound(end - start) for f in functions)

    return Stretch(mode, start, end, at(start), last or at(end), at, bounds, edge, alternatives)


def root(function: Function, low: Number, high: Number) -> Number:
    """The root of a function that changes its sign between two times."""
    return mp.findroot(function, (low, high), solver="anderson", tol=mp.mpf(10) ** (-2 * mp.dps + 20))
