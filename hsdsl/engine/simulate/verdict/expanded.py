"""Functions of expansions: an arithmetic for generated routines, and what they are along parts of steps.

Each has its series around the middle of a part, with a bound of what follows; the others are made of these. As
``runtime/c/expansions.c`` does, and with the functions that it leaves open.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import partial, reduce
from typing import Any

import numpy as np

from hsdsl.base.numbers.arithmetic import Arithmetic
from hsdsl.base.numbers.enclosures import ENCLOSED, Range
from hsdsl.engine.simulate.verdict.expansions import (
    NOTHING_KNOWN,
    Expansion,
    at_most,
    chosen,
    composed,
    geometric,
    line,
    product,
    reciprocal,
)

UNBOUNDED = frozenset({"sqrt"})  # its slope at the end of its domain: no range shows that


def _exponential(a: Expansion) -> Expansion:
    here, by = np.exp(a.terms[0]), a.deviation
    return composed(a, (here, here, here / 2, here / 6), by**4 / 24 * here * np.exp(by))


def _logarithm(a: Expansion) -> Expansion:
    value = np.where(a.terms[0] > 0, a.terms[0], np.nan)
    return composed(
        a, (np.log(value), 1 / value, -1 / value**2 / 2, 1 / value**3 / 3), geometric(a.deviation / value) / 4
    )


def _root(a: Expansion) -> Expansion:
    """Of the binomials of 1/2 the fourth, 5/128, is the largest from there on."""
    value = np.where(a.terms[0] > 0, a.terms[0], np.nan)
    s = np.sqrt(value)
    coefficients = s, s / value / 2, -s / value**2 / 8, s / value**3 / 16
    return composed(a, coefficients, s * 5 / 128 * geometric(a.deviation / value))


def _sine(a: Expansion, quarter: int = 0) -> Expansion:
    sine, cosine = np.sin(a.terms[0]), np.cos(a.terms[0])
    here, across = (cosine, -sine) if quarter else (sine, cosine)
    return composed(a, (here, across, -here / 2, -across / 6), a.deviation**4 / 24)


def _angle(a: Expansion) -> Expansion:
    x = a.terms[0]
    m = 1 / (1 + x * x)
    return composed(a, (np.arctan(x), m, -x * m * m, (x * x - 1 / 3) * m**3), geometric(a.deviation * np.sqrt(m)) / 4)


def _odd(function: Callable[[Expansion], Expansion]) -> Callable[[Expansion], Expansion]:
    """An odd function, by that of what is nowhere negative in the middle."""

    def expand(a: Expansion) -> Expansion:
        minus = a.terms[0] < 0
        found = function(chosen(minus, -a, a))
        return chosen(minus, -found, found)

    return expand


def _hyperbolic(a: Expansion) -> Expansion:
    return product(_TWO, reciprocal(_ONE + _exponential(product(-_TWO, a)))) - _ONE


def _arc_sine(a: Expansion) -> Expansion:
    return FUNCTIONS["atan"](a / _root((_ONE - a) * (_ONE + a)))


def _turned(y: Expansion, x: Expansion) -> Expansion:
    """atan2: by how much it turns from the middle; it has no series where it may jump."""
    jumps = (x.range.low <= 0) & (y.range.low <= 0) & (y.range.high >= 0)
    v, u = line(y.terms[0], 0.0), line(x.terms[0], 0.0)
    along = x * u + y * v
    found = line(np.arctan2(y.terms[0], x.terms[0]), 0.0) + FUNCTIONS["atan"]((y * u - x * v) / along)
    return chosen(jumps | ~(along.range.low > 0), NOTHING_KNOWN, found)


def _power(base: Expansion, exponent: Expansion) -> Expansion:
    whole = float(exponent.terms[0, 0])
    if exponent.terms.shape[1] > 1 or not (0 < whole < np.inf and whole % 1 == 0):
        return FUNCTIONS["exp"](exponent * FUNCTIONS["log"](base))
    return at_most(_repeated(product, int(whole), base), partial(_repeated, Range.__mul__, int(whole)), base)


def _repeated(times: Callable[[Any, Any], Any], exponent: int, base: Any) -> Any:
    """A product of equal factors, as in C."""
    if exponent == 1:
        return base
    half = _repeated(times, exponent // 2, base)
    square = times(half, half)
    return times(square, base) if exponent % 2 else square


def _unknown(_: Expansion) -> Expansion:
    """A function of steps: constant between them."""
    return NOTHING_KNOWN


def _absolute(a: Expansion) -> Expansion:
    return chosen(np.abs(a.terms[0]) > a.deviation, chosen(a.terms[0] < 0, -a, a), NOTHING_KNOWN)


def _least(one: Expansion, other: Expansion) -> Expansion:
    apart, more = one.deviation + other.deviation, other.terms[0] - one.terms[0]
    return chosen(np.abs(more) > apart, chosen(more > 0, one, other), NOTHING_KNOWN)


def _most(one: Expansion, other: Expansion) -> Expansion:
    return -_least(-one, -other)


def _below(number: Expansion, bound: Expansion, one: Expansion, other: Expansion) -> Expansion:
    more, apart = bound.terms[0] - number.terms[0], number.deviation + bound.deviation
    return chosen((more > apart) | (more <= -apart), chosen(more > 0, one, other), NOTHING_KNOWN)


def _bounded(name: str, series: Callable[..., Expansion]) -> Callable[..., Expansion]:
    """A function by its series, or all that it may be where less is hidden in that."""

    def expand(*arguments: Expansion) -> Expansion:
        found = series(*arguments)
        return found if name in UNBOUNDED else at_most(found, ENCLOSED.functions[name], *arguments)

    return expand


def _folded(name: str, series: Callable[[Expansion, Expansion], Expansion]) -> Callable[..., Expansion]:
    return lambda *arguments: reduce(_bounded(name, series), arguments)


def _constant(value: Fraction) -> Expansion:
    return line(float(value), 0.0)


_ONE, _TWO, _HALF = (_constant(Fraction(each)) for each in ("1", "2", "1/2"))
_PI, _E = line(np.pi, 0.0), line(np.e, 0.0)
_OF_ONE: dict[str, Callable[[Expansion], Expansion]] = {
    "exp": _exponential,
    "log": _logarithm,
    "sqrt": _root,
    "sin": _sine,
    "cos": partial(_sine, quarter=1),
    "tan": lambda a: FUNCTIONS["sin"](a) / FUNCTIONS["cos"](a),
    "atan": _angle,
    "tanh": _odd(_hyperbolic),
    "asin": _arc_sine,
    "acos": lambda a: _PI * _HALF - _arc_sine(a),
    "sinh": lambda a: (FUNCTIONS["exp"](a) - FUNCTIONS["exp"](-a)) * _HALF,
    "cosh": lambda a: (FUNCTIONS["exp"](a) + FUNCTIONS["exp"](-a)) * _HALF,
    "asinh": _odd(lambda a: FUNCTIONS["log"](a + _root(a * a + _ONE))),
    "acosh": lambda a: FUNCTIONS["log"](a + _root(a * a - _ONE)),
    "atanh": lambda a: FUNCTIONS["log"]((_ONE + a) / (_ONE - a)) * _HALF,
    "abs": _absolute,
    **dict.fromkeys(("sign", "floor", "heaviside"), _unknown),
}
FUNCTIONS: dict[str, Any] = {name: _bounded(name, series) for name, series in _OF_ONE.items()} | {
    "atan2": _bounded("atan2", _turned),
    "pow": _power,
    "below": _bounded("below", _below),
    "min": _folded("min", _least),
    "max": _folded("max", _most),
    "pi": _PI,
    "e": _E,
    "nan": NOTHING_KNOWN,
}

EXPANDED = Arithmetic(
    name="expansion",
    digits=None,
    bits=53,
    unit=2.0**-53,
    constant=_constant,
    isfinite=lambda value: bool(np.all(np.isfinite(value.remainder))),
    functions=FUNCTIONS,
)
