# pyright: basic
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false
"""Questions whether expressions have given signs at some point, and their decision by numbers.

A `StraightLine` evaluates expressions at many points and over many boxes, shared parts once. For a point, equations and
inequalities that do not hold are linearised by difference quotients and solved by the shortest step, from many starts
that are the same every time. A point that is found holds to round-off; that none is found means nothing. For a proof,
boxes where interval arithmetic excludes some constraint are thrown away, and others are halved. When none is left,
there is no point; when they get too many, nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from math import inf
from operator import add, mul
from typing import Any, Literal, NamedTuple

import mpmath
import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hsdsl.base.errors import Decided
from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.base.numbers.enclosures import RESTRICTED, Range, hull, whole_power

Relation = Literal["= 0", "<= 0", "< 0"]


class Constraint(NamedTuple):
    """An expression of states, inputs and time, and the sign it must have."""

    expr: Any
    relation: Relation

    def along(self, expr: Any) -> Constraint:
        """The same of another expression."""
        return Constraint(expr, self.relation)


def zero(expr: Any) -> Constraint:
    """The expression vanishes."""
    return Constraint(expr, "= 0")


def at_most_zero(expr: Any) -> Constraint:
    """The expression is not positive."""
    return Constraint(expr, "<= 0")


def negative(expr: Any) -> Constraint:
    return Constraint(expr, "< 0")


def positive(expr: Any) -> Constraint:
    return Constraint(-expr, "< 0")


class SearchRange(NamedTuple):
    """Bounds on a name's values that certainly hold (None: no bound), and the range in which points are searched."""

    low: Any | None
    high: Any | None
    search: tuple[float, float]
    typical: float

    @property
    def bounds(self) -> tuple[Any, Any]:
        """The ends, infinite where there are none."""
        return -inf if self.low is None else self.low, inf if self.high is None else self.high


Ranges = Mapping[Any, SearchRange]  # by name


@dataclass(frozen=True)
class Answer:
    """What is known of a question: whether there is such a point, how that is known, and a point.

    ``searched`` are, of `never`, the names that nothing bounds, and how far was looked; infinite where that is no
    limit.
    """

    verdict: Literal["never", "somewhere", "unknown"]
    decided: Decided = "sampled"
    point: Mapping[Any, float] = field(default_factory=dict)
    searched: tuple[tuple[Any, float, float], ...] = ()

    @property
    def somewhere(self) -> bool:
        """Whether a point is known."""
        return self.verdict == "somewhere"

    @property
    def never(self) -> bool:
        """Whether it is known that there is none, where it was looked."""
        return self.verdict == "never"


UNKNOWN = Answer("unknown")
NEVER = Answer("never", "symbolic")


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
    symbols = list(point)
    return float(StraightLine([expr], symbols).at(np.array([[float(point[s]) for s in symbols]]))[0, 0])


BATCH = 512
MOST_BOXES = 30_000
_SMALLEST = 2.0**-40
STARTS = 96
ROUNDS = 24
_TIGHT = 1e-10  # how far from zero an equation may end, relative to what it is made of
_ROOM = 1e-7  # how far from zero a strict inequality must end
_STEP = 1e-7


