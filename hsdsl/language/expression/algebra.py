# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false, reportReturnType=false
"""What SymPy expressions are made of besides sums and products: choices, derivatives, solutions of linear equations.

A choice is by the number of a mode or by a truth, a number that is 1 or 0. All its expressions are computed, so each
gets arguments that have a value where it is not chosen.
"""

from __future__ import annotations

import random
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.base.functions import below, floor, rebuilt, sign, solution
from hsdsl.language.expression.scope import TIME, Value

_HALF = sp.Rational(1, 2)
_SAFE: dict[str, Any] = {
    **dict.fromkeys(("asin", "acos", "atanh"), _HALF),
    **dict.fromkeys(("exp", "sinh", "cosh", "log", "tan", "floor"), sp.S.One),
    "acosh": sp.Integer(2),
    "atan2": sp.S.One,
}
Guard = Callable[[Any, Any], Any]  # of an expression, and of what takes its place where it is not selected
NO_VALUE = sp.Symbol("nan", real=True)
ZERO, ONE = sp.S.Zero, sp.S.One


def pick(number: sp.Symbol, choices: Sequence[Any], constants: frozenset[Any]) -> Any:
    """The k-th of some expressions where a number is k, from 1 on; ``constants`` are symbols of parameters."""
    if all(choice == choices[0] for choice in choices):
        return choices[0]
    safe = [total(e, lambda a, b, k=k: select(is_mode(number, k), a, b), constants) for k, e in enumerate(choices, 1)]
    found = safe[-1]
    for k in range(len(safe) - 1, 0, -1):
        found = below(number, k + _HALF, safe[k - 1], found)
    return found


def is_mode(number: sp.Symbol, k: int) -> Any:
    """The truth that a number is k."""
    return below(number, k - _HALF, sp.S.Zero, below(number, k + _HALF, sp.S.One, sp.S.Zero))


def whole(number: int) -> Any:
    """A whole number as an expression."""
    return sp.Integer(number)


def select(truth: Any, yes: Any, no: Any) -> Any:
    """One of two expressions."""
    if isinstance(truth, below) and truth.args[2:] == (0, 1):
        return below(*truth.args[:2], no, yes)
    if isinstance(truth, below) and truth.args[2] == 0 and isinstance(truth.args[3], below):
        inner = truth.args[3]
        return below(*truth.args[:2], no, select(inner, yes, no))
    if isinstance(truth, below) and truth.args[2:] == (1, 0):
        return below(*truth.args[:2], yes, no)
    return below(truth, _HALF, no, yes)


def chosen(number: Any, yes: Any, no: Any) -> Any:
    """One expression where a number is positive, else another one, which then needs no value: `select`."""
    if number.is_Rational:
        return yes if number > 0 else no
    against = -sign(number)
    yes = total(yes, lambda e, safe: below(against, ZERO, e, safe), frozenset())
    return below(against, ZERO, yes, total(no, lambda e, safe: below(against, ZERO, safe, e), frozenset()))


def positive(choice: below) -> Any:
    """The number that is positive where a choice is its first expression, as people write it."""
    against, bound = choice.args[:2]
    return (-against).args[0] if bound == 0 and isinstance(-against, sign) else bound - against


def cases(choice: below) -> Any:
    """A choice as people write it: the first expression where a number is positive, and the other one elsewhere."""

    def known(k: int) -> Any:
        """An expression where it is selected; `total` has written the same choice into it."""
        same = choice.args[:2]
        return choice.args[k].replace(lambda e: isinstance(e, below) and e.args[:2] == same, lambda e: e.args[k])

    where = sp.Gt(positive(choice), ZERO, evaluate=False)
    return sp.Piecewise((known(2), where), (known(3), sp.true), evaluate=False)


def by_constants(expr: Any, constants: frozenset[Any]) -> Any:
    """An expression whose choices by ``constants`` alone are by numbers that do not jump."""

    def number(against: Any, *rest: Any) -> Any:
        if isinstance(-against, sign) and against.free_symbols <= constants:
            against = -(-against).args[0]
        return below(against, *rest)

    return expr.replace(below, number) if isinstance(expr, sp.Basic) and expr.has(below) and expr.has(sign) else expr


def truth_of(condition: Any) -> Any:
    match condition:
        case sp.And():
            return sp.Mul(*map(truth_of, condition.args))
        case sp.Or():
            return either(list(map(truth_of, condition.args)))
        case sp.Not():
            return 1 - truth_of(condition.args[0])
        case sp.Gt() | sp.Lt():
            return below(condition.lts - condition.gts, sp.S.Zero, sp.S.One, sp.S.Zero)
        case sp.Ge() | sp.Le():
            return below(condition.gts - condition.lts, sp.S.Zero, sp.S.Zero, sp.S.One)
        case sp.Eq() | sp.Ne():
            apart = condition.lhs - condition.rhs
            equal = below(apart, sp.S.Zero, sp.S.Zero, below(-apart, sp.S.Zero, sp.S.Zero, sp.S.One))
            return equal if isinstance(condition, sp.Eq) else 1 - equal
    return sp.S.One if condition == sp.true else sp.S.Zero


