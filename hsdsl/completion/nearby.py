# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false, reportCallIssue=false
"""What a motion along one guard depends on: the guard, its reset, the flows of their states, and a point of rest."""

from __future__ import annotations

import math
import random
from collections.abc import Collection, Iterable, Sequence
from functools import lru_cache
from itertools import chain
from operator import mul, sub
from typing import Any

import sympy as sp

from hsdsl.expression.derivatives import derivative, lie_derivative
from hsdsl.expression.scope import symbol
from hsdsl.functions import below
from hsdsl.system import TIME, Edge, Mode

SMALL = 1e-9  # a slope at a random point that counts as zero everywhere, relative to the largest
MOST_ROUNDS = 50  # of Newton's method
MOST_NODES = 2_000  # of what a guard, its reset and their flows are written with: beyond, no motion is derived
LONG = 400  # nodes, from which on a term is not simplified
Point = dict[sp.Symbol, float]


@lru_cache(maxsize=16)  # of a large mode once, not for each of its edges
def symbols(states: tuple[str, ...]) -> tuple[sp.Symbol, ...]:
    """The symbols of states."""
    return tuple(map(symbol, states))


@lru_cache(maxsize=16)
def _rows(states: tuple[str, ...], flow: tuple[sp.Expr, ...]) -> dict[sp.Symbol, sp.Expr]:
    return dict(zip(symbols(states), flow, strict=True))


class Nearby:
    """What motion along one guard depends on: the guard, the states that the reset changes, and flows of states.

    ``changed`` has the numbers of these states, but for those in ``counts``, ``own`` their symbols, ``moved`` what the
    reset adds to each. ``impact`` is a point of a guard before an impact, where the reset is a branch of one. ``mode``
    is the edge's, ``here`` that of the part that the edge belongs to.
    """

    def __init__(
        self,
        mode: Mode,
        edge: Edge,
        here: dict[sp.Symbol, sp.Integer],
        counts: Sequence[int] = (),
        impact: Point | None = None,
    ) -> None:
        self._here, self.mode, self.impact = here, mode, impact
        self.states, self.edge = symbols(mode.states), edge
        self.guard = sp.sympify(edge.surface.residual).xreplace(here)
        self._flow = _rows(mode.states, mode.flow)
        pairs = zip(self.states, edge.reset, strict=True)
        self.changed = [i for i, (x, r) in enumerate(pairs) if r is not x and r != x and i not in counts]
        self.own = tuple(self.states[i] for i in self.changed)
        self.moved = sp.Matrix([edge.reset[i].xreplace(here) - self.states[i] for i in self.changed])

    def without(self, counts: Sequence[int]) -> Nearby:
        """The same with a reset that leaves some states as they are."""
        return Nearby(self.mode, self.edge, self._here, counts, self.impact)

    def by(self, edge: Edge, impact: Point) -> Nearby:
        """The same of an edge with another reset, which is that of impacts as at a point."""
        return Nearby(self.mode, edge, self._here, (), impact)

    def flow(self, x: sp.Symbol) -> Any:
        """The rate of time or of a state."""
        return sp.S.One if x == TIME else sp.sympify(self._flow[x]).xreplace(self._here)

    def among(self, value: sp.Basic) -> list[Any]:
        """The time, and the states in the order of their names, that a value depends on."""
        return sorted((x for x in value.free_symbols if x == TIME or x in self._flow), key=lambda x: x.name)

    def rates(self, value: sp.Expr) -> dict[Any, Any]:
        """The rate of time and of each state that a value depends on."""
        return {x: self.flow(x) for x in self.among(value)}

    def along(self, value: sp.Expr) -> sp.Expr:
        """The derivative of an expression along the flow."""
        return lie_derivative(value, self.rates(value))

    def flows(self) -> list[sp.Expr]:
        """The flows that the motion depends on: of what guard and reset depend on, and of what their flows do."""
        found = dict.fromkeys(self.among(sp.Tuple(self.guard, *self.moved)))
        further = [y for x in found for y in self.among(sp.sympify(self.flow(x)))]
        return [self.flow(x) for x in dict.fromkeys((*found, *further))]

    def is_small(self) -> bool:
        """Whether all of this written out is short enough to be differentiated twice as trees."""
        return size((*self.flows(), *self.moved, self.guard)) <= MOST_NODES


def size(expressions: Iterable[sp.Expr]) -> int:
    """The nodes of expressions written out as trees."""
    sizes: dict[sp.Basic, int] = {}

    def nodes(expr: sp.Basic) -> int:
        if expr not in sizes:
            sizes[expr] = 1 + sum(map(nodes, expr.args))
        return sizes[expr]

    return sum(map(nodes, map(sp.sympify, expressions)))


def mode_of_part(edge: Edge, numbers: Sequence[str]) -> dict[sp.Symbol, sp.Integer]:
    """The number of the mode that an edge of a part leaves; nothing where its part has one mode."""
    residual = edge.surface.residual
    for name in numbers:
        number = symbol(name)
        if edge.name.startswith(f"{name}.") and residual.has(number):
            most = max(int(node.args[1] + 1) for node in residual.atoms(below) if node.args[0] == number)
            return next({number: k} for k in map(sp.Integer, range(1, most + 1)) if residual.subs(number, k) != -1)
    return {}