@dataclass(frozen=True)
class NewtonSearch:
    """Constraints as a program and what each has to be, and the box to search, with a typical point to start from."""

    program: StraightLine
    relations: tuple[Relation, ...]
    low: Array
    high: Array
    typical: Array

    def point(self) -> Array | None:
        """A point where everything holds, with plain coordinates where that is possible."""
        if not len(self.low):
            return np.zeros(0) if self._good(np.zeros((1, 0)))[0] else None
        with quiet():
            points = self._starts()
            for _ in range(ROUNDS):
                if self._good(points).any():
                    break
                points = self._moved(points)
            good = self._good(points)
        return self._plain(points[np.argmax(good)]) if good.any() else None

    def points(self) -> Array:
        """All the points that were found: array (n, names)."""
        with quiet():
            points = self._starts() if len(self.low) else np.zeros((1, 0))
            for _ in range(ROUNDS if len(self.low) else 0):
                points = np.where(self._good(points)[:, None], points, self._moved(points))
            return points[self._good(points)]

    def _starts(self) -> Array:
        generator = np.random.default_rng(0)
        points = self.low + (self.high - self.low) * generator.random((STARTS, len(self.low)))
        near = self.typical + (points - self.typical) * 10.0 ** -generator.integers(0, 4, (STARTS, 1))
        points = np.where((np.arange(STARTS) % 2 == 0)[:, None], points, near)
        points[0] = self.typical
        points[1] = 0.0
        points[2] = (self.low + self.high) / 2
        return np.clip(points, self.low, self.high)

    def _slopes(self, points: Array, values: Array) -> Array:
        """Difference quotients: array (constraints, n, names)."""
        columns: list[Array] = []
        for i in range(points.shape[1]):
            step = _STEP * np.maximum(np.abs(points[:, i]), 1e-3 * np.minimum(self.high[i] - self.low[i], 1e3) + 1e-12)
            step = np.where(points[:, i] + step > self.high[i], -step, step)
            moved = points.copy()
            moved[:, i] += step
            columns.append((self.program.at(moved) - values) / step)
        return np.stack(columns, axis=-1)

    def _good(self, points: Array) -> Array:
        with quiet():
            values = self.program.at(points)
            good = np.isfinite(values).all(axis=0)
            if not good.any() or not points.shape[1]:
                return good & self._hold(values, np.zeros_like(values))
            made_of = (np.abs(self._slopes(points, values)) * np.maximum(np.abs(points), 1e-3)).sum(axis=-1)
        return good & self._hold(values, np.where(np.isfinite(made_of), made_of, np.inf))

    def _hold(self, values: Array, made_of: Array) -> Array:
        equal, strict = _kinds(self.relations)
        near = np.where(equal, np.abs(values), values) <= _TIGHT * np.minimum(made_of, 1e6)
        good: Any = np.where(strict, values < -_ROOM * made_of, near)
        return good.all(axis=0)

    def _moved(self, points: Array) -> Array:
        values = self.program.at(points)
        slopes = self._slopes(points, values)
        equal, strict = _kinds(self.relations)
        room = 0.1 * np.abs(slopes * np.maximum(np.abs(points), 1e-1)).sum(axis=-1)
        beyond = values > np.where(strict, -_ROOM * room, 0.0)
        goal = np.where(equal, values, np.where(beyond, values + room, 0.0))
        matrix = np.where((goal != 0)[..., None], slopes, 0.0).transpose(1, 0, 2)
        usable: Any = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(goal).all(axis=0)
        matrix, right = np.where(usable[:, None, None], matrix, 0.0), np.where(usable[:, None], goal.T, 0.0)
        try:
            step = (np.linalg.pinv(matrix, rcond=1e-9) @ right[..., None])[..., 0]
        except np.linalg.LinAlgError:
            step = np.zeros_like(points)
        lost = ~usable
        step[lost] = 0.5 * (points[lost] - self.typical)
        return np.clip(points - step, self.low, self.high)

    def _plain(self, point: Array) -> Array:
        """The same with rounder coordinates, one by one, as long as everything holds."""
        for i in range(len(point)):
            for change in self._rounder(i):
                moved = point.copy()
                moved[i] = change(point[i])
                if self.low[i] <= moved[i] <= self.high[i] and self._good(moved[None])[0]:
                    point = moved
                    break
        return point

    def _rounder(self, i: int) -> Sequence[Callable[[float], float]]:
        return (lambda x: self.typical[i], lambda x: 0.0, *(lambda x, d=d: float(f"{x:.{d}g}") for d in (1, 2, 3)))


def excluded(
    program: StraightLine, relations: tuple[Relation, ...], low: Array, high: Array, most: int = MOST_BOXES
) -> bool:
    """Whether no point of a box satisfies all constraints, after at most so many boxes.

    ``program`` has their expressions, ``relations`` what each has to be; ``low`` and ``high`` (names) are the box.
    """
    whole = np.maximum(high - low, 1e-300)
    lows, highs = low[None], high[None]
    seen = 0
    while len(lows):
        seen += len(lows[-BATCH:])
        if seen > most:
            return False
        first, last = lows[-BATCH:], highs[-BATCH:]
        bounds = program.over(first, last)
        equal, strict = _kinds(relations)
        below, above = np.asarray(bounds.low), np.asarray(bounds.high)
        left = np.logical_and.reduce(np.where(strict, below < 0, below <= 0) & (~equal | (above >= 0)))
        first, last = first[left], last[left]
        widths = (last - first) / whole
        if len(first) and (not first.shape[1] or widths.max(axis=1).min() < _SMALLEST):
            return False
        halves = _halved(first, last, widths)
        lows, highs = (np.concatenate([kept[:-BATCH], new]) for kept, new in ((lows, halves[0]), (highs, halves[1])))
    return True


def _kinds(relations: tuple[Relation, ...]) -> tuple[Array, Array]:
    """Which constraints are equations, and which are strict: columns."""
    kinds: Any = np.array(relations, dtype=str)[:, None]
    return kinds == "= 0", kinds == "< 0"


def _halved(low: Array, high: Array, widths: Array) -> tuple[Array, Array]:
    if not len(low):
        return low, high
    rows, widest = np.arange(len(low)), widths.argmax(axis=1)
    middle = (low[rows, widest] + high[rows, widest]) / 2
    left_high, right_low = high.copy(), low.copy()
    left_high[rows, widest] = middle
    right_low[rows, widest] = middle
    return np.concatenate([low, right_low]), np.concatenate([left_high, high])