def either(truths: Sequence[Any]) -> Any:
    """The truth that one of several is."""
    return truths[0] if len(truths) == 1 else 1 - sp.Mul(*(1 - truth for truth in truths))


def total(expr: Any, guard: Guard, constants: frozenset[Any], done: dict[Any, Any] | None = None) -> Any:
    """An expression that has a value everywhere, and its own where the guard gives its first argument."""
    done = {} if done is None else done
    if not expr.args:
        return expr
    if expr not in done:
        args = [total(a, guard, constants, done) for a in expr.args]
        if expr.is_Pow and not (expr.exp.is_Integer and expr.exp > 0):
            args[0] = _guarded(args[0], sp.S.One, guard, constants)
            args[1] = args[1] if expr.exp.is_Number else _guarded(args[1], sp.S.One, guard, constants)
        elif isinstance(expr, solution) and any(a.free_symbols - constants for a in args):
            n = int(args[1])  # elsewhere the matrix is the unit matrix
            units = [sp.Integer(int(k % (n + 1) == 0)) for k in range(n * n)]
            args[2 : 2 + n * n] = [guard(a, unit) for a, unit in zip(args[2 : 2 + n * n], units, strict=True)]
        elif type(expr).__name__ in _SAFE:
            args = [_guarded(a, _SAFE[type(expr).__name__], guard, constants) for a in args]
        done[expr] = expr if tuple(args) == expr.args else rebuilt(expr, args)
    return done[expr]


def _guarded(expr: Any, safe: Any, guard: Guard, constants: frozenset[Any]) -> Any:
    return guard(expr, safe) if expr.free_symbols - constants else expr


def is_number(expr: Any, number: int) -> Any:
    """The condition that an expression is a number."""
    return sp.Eq(expr, number)


@lru_cache(maxsize=4096)  # memory of events has many conditions, which only jump
def moving(expr: sp.Basic) -> frozenset[Any]:
    """The symbols outside piecewise constant functions: derivatives with respect to others are zero."""
    if expr.is_Symbol:
        return frozenset((expr,))
    if isinstance(expr, (sign, floor)):
        return frozenset()
    return frozenset().union(*map(moving, expr.args[2:] if isinstance(expr, below) else expr.args))


