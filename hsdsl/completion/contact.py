# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false
"""Motion along a guard: the flow that ever faster transitions of one edge tend to (M11).

Near a point that a reset R keeps, flow for a short time and reset, over and over, is flow projected along the
directions that R contracts onto the tangents of its fixed points: the constrained flow is the flow plus a multiple of
the reset's directions that keeps R(x) = x.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from hsdsl.completion.printer import text_of
from hsdsl.expression.scope import symbol
from hsdsl.functions import below
from hsdsl.system import TIME, Edge, Mode, Surface

MOST_TOGETHER = 3  # edges whose motions along several guards at once are derived
MOST_DIRECTIONS = 3  # of a reset: their matrix is inverted in symbols
SMALL = 1e-9  # a slope at a random point that counts as zero everywhere, relative to the largest
MOST_ROUNDS = 50  # of Newton's method
MOST_NODES = 2_000  # of what a guard, its reset and their flows are written with: beyond, no motion is derived
MOST_WRITTEN = 10_000  # nodes of a mode's flow, once for each edge that holds it: each motion is a mode of its own
LONG = 200  # operations, from which on a term is not simplified
Point = dict[sp.Symbol, float]


@dataclass(frozen=True)
class Contact:
    """Motion of a mode along the guards of some of its edges, ``edges`` by their numbers.

    ``base`` is the mode. ``rows`` has the flow of the states whose flow is another one, by the states' numbers;
    ``releases`` the edges that take the place of those in contact, by their numbers: their surfaces are the pushes with
    which the flow presses on the guards, negative. ``further`` edges, beyond the mode's own, are where an `if` may end.
    What follows is of the last edge: ``ends`` says of each of its ends of an `if` under which condition it is one.
    ``push`` is the derivative of the guard along the flow that presses, of this ``order``: 1, or 2 where the first one,
    ``rate``, is zero on it. ``landing`` is the state that repeated resets take a state near the guard to.
    """

    edges: tuple[int, ...]
    order: int
    base: Mode
    rows: dict[int, sp.Expr]
    releases: dict[int, Edge]
    further: tuple[Edge, ...]
    rate: sp.Expr
    push: sp.Expr
    landing: tuple[sp.Expr, ...]
    ends: tuple[sp.Basic, ...]

    @property
    def mode(self) -> Mode:
        """The mode with the constrained flow."""
        flow, texts, edges = list(self.base.flow), list(self.base.flow_texts), list(self.base.edges)
        for i, row in self.rows.items():
            flow[i], texts[i] = row, text_of(row)
        for k, edge in self.releases.items():
            edges[k] = edge
        return replace(self.base, flow=tuple(flow), flow_texts=tuple(texts), edges=(*edges, *self.further))


def contacts(mode: Mode, numbers: Sequence[str] = ()) -> dict[frozenset[int], Contact]:
    """The motions along guards of a mode, by the edges in contact; ``numbers`` are states that are modes of parts.

    Those along several guards are there for up to :data:`MOST_TOGETHER` such edges, where none changes what presses on
    the others.
    """
    singles: dict[frozenset[int], Contact] = {}
    most = MOST_WRITTEN // max(1, _size(mode.flow))
    for k in range(len(mode.edges)):
        if (found := contact(mode, k, numbers)) is not None:
            singles[frozenset((k,))] = found
        if len(singles) > most:
            return {}
    every = dict(singles)
    for size in range(2, len(singles) + 1) if len(singles) <= MOST_TOGETHER else ():
        for few in [few for few in every if len(few) == size - 1]:
            for one in singles:
                (k,) = one
                if k > max(few) and all(_apart(singles[one], singles[frozenset((j,))], mode) for j in few):
                    found = contact(every[few].mode, k, numbers)
                    if found is not None:
                        every[few | one] = _joined(every[few], found)
    return every


def _joined(first: Contact, second: Contact) -> Contact:
    """Both motions together, the second one being derived from the mode of the first."""
    return replace(
        second,
        edges=(*first.edges, *second.edges),
        base=first.base,
        rows=first.rows | second.rows,
        releases=first.releases | second.releases,
        further=first.further + second.further,
    )


def _apart(one: Contact, other: Contact, mode: Mode) -> bool:
    """Whether resets of two edges change other states, and none that the guard of the other or its rate depend on."""
    (j,), (k,) = one.edges, other.edges

    def changed(k: int):
        edge = mode.edges[k]
        return {symbol(x) for x, r in zip(mode.states, edge.reset, strict=True) if r != symbol(x)}

    def seen(found: Contact, k: int):
        guard = mode.edges[k].surface.residual
        return changed(k) | guard.free_symbols | (found.rate.free_symbols if found.order == 2 else set())

    return not changed(j) & seen(other, k) and not changed(k) & seen(one, j)


def contact(mode: Mode, k: int, numbers: Sequence[str] = ()) -> Contact | None:
    """The motion along the guard of edge k of a mode; None where there is none, or where it is not unique."""
    edge = mode.edges[k]
    if edge.target != mode.name or edge.target_states != mode.states or mode.derived or edge.of_event:
        return None
    near = _Nearby(mode, edge, _mode_of_part(edge, numbers))
    if any(mode.states[i] in numbers for i in near.changed):
        return None
    constrained = _constrained(near) if near.changed and near.is_small() else None
    if constrained is None:
        return None
    rows, landing, at = constrained
    push, order = _push(near, at)
    if order is None:
        return None
    release = replace(edge, surface=zero_surface(-push), condition=None, condition_text=None,
                      reset=_symbols(mode.states), reset_texts=mode.states)  # fmt: skip
    further, ends = _ends_of_condition(release, edge.condition)
    rate = cancelled(near.along(near.guard))
    return Contact((k,), order, mode, rows, {k: release}, tuple(further), rate, push, landing, tuple(ends))


@lru_cache(maxsize=16)  # of a large mode once, not for each of its edges
def _symbols(states: tuple[str, ...]) -> tuple[sp.Symbol, ...]:
    return tuple(map(symbol, states))


@lru_cache(maxsize=16)
def _rows(states: tuple[str, ...], flow: tuple[sp.Expr, ...]) -> dict[sp.Symbol, sp.Expr]:
    return dict(zip(_symbols(states), flow, strict=True))


class _Nearby:
    """What motion along one guard depends on: the guard, the states that the reset changes, and flows of states.

    ``changed`` has the numbers of these states, ``moved`` what the reset adds to each. ``here`` is the mode of the part
    that the edge belongs to.
    """

    def __init__(self, mode: Mode, edge: Edge, here: dict[sp.Symbol, sp.Integer]) -> None:
        self._here = here
        self.states, self.edge = _symbols(mode.states), edge
        self.guard = sp.sympify(edge.surface.residual).xreplace(here)
        self._flow = _rows(mode.states, mode.flow)
        pairs = zip(self.states, edge.reset, strict=True)
        self.changed = [i for i, (x, r) in enumerate(pairs) if r is not x and r != x]
        self.moved = sp.Matrix([edge.reset[i].xreplace(here) - self.states[i] for i in self.changed])

    def flow(self, x: sp.Symbol) -> Any:
        """The rate of time or of a state."""
        return sp.S.One if x == TIME else sp.sympify(self._flow[x]).xreplace(self._here)

    def among(self, value: sp.Basic) -> list[Any]:
        """The time, and the states in the order of their names, that a value depends on."""
        return sorted((x for x in value.free_symbols if x == TIME or x in self._flow), key=lambda x: x.name)

    def along(self, value: sp.Expr) -> sp.Expr:
        """The derivative of an expression along the flow."""
        return along(value, self.among(value), self.flow)

    def flows(self) -> list[sp.Expr]:
        """The flows that the motion depends on: of what guard and reset depend on, and of what their flows do."""
        found = dict.fromkeys(self.among(sp.Tuple(self.guard, *self.moved)))
        further = [y for x in found for y in self.among(sp.sympify(self.flow(x)))]
        return [self.flow(x) for x in dict.fromkeys((*found, *further))]

    def is_small(self) -> bool:
        """Whether all of this written out is short enough to be differentiated twice as trees."""
        return _size((*self.flows(), *self.moved, self.guard)) <= MOST_NODES


def _size(expressions: Iterable[sp.Expr]) -> int:
    """The nodes of expressions written out as trees."""
    sizes: dict[sp.Basic, int] = {}

    def size(expr: sp.Basic) -> int:
        if expr not in sizes:
            sizes[expr] = 1 + sum(map(size, expr.args))
        return sizes[expr]

    return sum(map(size, map(sp.sympify, expressions)))


def _mode_of_part(edge: Edge, numbers: Sequence[str]) -> dict[sp.Symbol, sp.Integer]:
    """The number of the mode that an edge of a part leaves; nothing where its part has one mode."""
    residual = edge.surface.residual
    for name in numbers:
        number = symbol(name)
        if edge.name.startswith(f"{name}.") and residual.has(number):
            most = max(int(node.args[1] + 1) for node in residual.atoms(below) if node.args[0] == number)
            return next({number: k} for k in map(sp.Integer, range(1, most + 1)) if residual.subs(number, k) != -1)
    return {}


def _constrained(near: _Nearby):
    """The rows of the flow that stays where a reset keeps the state, the way there, and a point; None without one."""
    if (at := _fixed_point(near)) is None:
        return None
    moved, own = near.moved, [near.states[i] for i in near.changed]
    among = list(dict.fromkeys((*near.among(sp.Tuple(*moved)), *own)))
    slopes = moved.jacobian(among)
    own = moved.jacobian(own)
    rank = _rank(own, at)
    if not 0 < rank <= MOST_DIRECTIONS or _rank(slopes, at) > rank:
        return None
    part, size = sp.eye(len(near.changed)), sp.trace(own)
    for k in range(2, rank + 1):  # Faddeev and LeVerrier: own part / size projects along the reset's directions
        part = own * part - size * sp.eye(len(near.changed))
        size = sp.trace(own * part) / k
    if abs(_number(size, at)) <= SMALL:  # the reset does not contract: a shear
        return None
    rows: dict[int, sp.Expr] = {}
    for i, correction in zip(near.changed, part * slopes * sp.Matrix(list(map(near.flow, among))), strict=True):
        rows[i] = cancelled(near.flow(near.states[i]) - correction / size)
    landing = list[sp.Expr](near.states)
    for i, correction in zip(near.changed, part * moved, strict=True):
        landing[i] = cancelled(landing[i] - correction / size)
    return rows, tuple(landing), at


def _push(near: _Nearby, at: Point):
    """The first derivative of a guard along the flow that the reset takes back, and which one it is."""
    rate = near.along(near.guard)
    moved = {near.states[i]: change for i, change in zip(near.changed, near.moved, strict=True)}
    for order, value in ((1, near.guard), (2, rate)):
        slopes = [(sp.diff(value, x), moved[x]) for x in near.among(value) if x in moved]
        by = near.among(sp.Tuple(*(change for _, change in slopes)))
        back = [sum(g * sp.diff(change, y) for g, change in slopes) for y in by if y != TIME]
        if any(abs(_number(b, at)) > SMALL for b in back):
            return cancelled(near.along(value)), order
    return rate, None


def along(value: sp.Expr, among: Sequence[sp.Symbol], flow: Callable[[sp.Symbol], sp.Expr]) -> sp.Expr:
    """The derivative of an expression of ``among`` along a flow."""
    return sp.Add(*(sp.diff(value, x) * flow(x) for x in among))


def _ends_of_condition(release: Edge, condition: sp.Basic | None) -> tuple[list[Edge], list[sp.Basic]]:
    """Edges where an `if` may end, one for each inequality in it and each way that counts, and when it does there."""
    edges: list[Edge] = []
    ends: list[sp.Basic] = []
    if condition is None:
        return edges, ends
    atoms = sorted(condition.atoms(Relational), key=str)
    plain = isinstance(condition, Relational) or (isinstance(condition, sp.And) and set(condition.args) == set(atoms))
    for atom in atoms:
        falling = atom.gts - atom.lts if hasattr(atom, "gts") else atom.lhs - atom.rhs
        for residual, beyond in ((-falling, sp.false),) if plain else ((-falling, sp.false), (falling, sp.true)):
            edges.append(replace(release, surface=zero_surface(residual)))
            ends.append(sp.Not(condition.xreplace({atom: beyond})))
    return edges, ends


def zero_surface(residual: sp.Expr) -> Surface:
    """The surface where an expression rises through zero."""
    return Surface(residual, sp.S.Zero, residual, f"{text_of(residual)} >= 0")


def cancelled(value: sp.Expr) -> sp.Expr:
    """The same expression, simpler where that is cheap, without SymPy's polynomials: they compile code of their own."""
    value = sp.signsimp(sp.sympify(value))
    if value.count_ops() > LONG:
        return value
    over, under = value.as_numer_denom()
    over = sp.expand(over)
    shorter = sp.factor_terms(over) / sp.factor_terms(under)
    return sp.S.Zero if over == 0 else min((value, shorter), key=sp.count_ops)


