# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false, reportCallIssue=false
"""What a motion along one guard depends on: the guard, its reset, the flows of their states, and a point of rest.

States that impacts only count with are left out: nothing else depends on them, and resets lead them nowhere.
"""

from __future__ import annotations

import random
from collections import ChainMap, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from operator import mul, sub
from typing import Any

import sympy as sp

from hsdsl.base.numbers.arithmetic import Number, multiprecision
from hsdsl.language.expression.algebra import NO_VALUE, Shape, derivative, lie_derivative
from hsdsl.language.expression.scope import slope_symbol, symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, symbols_of

NUMBERS = multiprecision(60)  # of random points: units of states, guards and time may be far apart
NAN = NUMBERS.functions["nan"]
ROUNDED = NUMBERS.functions["ldexp"](1, -NUMBERS.bits // 2)  # of its terms: what is smaller counts as zero
_CALLED = {"absolute": "abs", "minimum": "min", "maximum": "max"}  # among the functions of numbers
NEXT = NUMBERS.functions["ldexp"](1, -NUMBERS.bits // 4)  # of an argument: what a function changes by tells its slope
MOST_ROUNDS = 200  # of Newton's method: where units are far apart it halves the way first
MOST_NODES = 2_000  # of what a guard, its reset and their flows are written with: beyond, no motion is derived
LONG = 400  # nodes, from which on a term is not simplified
Point = dict[sp.Symbol, Number]
Slopes = Mapping[sp.Symbol, sp.Symbol]
NO_SLOPES: Slopes = {}
Sized = tuple[Number, Number]  # a number, and the size of the terms that it is computed from
Row = Sequence[Sized]


def slopes_of_inputs(system: HybridSystem) -> Slopes:
    """The slopes of the sampled inputs that move between their samples."""
    return {symbol(given.name): slope_symbol(given.name) for given in system.inputs if given.hold == "linear"}


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
        moving: Slopes = NO_SLOPES,
    ) -> None:
        self._here, self.mode, self.impact, self._moving, self._counts = here, mode, impact, moving, counts
        self.states, self.edge = symbols_of(mode.states), edge
        self.guard = edge.surface.residual.xreplace(here)
        self._flow = ChainMap[sp.Symbol, Any](dict(moving), mode.vector_field)
        self.changed = [i for i in edge.reset.changes if i not in counts]
        self.own = tuple(self.states[i] for i in self.changed)
        self.moved = sp.Matrix([edge.reset[i].xreplace(here) - self.states[i] for i in self.changed])

    def without(self, counts: Sequence[int]) -> Nearby:
        """The same with a reset that leaves some states as they are."""
        return Nearby(self.mode, self.edge, self._here, (*self._counts, *counts), self.impact, self._moving)

    def by(self, edge: Edge, impact: Point) -> Nearby:
        """The same of an edge with another reset, which is that of impacts as at a point."""
        return Nearby(self.mode, edge, self._here, self._counts, impact, self._moving)

    def flow(self, x: sp.Symbol) -> Any:
        """The rate of time, of a state or of an input."""
        return sp.S.One if x == TIME else self._flow[x].xreplace(self._here)

    def among(self, value: sp.Basic) -> list[Any]:
        """The time, states and inputs that move, in the order of their names, that a value depends on."""
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

    def shape(self, atoms: Sequence[sp.Basic]) -> tuple[Shape, tuple[Any, ...]]:
        """What this is up to names, with the inequalities of a condition, and what each of these names is."""
        condition = sp.true if self.edge.condition is None else self.edge.condition
        flows = (self.flow(x) for x in self.among(condition))
        values = map(sp.sympify, (self.guard, *self.moved, *self.own, *self.flows(), condition, *atoms, *flows))
        shape, unused = Shape(values, letter=lambda name: ""), unused_in(self.mode)
        kinds = (x if x in (TIME, NO_VALUE) else (x in self._moving, x in self._flow) for x in map(symbol, shape.names))
        return shape, (*kinds, *(i in unused for i in self.changed))

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


def mode_of_part(edge: Edge, numbers: Collection[str]) -> dict[sp.Symbol, sp.Integer]:
    """The number of the mode that an edge of a part leaves, where its surface depends on that."""
    name, k = edge.part or ("", 0)
    known = name in numbers and symbol(name) in edge.surface.residual.free_symbols
    return {symbol(name): sp.Integer(k)} if known else {}


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
    at: Point = {name: NUMBERS.zero + draw.uniform(1, 2) for name in sorted(names, key=str)}
    return {name: -value if name in either and draw.random() < 0.5 else value for name, value in at.items()}


def solved(equations: Sequence[sp.Expr], free: Sequence[Any], start: Point) -> Point | None:
    """Solve equations for some names from a point on, by Newton's method; None where no solution is found."""
    at = dict(start)
    equations, slopes = [*map(sp.sympify, equations)], jacobian(equations, free)
    for _ in range(MOST_ROUNDS):
        known = _known(at)
        values = [_sized(e, known)[0] for e in equations]
        if not all(map(NUMBERS.isfinite, values)):
            return None
        step, _ = _least(_rows_at(slopes, known), values)
        for name, change in zip(free, step, strict=True):
            at[name] -= change
        if all(abs(change) <= ROUNDED * abs(start[name]) for name, change in zip(free, step, strict=True)):
            return at if all(is_zero(e, at) for e in equations) else None  # else they contradict each other
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


def value_at(value: sp.Expr, at: Point) -> Number:
    """The value of an expression at a point; not-a-number where it has none."""
    return _sized(sp.sympify(value), _known(at))[0]


def size_at(value: sp.Expr, at: Point) -> Number:
    """The size of the terms that the value of an expression at a point is computed from."""
    return _sized(sp.sympify(value), _known(at))[1]


def as_float(number: Number) -> sp.Float:
    """A number in an expression."""
    return sp.Float(number._mpf_, precision=NUMBERS.bits)


def is_zero(value: sp.Expr, at: Point) -> bool:
    """Whether an expression is zero at a point, or no more than round-off."""
    number, size = _sized(sp.sympify(value), _known(at))
    return abs(number) <= ROUNDED * size


def _known(at: Point) -> dict[sp.Basic, Sized]:
    return {name: (number, 1 + abs(number)) for name, number in at.items()}


def _sized(expr: sp.Basic, known: dict[sp.Basic, Sized]) -> Sized:
    """The value of an expression with the size of its terms, whose parts are each computed once."""
    if expr not in known:
        known[expr] = _computed(expr, [_sized(part, known) for part in expr.args])
    return known[expr]


def _computed(expr: sp.Basic, parts: list[Sized]) -> Sized:
    if expr.is_Add:
        return reduce(lambda a, b: (a[0] + b[0], a[1] + b[1]), parts)
    if expr.is_Mul:
        return reduce(lambda a, b: (a[0] * b[0], abs(a[0]) * b[1] + a[1] * abs(b[0])), parts)
    numbers = [number for number, _ in parts]
    value = _evaluated(expr, numbers)
    size = abs(value)
    for i, (argument, (number, own)) in enumerate(zip(expr.args, parts, strict=True)):
        moved = (
            value if argument.is_Number else _evaluated(expr, [*numbers[:i], number + NEXT * own, *numbers[i + 1 :]])
        )
        size = size + (abs(moved - value) / NEXT if NUMBERS.isfinite(moved) else 0)
    return value, size


def _evaluated(expr: sp.Basic, numbers: Sequence[Number]) -> Number:
    """The value of one operation."""
    try:
        if expr.is_Rational:
            return NUMBERS.constant(Fraction(int(expr.p), int(expr.q)))
        name = "pow" if expr.is_Pow else expr.func.__name__
        if numbers and (function := NUMBERS.functions.get(_CALLED.get(name, name))):
            return function(*numbers)
        made = expr.func(*map(as_float, numbers)) if numbers else expr
        found = made.evalf(NUMBERS.digits) if isinstance(made, sp.Expr) else made
        if not found.is_Number or not found.is_real:
            return NAN
        return NUMBERS.zero.context.make_mpf(sp.Float(found, precision=NUMBERS.bits)._mpf_)
    except (TypeError, ValueError, ArithmeticError):
        return NAN


def _rows_at(matrix: sp.Matrix, known: dict[sp.Basic, Sized]) -> list[Row]:
    return [[_sized(value, known) for value in row] for row in matrix.tolist()]


def rank(matrix: sp.Matrix, at: Point) -> int:
    """The rank of a matrix at a point; 0 where it has no finite value."""
    rows = _rows_at(matrix, _known(at))
    if not all(NUMBERS.isfinite(number) for row in rows for number, _ in row):
        return 0
    return _least(rows, [NUMBERS.zero] * len(rows))[1]


def _least(rows: Sequence[Row], values: Sequence[Number]) -> tuple[list[Number], int]:
    """The smallest solution of independent ones of linear equations, and how many these are, by Gram and Schmidt.

    An equation that others leave no more of than the round-off of its terms depends on them.
    """
    count, step = 0, [NUMBERS.zero] * len(rows[0])
    left = [
        ([*(number for number, _ in row), value], _norm([size for _, size in row]))
        for row, value in zip(rows, values, strict=True)
    ]
    while left:
        sizes = [(_norm(row[:-1]), whole) for row, whole in left]
        best = max(range(len(left)), key=lambda i: sizes[i][0] / sizes[i][1] if sizes[i][1] else NUMBERS.zero)
        length, whole = sizes[best]
        if length <= ROUNDED * whole:
            break
        *direction, share = (entry / length for entry in left.pop(best)[0])
        step = [x + share * d for x, d in zip(step, direction, strict=True)]
        left, count = [(_without(row, direction, share), whole) for row, whole in left], count + 1
    return step, count


def _norm(numbers: Sequence[Number]) -> Number:
    return NUMBERS.sqrt(sum(map(mul, numbers, numbers), NUMBERS.zero))


def _without(equation: list[Number], direction: list[Number], share: Number) -> list[Number]:
    """What is left of an equation beyond another one whose coefficients are ``direction``."""
    part = sum(map(mul, equation, direction), NUMBERS.zero)
    return list(map(sub, equation, (part * d for d in (*direction, share))))


def counts_of(near: Nearby) -> tuple[int, ...]:
    """The numbers of the states that an edge which leads back to its mode counts with, as ``n: n + 1``.

    A sum that converges, as that of what impacts dissipate, is none: its increment vanishes where the state rests. Nor
    is what repeated resets take to a limit of its own.
    """
    few = tuple(i for i in near.changed if i in unused_in(near.mode))
    if not few or not near.is_small() or (found := fixed_point(near.without(few))) is None:
        return ()
    anywhere = {x: NUMBERS.zero + 1 + 1 / (3 + k) for k, x in enumerate(sorted(near.moved.free_symbols, key=str))}
    at = anywhere | found
    changes = ((i, change) for i, change in zip(near.changed, near.moved, strict=True) if i in few)
    return tuple(
        i
        for i, change in changes
        if not is_zero(change, at) and abs(1 + value_at(sp.diff(change, near.states[i]), at)) >= 1
    )


_last: list[tuple[Mode, frozenset[int]]] = []  # of a mode all edges in turn; to hash one takes longer than this does


def unused_in(mode: Mode) -> frozenset[int]:
    """The states without a flow that no flow, surface, `if` or other state depends on while a mode lasts."""
    if not _last or _last[0][0] is not mode:
        _last[:] = [(mode, _unused(mode))]
    return _last[0][1]


def _unused(mode: Mode) -> frozenset[int]:
    states = dict(zip(symbols_of(mode.states), range(len(mode.states)), strict=True))
    loops = [edge for edge in mode.edges if edge.target == mode.name and edge.target_states == mode.states]
    conditions = [edge.condition for edge in mode.edges if edge.condition is not None]
    waiting = [*mode.flow, *conditions, *(s.residual for s in mode.surfaces)]
    used = {i for i, f in enumerate(mode.flow) if f != 0}
    values = defaultdict[int, list[Any]](list)
    for i, value in (change for edge in loops for change in edge.reset.changes.items()):
        values[i].append(value)
    waiting += [value for i in used for value in values[i]]
    while waiting:
        for x in sp.sympify(waiting.pop()).free_symbols:
            i = states.get(x)
            if i is not None and i not in used:
                used.add(i)
                waiting += values[i]
    return frozenset(range(len(mode.states))) - used