@lru_cache(maxsize=1 << 14)  # the modes of a large model have most of their derivatives in common
def derivative(expr: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """The derivative of an expression by a symbol: that of SymPy, which asks of every part of it whether it is zero."""
    if symbol not in moving(expr):
        return sp.S.Zero
    if expr.is_Symbol:
        return sp.S.One
    if isinstance(expr, below):
        return below(*expr.args[:2], *(derivative(choice, symbol) for choice in expr.args[2:]))
    ordinary = type(expr)._eval_derivative is sp.Function._eval_derivative  # by the chain rule
    if not (expr.is_Add or expr.is_Mul or ordinary or (expr.is_Pow and expr.exp.is_Number)):
        return expr.diff(symbol)
    slopes = [(i, slope) for i, part in enumerate(expr.args) if (slope := derivative(part, symbol)) != 0]
    if not slopes:
        return sp.S.Zero
    if expr.is_Pow:
        return expr * (slopes[0][1] * expr.exp / expr.base)
    if ordinary:
        return sp.Add(*(expr.fdiff(i + 1) * slope for i, slope in slopes))
    if expr.is_Mul:
        return sp.Add(*(sp.Mul(*expr.args[:i], slope, *expr.args[i + 1 :]) for i, slope in slopes))
    return sp.Add(*(slope for _, slope in slopes))


def lie_derivative(expr: sp.Expr, flow: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """The derivative of an expression of time and states along a flow, L_f."""
    rates = {TIME: sp.S.One, **flow}
    present = sorted(expr.free_symbols & rates.keys(), key=lambda s: s.name)
    return sp.Add(*(derivative(expr, s) * rates[s] for s in present))


_NUMBERED = re.compile(r"([a-z_]+)\d+")


@lru_cache(maxsize=1 << 17)
def letter_of(name: str) -> str | None:
    """What is before the number in a numbered name, None of another name."""
    return found[1] if (found := _NUMBERED.fullmatch(name)) else None


class Shape:
    """Expressions up to the numbers in the names of their symbols: what equal ones are written as is made once.

    The parts of a large model, and its modes, have the same routines over other symbols. SymPy and the printer put
    operands in an order of their names. So the names of a ``letter`` count by their order, and another letter is
    another shape; names without one count as they are. Every part of an expression is visited once. ``symbols`` has the
    symbols with their places among the parts, ``names`` those that have a letter in order, and ``key`` tells shapes
    apart. With ``beside`` another symbol goes with some symbols.
    """

    def __init__(
        self,
        expressions: Iterable[sp.Basic],
        beside: Mapping[sp.Basic, sp.Basic] | None = None,
        letter: Callable[[str], str | None] = letter_of,
    ) -> None:
        self._nodes: list[object] = []
        self._numbers: dict[sp.Basic, int] = {}
        self.symbols: dict[sp.Basic, int] = {}
        ends = list(map(self._visit, expressions))
        if beside:
            ends += [self._visit(beside[symbol]) for symbol in tuple(self.symbols) if symbol in beside]
        self.names: list[str] = []
        ranks = Counter[str]()
        for symbol in sorted(self.symbols, key=lambda s: s.name):
            if (found := letter(symbol.name)) is not None:
                self._nodes[self.symbols[symbol]] = found, ranks[found], symbol.is_real
                ranks[found] += 1
                self.names.append(symbol.name)
        self.key = (*ends, None, *self._nodes)

    def _visit(self, expr: sp.Basic) -> int:
        if (number := self._numbers.get(expr)) is None:
            node = (expr.func, *map(self._visit, parts)) if (parts := expr.args) else expr
            number = self._numbers[expr] = len(self._nodes)
            self._nodes.append(node)
            if expr.is_Symbol:
                self.symbols[expr] = number
        return number

    def order(self, places: Mapping[sp.Symbol, int]) -> tuple[int, ...]:
        """The symbols that are arguments, in the order of these, by their places among the parts."""
        return tuple(
            self.symbols[symbol] for symbol in sorted(self.symbols.keys() & places.keys(), key=places.__getitem__)
        )


_MOST_TRIES = 3  # points at which a matrix must be singular to count as singular everywhere


class Solved(NamedTuple):
    """The expression of each unknown, the states that the equations use, and how many nodes they have."""

    values: dict[Any, Any]
    uses: frozenset[str]
    size: int


def linear_solutions(
    sides: Sequence[tuple[Value, Value]], unknowns: Sequence[Any]
) -> Solved | tuple[int, str, str | None]:
    """The solutions of equations left == right; or the number of a faulty equation, its fault and a hint."""
    rows, constants = [], []
    zero = dict.fromkeys(unknowns, sp.S.Zero)
    for place, (left, right) in enumerate(sides):
        residual = left.expr - right.expr
        row = [residual.diff(x) for x in unknowns]
        if any(entry.free_symbols & zero.keys() for entry in row):
            return place, "this equation is not linear in the unknowns", "products and functions of unknowns are not"
        if all(entry == 0 for entry in row):
            return place, "this equation has none of the unknowns", "an unknown of each equation must be in it"
        rows.append(row)
        constants.append(-residual.xreplace(zero))
    if _singular(rows):
        message = "these equations do not determine the unknowns: one of them follows from the others"
        return len(sides) - 1, message, "remove an unknown and an equation, or add what is missing"
    count = len(unknowns)
    entries = [entry for row in rows for entry in row]
    if count == 1:
        values = {unknowns[0]: constants[0] / entries[0]}
    else:
        values = {x: solution(sp.Integer(i), sp.Integer(count), *entries, *constants) for i, x in enumerate(unknowns)}
    parts = [value for pair in sides for value in pair]
    return Solved(values, frozenset().union(*(part.uses for part in parts)), sum(part.size for part in parts))


def _singular(rows: list[list[Any]]) -> bool:
    """Whether a matrix is singular at some random points."""
    numbers = random.Random(0)
    names = sorted({s for row in rows for entry in row for s in entry.free_symbols}, key=lambda s: s.name)
    for _ in range(_MOST_TRIES):
        point = {name: sp.Rational(numbers.randint(1, 9999), 997) for name in names}
        try:
            matrix: Any = sp.Matrix([[entry.xreplace(point).evalf(60) for entry in row] for row in rows])
            if not all(entry.is_real and entry.is_finite for entry in matrix):
                return False
            sizes = [max(abs(entry) for entry in matrix.row(i)) for i in range(len(rows))]
            scaled: Any = sp.Matrix([[entry / size for entry in matrix.row(i)] for i, size in enumerate(sizes)])
            if not abs(scaled.det()) < sp.Float("1e-40", 60):
                return False
        except (TypeError, ValueError, ZeroDivisionError):
            return False
    return True
