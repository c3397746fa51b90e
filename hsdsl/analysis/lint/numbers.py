# pyright: basic
"""Expressions as numbers at a point, to 200 bits: for rules that look at one state, and not at all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import sympy as sp
from sympy.logic.boolalg import BooleanFunction

from hsdsl.base.functions import FUNCTIONS
from hsdsl.language.expression import numeric
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.system import Mode, SampledInput, Surface

INSIDE, ON, BEYOND = -1, 0, 1
_DEEPEST = 4  # derivatives along the flow that are looked at
Number = Any  # an mpmath number; NaN where there is no value
Point = Mapping[sp.Symbol, Number]

ROUND_OFF = 32 * 2.0**-53  # of a surface, relative to its sides: the unit of float64 as in the meaning of a model
_OWN = ("sqrt", "select")  # made of other functions
_NAMES: dict[Any, str] = {function: name for name, (function, *_) in FUNCTIONS.items() if name not in _OWN}
_NAMES |= {sp.Abs: "abs"}
_COMPARED = {sp.Eq: "__eq__", sp.Ne: "__ne__", sp.Lt: "__lt__", sp.Le: "__le__", sp.Gt: "__gt__", sp.Ge: "__ge__"}


def evaluate(expr: Any, point: Point) -> Number:
    """The value of an expression; NaN where it has none, or where a symbol has no value at the point."""
    done: dict[Any, Number] = dict(point)

    def value(part: Any) -> Number:
        if part not in done:
            done[part] = _value(part, value)
        return done[part]

    return value(expr)


def holds(condition: Any, point: Point) -> bool | None:
    """Whether a condition holds at a point; None where a side has no value."""
    if condition is None or condition == sp.true:
        return True
    if condition == sp.false:
        return False
    if isinstance(condition, BooleanFunction):
        parts = [holds(part, point) for part in condition.args]
        if isinstance(condition, sp.Not):
            return None if parts[0] is None else not parts[0]
        decisive = isinstance(condition, sp.Or)
        if decisive in parts:
            return decisive
        return None if None in parts else not decisive
    left, right = (evaluate(side, point) for side in condition.args)
    if not (numeric.finite(left) and numeric.finite(right)):
        return None
    return bool(getattr(left, _COMPARED[type(condition)])(right))


def rational(value: Fraction | int) -> Number:
    """An exact number, rounded to 200 bits."""
    exact: Any = sp.Rational(Fraction(value).numerator, Fraction(value).denominator)
    return numeric.of_rational(exact)


def sample_at(given: SampledInput, time: Number, point: Point) -> Number:
    """The value of a sampled input just after a time."""
    times, values = ([_number(v, point) for v in row] for row in (given.times, given.values))
    last = max((i for i, t in enumerate(times) if t <= time), default=None)
    if last is None:
        return values[0]
    if given.hold == "zero" or last + 1 == len(times):
        return values[last]
    share = (time - times[last]) / (times[last + 1] - times[last])
    return values[last] + share * (values[last + 1] - values[last])


def _number(value: Any, point: Point) -> Number:
    return rational(value) if isinstance(value, Fraction) else evaluate(value, point)


def _value(expr: Any, value: Callable[[Any], Number]) -> Number:
    """The value of an expression from those of its parts."""
    if expr.is_Rational:
        return numeric.of_rational(expr)
    if expr == sp.pi:
        return numeric.PI
    if expr == sp.E:
        return numeric.apply("exp", [numeric.of_rational(sp.S.One)])
    parts = [value(part) for part in expr.args]
    if not parts or not all(numeric.finite(part) for part in parts):
        return numeric.NAN
    if expr.is_Add:
        return numeric.total(parts)
    if expr.is_Mul:
        return numeric.product(parts)
    if expr.is_Pow:
        return numeric.power(*parts)
    name = _NAMES.get(type(expr))
    return numeric.NAN if name is None else numeric.apply(name, parts)


def side(surface: Surface, point: Point) -> int | None:
    """Whether a point is inside, on (within round-off) or beyond a surface; None where it has no value there."""
    residual = evaluate(surface.residual, point)
    if not numeric.finite(residual):
        return None
    size = abs(evaluate(surface.left, point)) + abs(evaluate(surface.right, point))
    if abs(residual) <= ROUND_OFF * size:
        return ON
    return BEYOND if residual > 0 else INSIDE


def leaves(mode: Mode, surface: Surface, point: Point) -> bool | None:
    """Whether the flow carries a point of a surface beyond it; None where low derivatives do not decide it.

    The sign is that of the first of L_f r, L_f^2 r, ... that is not 0 within round-off. Sampled inputs
    count as constant.
    """
    rate: Any = surface.residual
    for _ in range(_DEEPEST):
        rate = lie_derivative(rate, mode.vector_field)
        value = evaluate(rate, point)
        if not numeric.finite(value):
            return None
        if abs(value) > ROUND_OFF * _size(rate, point):
            return bool(value > 0)
    return None


def _size(expr: Any, point: Point) -> Any:
    """The sum of the magnitudes of the terms."""
    return sum(abs(evaluate(term, point)) for term in sp.Add.make_args(sp.expand(expr)))