def _fixed_point(near: _Nearby) -> Point | None:
    """A random point of a guard where its reset changes nothing, by Newton's method; None where none is found."""
    equations, flows = [near.guard, *near.moved], near.flows()
    free = [x for x in near.among(sp.Tuple(*equations)) if x != TIME]
    names: set[Any] = set().union(*(sp.sympify(e).free_symbols for e in (*equations, *flows)))
    draw = random.Random(1)
    at: Point = {name: draw.uniform(1, 2) for name in sorted(names, key=str)}
    slopes = sp.Matrix(equations).jacobian(free) if free else sp.zeros(len(equations), 0)
    for _ in range(MOST_ROUNDS):
        values = np.array([_number(e, at) for e in equations])
        if not np.all(np.isfinite(values)):
            return None
        step = np.linalg.pinv(_numbers(slopes, at), rcond=SMALL) @ values
        for name, change in zip(free, step.tolist(), strict=True):
            at[name] -= change
        if not free or np.max(np.abs(step)) <= SMALL:
            return at
    return None


def _number(value: sp.Expr, at: Point) -> float:
    number = sp.sympify(value)
    number = number.xreplace({name: sp.Float(at[name]) for name in number.free_symbols if name in at}).evalf()
    return float(number) if number.is_Number and number.is_real else math.nan


def _numbers(matrix: sp.Matrix, at: Point) -> np.ndarray:
    return np.array([[_number(value, at) for value in row] for row in matrix.tolist()]).reshape(matrix.shape)


def _rank(matrix: sp.Matrix, at: Point) -> int:
    numbers = _numbers(matrix, at)
    return int(np.linalg.matrix_rank(numbers, rtol=SMALL)) if np.all(np.isfinite(numbers)) else 0