def cancelled(value: sp.Expr) -> sp.Expr:
    """The same expression, simpler where that is cheap, without SymPy's polynomials: they compile code of their own."""
    value = sp.sympify(value)
    if size((value,)) > LONG:
        return value
    value = sp.signsimp(value)
    over, under = value.as_numer_denom()
    over = sp.expand(over)
    shorter = sp.factor_terms(over) / sp.factor_terms(under)
    return sp.S.Zero if over == 0 else min((value, shorter), key=sp.count_ops)


def fixed_point(near: Nearby) -> Point | None:
    """A random point of a guard where its reset changes nothing, by Newton's method; None where none is found."""
    equations = [near.guard, *near.moved]
    free = [x for x in near.among(sp.Tuple(*equations)) if x != TIME]
    return solved(equations, free, drawn((*equations, *near.flows()), 1) | (near.impact or {}))


def drawn(expressions: Sequence[sp.Expr], seed: int, either: Collection[Any] = ()) -> Point:
    """Random values of the names in expressions, from 1 to 2; those of names in ``either`` with either sign."""
    names: set[Any] = set().union(*(sp.sympify(e).free_symbols for e in expressions))
    draw = random.Random(seed)
    at: Point = {name: draw.uniform(1, 2) for name in sorted(names, key=str)}
    return {name: -value if name in either and draw.random() < 0.5 else value for name, value in at.items()}


def solved(equations: Sequence[sp.Expr], free: Sequence[Any], start: Point) -> Point | None:
    """Solve equations for some names from a point on, by Newton's method; None where no solution is found."""
    at = dict(start)
    slopes = jacobian(equations, free)
    for _ in range(MOST_ROUNDS):
        values = [value_at(e, at) for e in equations]
        if not all(map(math.isfinite, values)):
            return None
        step, _ = _least(_values_at(slopes, at), values)
        for name, change in zip(free, step, strict=True):
            at[name] -= change
        if all(abs(change) <= SMALL for change in step):
            return at
    return None


def jacobian(values: Sequence[sp.Expr], among: Sequence[sp.Symbol]) -> sp.Matrix:
    """The derivatives of values by symbols, a row for each value."""
    return sp.Matrix(len(values), len(among), [derivative(value, x) for value in values for x in among])


def product(left: sp.Matrix, right: sp.Matrix) -> sp.Matrix:
    """The product of two matrices; of zero times an entry, SymPy asks at length whether that is finite."""

    def entry(i: int, j: int) -> sp.Expr:
        pairs = ((left[i, k], right[k, j]) for k in range(left.cols))
        return sp.Add(*(x * y for x, y in pairs if x != 0 and y != 0))

    return sp.Matrix(left.rows, right.cols, entry)


def value_at(value: sp.Expr, at: Point) -> float:
    """The value of an expression at a point; not-a-number where it has none."""
    return _number(sp.sympify(value), dict(at))


def _number(expr: sp.Basic, known: dict[sp.Basic, float]) -> float:
    """The value of an expression, whose parts are each computed once."""
    if expr not in known:
        known[expr] = _computed(expr, [_number(part, known) for part in expr.args])
    return known[expr]


def _computed(expr: sp.Basic, parts: list[float]) -> float:
    try:
        if expr.is_Add or expr.is_Mul:
            return math.fsum(parts) if expr.is_Add else math.prod(parts)
        made = expr.func(*map(sp.Float, parts)) if parts else expr
        number = made.evalf() if isinstance(made, sp.Expr) else made
        return float(number) if number.is_Number and number.is_real else math.nan
    except (TypeError, ValueError, ArithmeticError):
        return math.nan


def _values_at(matrix: sp.Matrix, at: Point) -> list[list[float]]:
    known: dict[sp.Basic, float] = dict(at)
    return [[_number(value, known) for value in row] for row in matrix.tolist()]


def rank(matrix: sp.Matrix, at: Point) -> int:
    """The rank of a matrix at a point; 0 where it has no finite value."""
    rows = _values_at(matrix, at)
    return _least(rows, [0.0] * len(rows))[1] if all(map(math.isfinite, chain(*rows))) else 0


def _least(rows: Sequence[Sequence[float]], values: Sequence[float]) -> tuple[list[float], int]:
    """The smallest solution of independent ones of linear equations, and how many these are, by Gram and Schmidt.

    NumPy would take longer to import than all of this does.
    """
    left = [(math.hypot(*row), [*row, value]) for row, value in zip(rows, values, strict=True)]
    step, count, largest = [0.0] * len(rows[0]), 0, max(size for size, _ in left)
    while left and (best := max(left, key=lambda sized: sized[0]))[0] > SMALL * largest:
        left.remove(best)
        *direction, share = (entry / best[0] for entry in best[1])
        step = [x + share * d for x, d in zip(step, direction, strict=True)]
        left, count = [_without(row, direction, share) for _, row in left], count + 1
    return step, count


def _without(equation: list[float], direction: list[float], share: float) -> tuple[float, list[float]]:
    """What is left of an equation beyond another one whose coefficients are ``direction``, and its size."""
    part = sum(map(mul, equation, direction))
    *rest, value = map(sub, equation, (part * d for d in (*direction, share)))
    return math.hypot(*rest), [*rest, value]
