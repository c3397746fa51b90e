# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Straight-line programs: expressions as operations, shared parts once, on arrays of numbers and of intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from operator import add, mul
from typing import Any

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.numbers.enclosures import RESTRICTED, Range, hull, whole_power

_NAMES: dict[Any, str] = {entry[0]: name for name, entry in FUNCTIONS.items() if name not in ("sqrt", "select")}
_NAMES |= {sp.Abs: "abs", sp.sign: "sign", sp.floor: "floor", sp.Min: "min", sp.Max: "max"}  # where SymPy makes its own
_NUMPY = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "min": "minimum", "max": "maximum"}
_NUMPY |= {"asinh": "arcsinh", "acosh": "arccosh", "atanh": "arctanh", "pow": "power"}
_MANY = 10_000
_NOTHING = (np.nan, -np.inf, np.inf)  # of what is no function of the language, nothing is known
Array = NDArray[Any]  # of numbers, or of truth values
Function = Callable[..., Any]


class StraightLine:
    """Some expressions of ``symbols``, the columns of points and boxes, numbers and the language's functions."""

    def __init__(self, expressions: Iterable[Any], symbols: Sequence[Any]) -> None:
        self._operations: list[tuple[tuple[int, ...], Function, Function]] = []  # arguments; on numbers, on intervals
        self._names = len(symbols)
        self._known: dict[Any, int] = {symbol: i for i, symbol in enumerate(symbols)}
        self.results = [self._of(expr) for expr in expressions]

    def __len__(self) -> int:
        return self._names + len(self._operations)

    def at(self, points: Array) -> Array:
        """The values at points: array (n, symbols) to array (results, n); NaN where there is no real value."""
        with quiet():
            return self._rows(self._run(list(points.T), 1), len(points))

    def over(self, low: Array, high: Array) -> Range:
        """Bounds over boxes: arrays (n, symbols) to arrays (results, n)."""
        with quiet():
            values: list[Range] = self._run(hull(low, high), 2)
        return Range(*(self._rows([getattr(value, end) for value in values], len(low)) for end in ("low", "high")))

    def _run(self, values: list[Any], kind: int) -> list[Any]:
        for operation in self._operations:
            values.append(operation[kind](*(values[i] for i in operation[0])))
        return values

    def _rows(self, values: list[Any], count: int) -> Array:
        rows = [np.broadcast_to(values[i], count) for i in self.results]
        return np.array(rows).reshape(len(rows), count)

    def _of(self, expr: Any) -> int:
        found = self._known.get(expr)
        if found is None:
            found = self._known[expr] = self._make(expr)
        return found

    def _add(self, on_numbers: Function, on_intervals: Function, *arguments: int) -> int:
        self._operations.append((arguments, on_numbers, on_intervals))
        return len(self) - 1

    def _call(self, name: str, *arguments: int) -> int:
        return self._add(getattr(np, _NUMPY.get(name, name)), RESTRICTED[name], *arguments)

    def _number(self, nearest: float, low: float, high: float) -> int:
        return self._add(lambda: np.array([nearest]), lambda: Range(np.array([low]), np.array([high])))

    def _make(self, expr: Any) -> int:
        if expr.is_Atom:
            return self._number(*_enclosed(expr))
        if expr.is_Add or expr.is_Mul:
            result, *rest = map(self._of, expr.args)
            operation = add if expr.is_Add else mul
            for part in rest:
                result = self._add(operation, operation, result, part)
            return result
        if expr.is_Pow:
            return self._power(*expr.args)
        if expr.func not in _NAMES:
            return self._number(*_NOTHING)
        name, (result, *rest) = _NAMES[expr.func], [self._of(argument) for argument in expr.args]
        if name not in ("min", "max"):
            return self._call(name, result, *rest)
        for part in rest:
            result = self._call(name, result, part)
        return result

    def _power(self, base: Any, exponent: Any) -> int:
        if exponent.is_Integer:
            return self._whole_power(self._of(base), int(exponent))
        if abs(exponent) == sp.Rational(1, 2):
            root = self._call("sqrt", self._of(base))
            return root if exponent > 0 else self._whole_power(root, -1)
        if base is sp.E:
            return self._call("exp", self._of(exponent))
        return self._call("pow", self._of(base), self._of(exponent))

    def _whole_power(self, base: int, exponent: int) -> int:
        def on_intervals(x: Range) -> Range:
            power = whole_power(x, abs(exponent)) if abs(exponent) > 1 else x
            return power if exponent > 0 else RESTRICTED["reciprocal"](power)

        return self._add(lambda x: x ** float(exponent), on_intervals, base)


def quiet() -> Any:
    """NumPy without warnings: infinities and values that are no numbers are expected."""
    return np.errstate(all="ignore")


def _enclosed(expr: Any) -> tuple[float, float, float]:
    """The nearest double, and doubles on both sides; all three the same where it is exact."""
    bounds = enclosure(expr)
    if bounds is None:
        return _NOTHING
    low, high = bounds
    nearest = FLOAT64.constant(low + (high - low) / 2)
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
    return float(StraightLine([expr], symbols).at(np.array([[float(point[s]) for s in symbols]]))[0, 0])
