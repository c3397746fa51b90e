"""Interval arithmetic on arrays: each operation returns bounds that contain every value it can take.

Rigour. Sums, products and quotients of doubles are correctly rounded, so one step outward with ``nextafter`` is
enough. The elementary functions of NumPy are taken to be within :data:`ULPS` units in the last place, and their
bounds are widened by as much. Values outside a function's real domain are left out: an expression without a real
value satisfies nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]  # of doubles, or of truth values
ULPS = 8
_RELATIVE = ULPS * 2.0**-52
_TINY = 1e-300
_TURN = 2 * np.pi


@dataclass(frozen=True)
class Intervals:
    """Many intervals ``[low, high]``; ends may be infinite."""

    low: Array
    high: Array


def constant(value: float, low: float, high: float) -> Intervals:
    """A number between two doubles; ``value`` is the nearest double, and exact where the three agree."""
    ends = (low, high) if low < high else (value, value)
    return Intervals(np.array(ends[:1]), np.array(ends[1:]))


def _hull(low: Array, high: Array) -> Intervals:
    """Ends that are no numbers (infinity less infinity) know nothing."""
    bad = np.isnan(low) | np.isnan(high)
    return Intervals(np.where(bad, -np.inf, low), np.where(bad, np.inf, high))


def _down(x: Array) -> Array:
    return np.nextafter(x, -np.inf)


def _up(x: Array) -> Array:
    return np.nextafter(x, np.inf)


def _widened(low: Array, high: Array) -> Intervals:
    return _hull(low - np.abs(low) * _RELATIVE - _TINY, high + np.abs(high) * _RELATIVE + _TINY)


def add(a: Intervals, b: Intervals) -> Intervals:
    """The sum. Of two that are nowhere negative it is nowhere negative."""
    low, high = a.low + b.low, a.high + b.high
    exact_low, exact_high = (a.low == 0) | (b.low == 0), (a.high == 0) | (b.high == 0)
    return _hull(np.where(exact_low, low, _down(low)), np.where(exact_high, high, _up(high)))


def negative(a: Intervals) -> Intervals:
    """The negative."""
    return Intervals(-a.high, -a.low)


def _product_end(x: Array, y: Array) -> Array:
    return np.where((x == 0) | (y == 0), 0.0, x * y)


def multiply(a: Intervals, b: Intervals) -> Intervals:
    """The product; infinity times nothing is nothing, as the ends stand for numbers."""
    corners = np.stack(
        np.broadcast_arrays(*(_product_end(x, y) for x in (a.low, a.high) for y in (b.low, b.high)))  # type: ignore[arg-type]
    )
    low, high = corners.min(axis=0), corners.max(axis=0)
    zero = (np.maximum(np.abs(a.low), np.abs(a.high)) == 0) | (np.maximum(np.abs(b.low), np.abs(b.high)) == 0)
    nowhere_negative = ((a.low >= 0) & (b.low >= 0)) | ((a.high <= 0) & (b.high <= 0))
    low, high = np.where(zero, 0.0, _down(low)), np.where(zero, 0.0, _up(high))
    return _hull(np.where(nowhere_negative, np.maximum(low, 0.0), low), high)


def inverse(a: Intervals) -> Intervals:
    """1/a; nothing is known where a contains 0 inside."""
    positive, below = a.low >= 0, a.high <= 0
    low = np.where(positive | below, _down(1.0 / np.where(a.high == 0, -0.0, a.high)), -np.inf)
    high = np.where(positive | below, _up(1.0 / np.where(a.low == 0, 0.0, a.low)), np.inf)
    low = np.where(positive, np.maximum(low, 0.0), low)
    high = np.where(below & ~positive, np.minimum(high, 0.0), high)
    both = positive & below
    return _hull(np.where(both, np.nan, low), np.where(both, np.nan, high))


def integer_power(a: Intervals, exponent: int) -> Intervals:
    """A to a whole number."""
    if exponent < 0:
        return inverse(integer_power(a, -exponent))
    if exponent == 0:
        return Intervals(np.ones_like(a.low), np.ones_like(a.high))
    low, high = a.low**exponent, a.high**exponent
    if exponent % 2 == 0:
        inside = (a.low < 0) & (a.high > 0)
        low, high = np.where(inside, 0.0, np.minimum(low, high)), np.maximum(low, high)
        wide = _widened(low, high)
        nothing = (a.low == 0) & (a.high == 0)  # not so where the power alone underflows to 0
        return Intervals(np.where(low == 0, 0.0, np.maximum(wide.low, 0.0)), np.where(nothing, 0.0, wide.high))
    wide = _widened(low, high)
    return Intervals(np.where(a.low == 0, 0.0, wide.low), np.where(a.high == 0, 0.0, wide.high))


def real_power(a: Intervals, b: Intervals) -> Intervals:
    """A to a power that is no whole number: a is not negative."""
    corners: Any = np.stack(
        np.broadcast_arrays(*(np.power(np.maximum(x, 0.0), y) for x in (a.low, a.high) for y in (b.low, b.high)))  # type: ignore[arg-type]
    )
    # a < 1 and a > 1 turn over in b, so 1 is a corner too where it lies inside
    one: Any = (a.low < 1) & (a.high > 1)
    low, high = corners.min(axis=0), corners.max(axis=0)
    ends: Any = np.where(one, np.minimum(low, 1.0), low), np.where(one, np.maximum(high, 1.0), high)
    wide = _widened(*ends)
    return Intervals(np.maximum(wide.low, 0.0), wide.high)


def _contains_turn(a: Intervals, phase: float) -> Array:
    """Whether phase + 2 pi k lies in an interval for some k; true where rounding makes that unsure."""
    slack = 1e-15 * (1 + np.maximum(np.abs(a.low), np.abs(a.high)))
    first, last = (a.low - slack - phase) / _TURN, (a.high + slack - phase) / _TURN
    return (np.floor(last) >= np.ceil(first)) | ~(np.abs(a.low) + np.abs(a.high) < 1e9)


def _wave(function: Callable[[Array], Array], crest: float) -> Callable[[Intervals], Intervals]:
    def bounds(a: Intervals) -> Intervals:
        finite = np.isfinite(a.low) & np.isfinite(a.high)
        ends = np.stack([function(np.where(finite, a.low, 0.0)), function(np.where(finite, a.high, 0.0))])
        low = np.where(_contains_turn(a, crest + np.pi) | ~finite, -1.0, ends.min(axis=0))
        high = np.where(_contains_turn(a, crest) | ~finite, 1.0, ends.max(axis=0))
        wide = _widened(low, high)
        return Intervals(np.maximum(wide.low, -1.0), np.minimum(wide.high, 1.0))

    return bounds


def tangent(a: Intervals) -> Intervals:
    """The tangent; nothing is known across a pole."""
    pole = _contains_turn(a, np.pi / 2) | _contains_turn(a, -np.pi / 2)
    wide = _widened(np.tan(np.where(pole, 0.0, a.low)), np.tan(np.where(pole, 0.0, a.high)))
    return Intervals(np.where(pole, -np.inf, wide.low), np.where(pole, np.inf, wide.high))


def _rising(
    function: Callable[[Array], Array], least: float = -np.inf, most: float = np.inf, bottom: float = -np.inf
) -> Callable[[Intervals], Intervals]:
    """Bounds of a rising function with the real domain [least, most] and no value below ``bottom``."""

    def bounds(a: Intervals) -> Intervals:
        outside = (a.high < least) | (a.low > most)
        wide = _widened(function(np.clip(a.low, least, most)), function(np.clip(a.high, least, most)))
        low = np.where(outside, -np.inf, np.maximum(wide.low, bottom))
        return _hull(low, np.where(outside, np.inf, wide.high))

    return bounds


def arc_cosine(a: Intervals) -> Intervals:
    """The arc cosine, which falls."""
    rising = _rising(lambda x: -np.arccos(x), -1.0, 1.0)(a)
    return negative(rising)


def hyperbolic_cosine(a: Intervals) -> Intervals:
    """The hyperbolic cosine, even."""
    size = absolute(a)
    wide = _widened(np.cosh(size.low), np.cosh(size.high))
    return Intervals(np.maximum(wide.low, 1.0), wide.high)


def two_argument_arc_tangent(y: Intervals, x: Intervals) -> Intervals:
    """The angle of (x, y); nothing better than [-pi, pi] where the cut behind the origin is met."""
    cut = (x.low <= 0) & (y.low <= 0) & (y.high >= 0)
    corners = np.stack(np.broadcast_arrays(*(np.arctan2(b, a) for b in (y.low, y.high) for a in (x.low, x.high))))  # type: ignore[arg-type]
    wide = _widened(corners.min(axis=0), corners.max(axis=0))
    whole = _up(np.array(np.pi))
    return Intervals(np.where(cut, -whole, wide.low), np.where(cut, whole, wide.high))


def absolute(a: Intervals) -> Intervals:
    """The absolute value."""
    inside = (a.low <= 0) & (a.high >= 0)
    ends = np.stack([np.abs(a.low), np.abs(a.high)])
    return Intervals(np.where(inside, 0.0, ends.min(axis=0)), ends.max(axis=0))


def sign(a: Intervals) -> Intervals:
    """-1, 0 or 1."""
    return Intervals(np.sign(a.low), np.sign(a.high))


def floor(a: Intervals) -> Intervals:
    """The largest integers not above."""
    return Intervals(np.floor(a.low), np.floor(a.high))


def minimum(a: Intervals, b: Intervals) -> Intervals:
    """The smaller one."""
    return Intervals(np.minimum(a.low, b.low), np.minimum(a.high, b.high))


def maximum(a: Intervals, b: Intervals) -> Intervals:
    """The larger one."""
    return Intervals(np.maximum(a.low, b.low), np.maximum(a.high, b.high))


# the language's functions: on numbers, and on intervals
FUNCTIONS: dict[str, tuple[Callable[..., Array], Callable[..., Intervals]]] = {
    "sin": (np.sin, _wave(np.sin, np.pi / 2)),
    "cos": (np.cos, _wave(np.cos, 0.0)),
    "tan": (np.tan, tangent),
    "asin": (np.arcsin, _rising(np.arcsin, -1.0, 1.0)),
    "acos": (np.arccos, arc_cosine),
    "atan": (np.arctan, _rising(np.arctan)),
    "atan2": (np.arctan2, two_argument_arc_tangent),
    "sinh": (np.sinh, _rising(np.sinh)),
    "cosh": (np.cosh, hyperbolic_cosine),
    "tanh": (np.tanh, _rising(np.tanh, bottom=-1.0)),
    "asinh": (np.arcsinh, _rising(np.arcsinh)),
    "acosh": (np.arccosh, _rising(np.arccosh, 1.0, bottom=0.0)),
    "atanh": (np.arctanh, _rising(np.arctanh, -1.0, 1.0)),
    "exp": (np.exp, _rising(np.exp, bottom=0.0)),
    "log": (np.log, _rising(np.log, 0.0)),
    "sqrt": (np.sqrt, _rising(np.sqrt, 0.0, bottom=0.0)),
    "abs": (np.abs, absolute),
    "sign": (np.sign, sign),
    "floor": (np.floor, floor),
    "min": (np.minimum, minimum),
    "max": (np.maximum, maximum),
}


def silent() -> Any:
    """NumPy without warnings: infinities and values that are no numbers are expected here."""
    return np.errstate(all="ignore")
