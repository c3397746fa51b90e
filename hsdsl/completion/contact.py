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
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from sympy.core.relational import Relational

from hsdsl.completion.printer import text_of
from hsdsl.expression.scope import symbol
from hsdsl.system import TIME, Edge, Mode, Surface

MOST_TOGETHER = 3  # edges whose motions along several guards at once are derived
MOST_DIRECTIONS = 3  # of a reset: their matrix is inverted in symbols
SMALL = 1e-9  # a slope at a random point that counts as zero everywhere, relative to the largest
MOST_ROUNDS = 50  # of Newton's method
MOST_NODES = 2_000  # of a mode's flow, reset and guard, written out: beyond, no motion along a guard is derived
LONG = 200  # operations, from which on a term is not simplified
Point = dict[sp.Symbol, float]


@dataclass(frozen=True)
class Contact:
    """Motion of a mode along the guards of some of its edges, ``edges`` by their numbers.

    ``mode`` is the mode with the constrained flow. The first of its edges are those of the mode itself, but those in
    contact release the state: their surfaces are the pushes with which the flow presses on the guards, negative. Edges
    beyond the mode's own are where an `if` may end. What follows is of the last edge: ``ends`` says of each of its ends
    of an `if` under which condition it is one.
    ``push`` is the derivative of the guard along the flow that presses, of this ``order``: 1, or 2 where the first one,
    ``rate``, is zero on it. ``landing`` is the state that repeated resets take a state near the guard to.
    """

    edges: tuple[int, ...]
    order: int
    mode: Mode
    rate: sp.Expr
    push: sp.Expr
    landing: tuple[sp.Expr, ...]
    ends: tuple[sp.Basic, ...]


def contacts(mode: Mode) -> dict[frozenset[int], Contact]:
    """The motions along guards of a mode, by the edges in contact.

    Those along several guards are there for up to :data:`MOST_TOGETHER` such edges, where none changes what presses on
    the others.
    """
    singles = {frozenset((k,)): found for k in range(len(mode.edges)) if (found := contact(mode, k)) is not None}
    every = dict(singles)
    for size in range(2, len(singles) + 1) if len(singles) <= MOST_TOGETHER else ():
        for few in [few for few in every if len(few) == size - 1]:
            for one in singles:
                (k,) = one
                if k > max(few) and all(_apart(singles[one], singles[frozenset((j,))], mode) for j in few):
                    found = contact(every[few].mode, k)
                    if found is not None:
                        every[few | one] = replace(found, edges=(*every[few].edges, k))
    return every


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


def contact(mode: Mode, k: int) -> Contact | None:
    """The motion along the guard of edge k of a mode; None where there is none, or where it is not unique."""
    edge = mode.edges[k]
    if edge.target != mode.name or edge.target_states != mode.states or mode.derived:
        return None
    states = [symbol(name) for name in mode.states]
    if not _is_small((*mode.flow, *edge.reset, edge.surface.residual)):
        return None
    constrained = _constrained(states, mode, edge)
    if constrained is None:
        return None
    flow, landing, at = constrained
    push, order = _push(states, mode.flow, edge, at)
    if order is None:
        return None
    release = replace(edge, surface=zero_surface(-push), condition=None, condition_text=None,
                      reset=tuple(states), reset_texts=mode.states)  # fmt: skip
    further, ends = _ends_of_condition(release, edge.condition)
    edges = (*mode.edges[:k], release, *mode.edges[k + 1 :], *further)
    held = replace(mode, flow=flow, flow_texts=tuple(map(text_of, flow)), edges=edges)
    rate = cancelled(along(edge.surface.residual, states, mode.flow))
    return Contact((k,), order, held, rate, push, landing, tuple(ends))


