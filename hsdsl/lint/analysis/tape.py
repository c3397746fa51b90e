# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Expressions as lists of operations, every shared part once, that run on arrays of numbers and of intervals."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from hsdsl.functions import FUNCTIONS
from hsdsl.lint.analysis import intervals
from hsdsl.lint.analysis.intervals import Array, Intervals

_NAMES: dict[Any, str] = {entry[0]: name for name, entry in FUNCTIONS.items() if name != "sqrt"}
_NAMES |= {sp.Abs: "abs", sp.sign: "sign", sp.floor: "floor", sp.Min: "min", sp.Max: "max"}  # where SymPy makes its own
_MANY = 10_000
_NOTHING = (np.nan, -np.inf, np.inf)  # of what is no function of the language, nothing is known


@dataclass(frozen=True)
class Step:
    """One operation: its name, the earlier results it takes, and a number it may need."""

    operation: str
    arguments: tuple[int, ...]
    value: Any = None


class Tape:
    """Some expressions of the same names.

    Parameters
    ----------
    expressions : iterable of sympy.Expr
        What to compute; they hold nothing but ``symbols``, numbers and the language's functions.
    symbols : sequence of sympy.Symbol
        The columns of the points and boxes.
    """

    def __init__(self, expressions: Iterable[Any], symbols: Sequence[Any]) -> None:
        self.steps: list[Step] = [Step("name", (), i) for i in range(len(symbols))]
        self._known: dict[Any, int] = {symbol: i for i, symbol in enumerate(symbols)}
        self.results = [self._of(expr) for expr in expressions]

    def __len__(self) -> int:
        return len(self.steps)

    def at(self, points: Array) -> Array:
        """The values at points: array (n, symbols) to array (results, n); NaN where there is no real value."""
        values: list[Array] = []
        with intervals.silent():
            for step in self.steps:
                values.append(_number(step, values, points))
            rows = [np.broadcast_to(values[i], (len(points),)) for i in self.results]
        return np.array(rows).reshape(len(rows), len(points))

    def over(self, low: Array, high: Array) -> Intervals:
        """Bounds over boxes: arrays (n, symbols) to arrays (results, n)."""
        values: list[Intervals] = []
        shape = (len(low),)
        with intervals.silent():
            for step in self.steps:
                values.append(_interval(step, values, low, high))
            ends = [
                np.array([np.broadcast_to(end(values[i]), shape) for i in self.results]).reshape(-1, len(low))
                for end in (lambda v: v.low, lambda v: v.high)
            ]
        return Intervals(*ends)

    def _of(self, expr: Any) -> int:
        found = self._known.get(expr)
        if found is None:
            found = self._known[expr] = self._make(expr)
        return found

    def _add(self, operation: str, *arguments: int, value: Any = None) -> int:
        self.steps.append(Step(operation, arguments, value))
        return len(self.steps) - 1

    def _make(self, expr: Any) -> int:
        if expr.is_Atom:
            return self._add("number", value=_enclosed(expr))
        if expr.is_Add or expr.is_Mul:
            result, *rest = map(self._of, expr.args)
            for part in rest:
                result = self._add("add" if expr.is_Add else "multiply", result, part)
            return result
        if expr.is_Pow:
            base, exponent = expr.args
            if exponent.is_Integer:
                return self._add("power", self._of(base), value=int(exponent))
            if abs(exponent) == sp.Rational(1, 2):
                root = self._add("sqrt", self._of(base))
                return root if exponent > 0 else self._add("power", root, value=-1)
            if base is sp.E:
                return self._add("exp", self._of(exponent))
            return self._add("real power", self._of(base), self._of(exponent))
        if expr.func not in _NAMES:
            return self._add("number", value=_NOTHING)
        name, parts = _NAMES[expr.func], [self._of(argument) for argument in expr.args]
        while name in ("min", "max") and len(parts) > 2:
            parts = [self._add(name, *parts[:2]), *parts[2:]]
        return self._add(name, *parts)


def _number(step: Step, values: Sequence[Array], points: Array) -> Array:
    arguments = [values[i] for i in step.arguments]
    match step.operation:
        case "name":
            return points[:, step.value]
        case "number":
            return np.array([step.value[0]])
        case "add":
            return arguments[0] + arguments[1]
        case "multiply":
            return arguments[0] * arguments[1]
        case "power":
            return arguments[0] ** float(step.value)
        case "real power":
            return arguments[0] ** arguments[1]
    return intervals.FUNCTIONS[step.operation][0](*arguments)


def _interval(step: Step, values: Sequence[Intervals], low: Array, high: Array) -> Intervals:
    arguments = [values[i] for i in step.arguments]
    match step.operation:
        case "name":
            return Intervals(low[:, step.value], high[:, step.value])
        case "number":
            return intervals.constant(*step.value)
        case "add":
            return intervals.add(*arguments)
        case "multiply":
            return intervals.multiply(*arguments)
        case "power":
            return intervals.integer_power(arguments[0], step.value)
        case "real power":
            return intervals.real_power(*arguments)
    return intervals.FUNCTIONS[step.operation][1](*arguments)


def _enclosed(expr: Any) -> tuple[float, float, float]:
    """The nearest double, and doubles on both sides; all three the same where it is exact."""
    bounds = enclosure(expr)
    if bounds is None:
        return _NOTHING
    low, high = bounds
    nearest = _double(low + (high - low) / 2)
    if low == high and np.isfinite(nearest) and Fraction(nearest) == low:
        return nearest, nearest, nearest
    return nearest, float(np.nextafter(nearest, -np.inf)), float(np.nextafter(nearest, np.inf))


def enclosure(expr: Any) -> tuple[Fraction, Fraction] | None:
    """Exact bounds of a number; for pi and the like of thirty digits; None where there is no finite real number."""
    if expr.is_Rational:
        value = Fraction(int(expr.p), int(expr.q))
        return value, value
    number = sp.N(expr, 40)
    if not (number.is_Float and number.is_finite):
        return None
    with mpmath.workdps(40):
        value = Fraction(int(mpmath.floor(mpmath.mpf(number) * 10**32)), 10**32)
    return value, value + Fraction(2, 10**32)


def _double(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf") if value > 0 else float("-inf")


def too_large(expressions: Iterable[Any], most: int) -> bool:
    """Whether expressions have more than ``most`` different parts."""
    expressions = list(expressions)
    if sum(map(parts_of, expressions)) <= most:
        return False
    seen: set[Any] = set()
    waiting = list(expressions)
    while waiting:
        expr = waiting.pop()
        if expr not in seen:
            seen.add(expr)
            if len(seen) > most:
                return True
            waiting.extend(expr.args)
    return False


@lru_cache(maxsize=20_000)
def parts_of(expr: Any) -> int:
    """At least as many as an expression has different parts, counted as a tree; at most :data:`_MANY`."""
    found, waiting = 0, [expr]
    while waiting and found < _MANY:
        found += 1
        waiting.extend(waiting.pop().args)
    return found


def at_point(expr: Any, point: Mapping[Any, float]) -> float:
    """One expression at one point."""
    symbols = list(point)
    return float(Tape([expr], symbols).at(np.array([[float(point[s]) for s in symbols]]))[0, 0])
