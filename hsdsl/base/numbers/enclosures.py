"""Interval arithmetic for generated routines, many boxes at once: what a formula can be anywhere in a box.

Every result contains every value that the formula takes there, rounding included: of single numbers it is one number
where nothing is rounded. Where it has no value somewhere in a box the result of `ENCLOSED` is everything, so that
nothing is concluded from it. `RESTRICTED` encloses the values that there are. A sum or a product of numbers that are
nowhere negative is nowhere negative.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial, reduce
from math import isfinite
from operator import add, mul
from typing import Any

import numpy as np

from hsdsl.base.numbers.arithmetic import Arithmetic
from hsdsl.base.numbers.bernstein import Array

ANGLE = 2.0**-49  # more than rounding makes of a number of turns, beside that number and 1
STEPS = 4  # units in the last place by which NumPy's functions may be wrong


class Undecided(ArithmeticError):
    """An inequality holds for some numbers of a range, and not for others."""


@dataclass(frozen=True, eq=False)
class Range:
    """The numbers from ``low`` to ``high``, element by element; comparisons are of all of them, or `Undecided`."""

    low: Any
    high: Any

    def __neg__(self) -> Range:
        return Range(-self.high, -self.low)

    def __add__(self, other: Any) -> Range:
        other = as_range(other)
        if (value := _exactly(add, self, other)) is not None:
            return value
        low, high = self.low + other.low, self.high + other.high
        wide = _outwards(low, high)
        return Range(np.where(low == 0, 0.0, wide.low), np.where(high == 0, 0.0, wide.high))  # a sum of 0 is exact

    def __sub__(self, other: Any) -> Range:
        return self + -as_range(other)

    def __mul__(self, other: Any) -> Range:
        other = as_range(other)
        if (value := _exactly(mul, self, other)) is not None:
            return value
        if other is self:
            return square(self)
        products = [x * y for x in (self.low, self.high) for y in (other.low, other.high)]
        low, high = reduce(np.minimum, products), reduce(np.maximum, products)
        if np.isnan(low).any():  # zero times an unbounded end
            products = [np.where(np.isnan(product), 0.0, product) for product in products]
            low, high = reduce(np.minimum, products), reduce(np.maximum, products)
        least, most = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
        if np.any(low == 0):
            alike = ((self.low >= 0) & (other.low >= 0)) | ((self.high <= 0) & (other.high <= 0))
            least = np.where(alike, np.maximum(least, 0.0), least)
            nothing = ((self.low == 0) & (self.high == 0)) | ((other.low == 0) & (other.high == 0))
            least, most = np.where(nothing, 0.0, least), np.where(nothing, 0.0, most)
        return Range(least, most)

    def __truediv__(self, other: Any) -> Range:
        other = as_range(other)
        if (value := _exactly(_quotient, self, other)) is not None:
            return value
        through_zero = (other.low <= 0) & (other.high >= 0)
        low, high = np.where(through_zero, 1.0, other.low), np.where(through_zero, 1.0, other.high)
        return _unless(through_zero, self * _outwards(1 / high, 1 / low))

    def __le__(self, other: Any) -> bool:
        other = as_range(other)
        return _decided(self.high <= other.low, self.low > other.high)

    def __lt__(self, other: Any) -> bool:
        other = as_range(other)
        return _decided(self.high < other.low, self.low >= other.high)

    def __ge__(self, other: Any) -> bool:
        return as_range(other) <= self

    def __gt__(self, other: Any) -> bool:
        return as_range(other) < self


def _exactly(operation: Callable[[Any, Any], Any], one: Range, other: Range) -> Range | None:
    """The result of an operation on two numbers that is not rounded; None where it is, or of more than two numbers."""
    if any(np.ndim(end) for end in (one.low, one.high, other.low, other.high)):
        return None
    a, b = float(one.low), float(other.low)
    if not (a == one.high and b == other.high and isfinite(a) and isfinite(b)) or (operation is _quotient and b == 0):
        return None
    value = operation(a, b)
    exact = isfinite(value) and operation(Fraction(a), Fraction(b)) == Fraction(value)
    return Range(value, value) if exact else None


def _quotient(a: Any, b: Any) -> Any:
    return a / b


def _decided(surely: Any, never: Any) -> bool:
    if np.all(surely):
        return True
    if np.all(never):
        return False
    raise Undecided


def as_range(value: Any) -> Range:
    """A range of its own, or of one number."""
    return value if isinstance(value, Range) else Range(value, value)


def hull(low: Array, high: Array) -> list[Range]:
    """The coordinates of boxes, rows of two (B, n) arrays."""
    return [Range(low[:, i], high[:, i]) for i in range(low.shape[1])]


def _outwards(low: Any, high: Any, steps: int = 1) -> Range:
    for _ in range(steps):
        low, high = np.nextafter(low, -np.inf), np.nextafter(high, np.inf)
    return Range(np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high))


def _corners(function: Callable[[Any, Any], Any], a: Range, b: Range, steps: int = 1) -> Range:
    """A function with its extremes at the corners of a box."""
    values = [function(x, y) for x in (a.low, a.high) for y in (b.low, b.high)]
    return _outwards(reduce(np.minimum, values), reduce(np.maximum, values), steps)


def square(x: Range) -> Range:
    """The square, which is nowhere negative."""
    a, b = x.low * x.low, x.high * x.high
    least = np.where((x.low <= 0) & (x.high >= 0), 0.0, np.minimum(a, b))
    low = _outwards(least, np.maximum(a, b))
    return Range(np.maximum(low.low, 0.0), low.high)


def _unless(undefined: Any, known: Range) -> Range:
    return Range(np.where(undefined, -np.inf, known.low), np.where(undefined, np.inf, known.high))


def _rising(
    function: Any, least: float = -np.inf, most: float = np.inf, bottom: float = -np.inf
) -> Callable[[Any], Range]:
    """An increasing function, defined between two numbers, and nowhere below ``bottom``."""

    def enclose(value: Any) -> Range:
        x = as_range(value)
        outside = (x.low < least) | (x.high > most)
        low, high = np.clip(x.low, least, most), np.clip(x.high, least, most)
        found = _outwards(function(low), function(high), STEPS)
        return _unless(outside, Range(np.maximum(found.low, bottom), found.high))

    return enclose


def _sine(value: Any, quarter: float = 0.0) -> Range:
    """Sine or (``quarter`` = 1) cosine: 1 where a crest lies in the range, -1 where a trough does."""
    x = as_range(value)
    ends = [np.sin(v) if quarter == 0 else np.cos(v) for v in (x.low, x.high)]
    low, high = np.minimum(*ends), np.maximum(*ends)
    turns = _turns(x, 1 / (2 * np.pi), (1 - quarter) / 4)  # a crest at every whole number
    crest, trough = _holds_whole(*turns), _holds_whole(*(turn + 0.5 for turn in turns))
    found = _outwards(np.where(trough, -1.0, low), np.where(crest, 1.0, high), STEPS)
    lost = ~(np.isfinite(x.low) & np.isfinite(x.high))
    return Range(np.where(lost, -1.0, np.maximum(found.low, -1.0)), np.where(lost, 1.0, np.minimum(found.high, 1.0)))


def _turns(x: Range, each: float, less: float) -> tuple[Any, Any]:
    """How many turns an angle is, rounded outwards: the float ``each`` is off by less than two units, and so on."""
    low, high = x.low * each - less, x.high * each - less
    return low - ANGLE * (1 + np.abs(low)), high + ANGLE * (1 + np.abs(high))


def _holds_whole(low: Any, high: Any) -> Any:
    """Whether there is a whole number between, or may be."""
    return ~(np.floor(high) < np.ceil(low))


def _tangent(value: Any) -> Range:
    x = as_range(value)
    return _unless(_holds_whole(*_turns(x, 1 / np.pi, 0.5)), _outwards(np.tan(x.low), np.tan(x.high), STEPS))


def _absolute(value: Any) -> Range:
    x = as_range(value)
    least = np.where((x.low <= 0) & (x.high >= 0), 0.0, np.minimum(np.abs(x.low), np.abs(x.high)))
    return Range(least, np.maximum(np.abs(x.low), np.abs(x.high)))


def _arc_cosine(value: Any) -> Range:
    return _PI / 2.0 - _ARC_SINE(value)


def _cosh(value: Any) -> Range:
    x = _absolute(value)
    found = _outwards(np.cosh(x.low), np.cosh(x.high), STEPS)
    return Range(np.maximum(found.low, 1.0), found.high)


def _angle(y: Any, x: Any) -> Range:
    """atan2: its extremes are at corners, unless the box meets the half line where it jumps."""
    y, x = as_range(y), as_range(x)
    jumps = (x.low <= 0) & (y.low <= 0) & (y.high >= 0)
    found = _corners(np.arctan2, y, x, STEPS)
    return Range(np.where(jumps, -_PI.high, found.low), np.where(jumps, _PI.high, found.high))


def whole_power(base: Range, exponent: int) -> Range:
    """A positive whole power."""
    low, high = base.low**exponent, base.high**exponent
    if exponent % 2:
        found = _outwards(low, high, STEPS)
        below, above = np.maximum(found.low, 0.0), np.minimum(found.high, 0.0)
        return Range(np.where(base.low >= 0, below, found.low), np.where(base.high <= 0, above, found.high))
    through_zero = (base.low <= 0) & (base.high >= 0)
    found = _outwards(np.where(through_zero, 0.0, np.minimum(low, high)), np.maximum(low, high), STEPS)
    return Range(np.maximum(found.low, 0.0), found.high)


def _power(base: Any, exponent: Any) -> Range:
    b, e = as_range(base), as_range(exponent)
    if np.ndim(e.low) == 0 and e.low == e.high and e.low > 0 and e.low % 1 == 0:
        return whole_power(b, int(e.low))
    undefined = ~(b.low > 0)
    positive = Range(np.where(undefined, 1.0, b.low), np.where(undefined, 1.0, b.high))
    return _unless(undefined, _corners(np.power, positive, e, STEPS))


def _extreme(function: Callable[[Any, Any], Any]) -> Callable[..., Range]:
    """The smaller or the larger of several."""

    def enclose(*values: Any) -> Range:
        ranges = [as_range(v) for v in values]
        return Range(reduce(function, [r.low for r in ranges]), reduce(function, [r.high for r in ranges]))

    return enclose


def _constant(value: Fraction) -> Range:
    nearest = float(value)
    return Range(nearest, nearest) if Fraction(nearest) == value else _outwards(nearest, nearest)


def _below(number: Any, bound: Any, one: Any, other: Any) -> Range:
    """Choose between two numbers, element by element; both where that is undecided."""
    s, c, a, b = map(as_range, (number, bound, one, other))
    never: Any = s.low >= c.high
    surely: Any = s.high < c.low
    least, most = np.minimum(a.low, b.low), np.maximum(a.high, b.high)
    return Range(np.select([never, surely], [b.low, a.low], least), np.select([never, surely], [b.high, a.high], most))


def _step(function: Callable[[Any], Any]) -> Callable[[Any], Range]:
    """An increasing function that needs no rounding."""
    return lambda value: Range(function(as_range(value).low), function(as_range(value).high))


_PI = _outwards(np.pi, np.pi)
_ARC_SINE = _rising(np.arcsin, -1.0, 1.0)

ENCLOSED = Arithmetic(
    name="enclosure",
    digits=None,
    bits=53,
    unit=2.0**-53,
    constant=_constant,
    isfinite=lambda value: bool(np.all(np.isfinite(value.low) & np.isfinite(value.high))),
    functions={
        "sinh": _rising(np.sinh),
        "tanh": _rising(np.tanh, bottom=-1.0),
        "exp": _rising(np.exp, bottom=0.0),
        "atan": _rising(np.arctan),
        "asinh": _rising(np.arcsinh),
        "asin": _ARC_SINE,
        "acos": _arc_cosine,
        "acosh": _rising(np.arccosh, 1.0, bottom=0.0),
        "atanh": _rising(np.arctanh, -1.0, 1.0),
        "log": _rising(np.log, 0.0),
        "sqrt": _rising(np.sqrt, 0.0, bottom=0.0),
        "sin": _sine,
        "cos": partial(_sine, quarter=1.0),
        "tan": _tangent,
        "atan2": _angle,
        "cosh": _cosh,
        "pow": _power,
        "abs": _absolute,
        "min": _extreme(np.minimum),
        "max": _extreme(np.maximum),
        "sign": _step(np.sign),
        "floor": _step(np.floor),
        "below": _below,
        "heaviside": _step(lambda x: 0.5 * (1.0 + np.sign(x))),
        "pi": _PI,
        "e": _outwards(np.e, np.e),
        "nan": Range(-np.inf, np.inf),
    },
)  # fmt: skip


def _may_jump(name: str, values: Sequence[Range]) -> Any:
    one, other = values[0], values[min(1, len(values) - 1)]
    match name:
        case "sign" | "heaviside":
            return np.sign(one.low) != np.sign(one.high)
        case "floor":
            return np.floor(one.low) != np.floor(one.high)
        case "atan2":
            return (other.low <= 0) & (one.low <= 0) & (one.high >= 0)
        case "below":
            return (one.low < other.high) & (one.high >= other.low)
        case _:
            return False


def _continuous(name: str, function: Callable[..., Range]) -> Callable[..., Range]:
    """The same function; everything where it may jump, and of what has no bound."""

    def enclose(*values: Any) -> Range:
        ranges = [as_range(value) for value in values]
        known: Any = reduce(np.logical_and, [r.high - r.low < np.inf for r in ranges])
        return _unless(np.logical_or(~np.asarray(known), _may_jump(name, ranges)), function(*values))

    return enclose


CONTINUOUS = replace(
    ENCLOSED,
    name="continuous",
    functions={name: f if isinstance(f, Range) else _continuous(name, f) for name, f in ENCLOSED.functions.items()},
)


def _restricted(name: str, least: float, most: float) -> Callable[[Any], Range]:
    """A function over the part of a box between the ends of its domain; everything where that is empty."""

    def enclose(value: Any) -> Range:
        x = as_range(value)
        inside = Range(np.clip(x.low, least, most), np.clip(x.high, least, most))
        return _unless((x.high < least) | (x.low > most), ENCLOSED.functions[name](inside))

    return enclose


def _power_of_positive(base: Any, exponent: Any) -> Range:
    b = as_range(base)
    found = _corners(np.power, Range(np.maximum(b.low, 0.0), np.maximum(b.high, 0.0)), as_range(exponent), STEPS)
    return Range(np.maximum(found.low, 0.0), found.high)


def _reciprocal(value: Any) -> Range:
    """1/x, which is unbounded towards zero; everything where zero lies inside."""
    x = as_range(value)
    positive, negative = x.low >= 0, x.high <= 0
    found = _outwards(1 / np.where(x.high == 0, -0.0, x.high), 1 / np.where(x.low == 0, 0.0, x.low))
    below, above = np.maximum(found.low, 0.0), np.minimum(found.high, 0.0)
    known = Range(np.where(positive, below, found.low), np.where(negative, above, found.high))
    return _unless(positive == negative, known)


RESTRICTED: dict[str, Callable[..., Range]] = {
    **ENCLOSED.functions,
    **{name: _restricted(name, -1.0, 1.0) for name in ("asin", "acos", "atanh")},
    **{name: _restricted(name, 0.0, np.inf) for name in ("log", "sqrt")},
    "acosh": _restricted("acosh", 1.0, np.inf),
    "pow": _power_of_positive,
    "reciprocal": _reciprocal,
}