def _constrained(states: list[sp.Symbol], mode: Mode, edge: Edge):
    """The flow that stays where a reset keeps the state, the way there, and a point; None where there is none."""
    changed = [i for i, (x, r) in enumerate(zip(states, edge.reset, strict=True)) if x != r]
    moved = sp.Matrix([edge.reset[i] - states[i] for i in changed])
    if not changed or (at := _fixed_point(states, [edge.surface.residual, *moved], mode.flow)) is None:
        return None
    slopes = moved.jacobian([TIME, *states])
    own = slopes[:, [1 + i for i in changed]]
    rank = _rank(own, at)
    if not 0 < rank <= MOST_DIRECTIONS or _rank(slopes, at) > rank:
        return None
    part, size = sp.eye(len(changed)), sp.trace(own)
    for k in range(2, rank + 1):  # Faddeev and LeVerrier: own part / size projects along the reset's directions
        part = own * part - size * sp.eye(len(changed))
        size = sp.trace(own * part) / k
    if abs(_number(size, at)) <= SMALL:  # the reset does not contract: a shear
        return None
    held = list(mode.flow)
    for i, correction in zip(changed, part * slopes * sp.Matrix([1, *mode.flow]), strict=True):
        held[i] = cancelled(held[i] - correction / size)
    landing = list[sp.Expr](states)
    for i, correction in zip(changed, part * moved, strict=True):
        landing[i] = cancelled(landing[i] - correction / size)
    return tuple(held), tuple(landing), at


def _push(states: list[sp.Symbol], flow: Sequence[sp.Expr], edge: Edge, at: Point):
    """The first derivative of a guard along the flow that the reset takes back, and which one it is."""
    rate = along(edge.surface.residual, states, flow)
    for order, value in ((1, edge.surface.residual), (2, rate)):
        slopes = [sp.diff(value, x) for x in states]
        back = [sum(g * sp.diff(r - x, y) for g, x, r in zip(slopes, states, edge.reset, strict=True)) for y in states]
        if any(abs(_number(b, at)) > SMALL for b in back):
            return cancelled(along(value, states, flow)), order
    return rate, None


def along(value: sp.Expr, states: list[sp.Symbol], flow: Sequence[sp.Expr]) -> sp.Expr:
    """The derivative of an expression along a flow."""
    return sp.diff(value, TIME) + sum(sp.diff(value, x) * f for x, f in zip(states, flow, strict=True))


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


def _is_small(expressions: Sequence[sp.Expr]) -> bool:
    """Whether expressions written out are short enough to be differentiated twice as trees."""
    sizes: dict[sp.Basic, int] = {}

    def size(expr: sp.Basic) -> int:
        if expr not in sizes:
            sizes[expr] = 1 + sum(map(size, expr.args))
        return sizes[expr]

    return sum(map(size, map(sp.sympify, expressions))) <= MOST_NODES


def _fixed_point(states: list[sp.Symbol], equations: list[sp.Expr], further: Sequence[sp.Expr]) -> Point | None:
    """A random point where equations hold, by Newton's method; None where none is found."""
    names: set[sp.Symbol] = set().union(*(sp.sympify(e).free_symbols for e in (*equations, *further)), states)
    draw = random.Random(1)
    at = {name: draw.uniform(1, 2) for name in sorted(names, key=str)}
    slopes = sp.Matrix(equations).jacobian(states)
    for _ in range(MOST_ROUNDS):
        values = np.array([_number(e, at) for e in equations])
        if not np.all(np.isfinite(values)):
            return None
        step = np.linalg.pinv(_numbers(slopes, at), rcond=SMALL) @ values
        for name, change in zip(states, step.tolist(), strict=True):
            at[name] -= change
        if np.max(np.abs(step)) <= SMALL:
            return at
    return None


def _number(value: sp.Expr, at: Point) -> float:
    number = sp.sympify(value).xreplace({name: sp.Float(number) for name, number in at.items()}).evalf()
    return float(number) if number.is_Number and number.is_real else math.nan


def _numbers(matrix: sp.Matrix, at: Point) -> np.ndarray:
    return np.array([[_number(value, at) for value in row] for row in matrix.tolist()]).reshape(matrix.shape)


def _rank(matrix: sp.Matrix, at: Point) -> int:
    numbers = _numbers(matrix, at)
    return int(np.linalg.matrix_rank(numbers, rtol=SMALL)) if np.all(np.isfinite(numbers)) else 0
