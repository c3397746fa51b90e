# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false
"""Motion along a guard: the flow that ever faster transitions of one edge tend to (M11).

Near a point that a reset R keeps, flow for a short time and reset, over and over, is flow projected along the
directions that R contracts onto the tangents of its fixed points: the constrained flow is the flow plus a multiple of
the reset's directions that keeps R(x) = x.

A reset with kinks has one branch for slow impacts, where these decide the signs in it: they come from the side on which
the rate of the guard is positive (M2), which decides that of what is zero at rest, as of v in `abs(v)`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import takewhile
from typing import Any

import sympy as sp
from sympy.core.relational import Relational

from hsdsl.base.functions import absolute, maximum, minimum, power, renamed, rewritten, sign
from hsdsl.base.names import memory, without_memory
from hsdsl.language.expression.algebra import Shape, derivative, lie_derivative
from hsdsl.language.expression.plain import text_of
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Altered, Edge, Mode, Surface
from hsdsl.mathematics.completion.nearby import (
    NO_SLOPES,
    Nearby,
    Point,
    Slopes,
    as_float,
    cancelled,
    counts_of,
    drawn,
    fixed_point,
    is_zero,
    jacobian,
    mode_of_part,
    product,
    rank,
    size_at,
    solved,
    value_at,
)

MOST_DIRECTIONS = 3  # of a reset: their matrix is inverted in symbols


@dataclass(frozen=True)
class Contact:
    """Motion of a mode along the guard of one of its edges, ``edge`` by its number.

    ``base`` is the mode. ``rows`` has the constrained flow of the states whose flow changes, by their numbers.
    ``projection`` has what each of these rows takes away of the flow, as shares of the rates of time and states.
    ``release`` is in the place of the edge in contact: its surface is the push of the flow on the guard, negative.
    ``further`` edges, beyond the mode's own, are where an `if` may end, each with the condition under which it does;
    ``kept`` has those of its inequalities that motion along the guard keeps at their limits. ``push`` is the
    derivative of ``last`` along the flow. That is the guard where ``order`` is 1, or else, where the guard's own
    derivative ``rate`` is zero on it, that rate. ``landing`` is the state to which repeated resets lead from a state
    near the guard. ``counts`` are the states that they count with, which keep their values. ``along`` is the direction
    of a reset that takes all of ``last`` back, None of another one.
    """

    edge: int
    order: int
    base: Mode
    rows: dict[int, sp.Expr]
    projection: dict[int, dict[sp.Symbol, sp.Expr]]
    rate: sp.Expr
    push: sp.Expr
    landing: Altered
    near: Nearby
    counts: tuple[int, ...]
    kept: tuple[Relational, ...]
    along: dict[sp.Symbol, sp.Expr] | None

    @property
    def release(self) -> Edge:
        """The edge by which the motion along the guard ends."""
        edge, kept = self.base.edges[self.edge], Altered(self.near.states, {})
        return replace(edge, surface=zero_surface(-self.push), condition=None, condition_text=None, reset=kept,
                       reset_texts=self.base.states)  # fmt: skip

    @cached_property
    def further(self) -> list[tuple[Edge, sp.Basic]]:
        """The edges where an `if` may end, each with the condition under which it does."""
        condition = self.base.edges[self.edge].condition
        return _ends_of_condition(self, condition, [atom for atom in atoms_of(condition) if atom not in self.kept])

    @property
    def last(self) -> sp.Expr:
        """What the flow along the guard keeps at zero and the push is the derivative of."""
        return self.near.guard if self.order == 1 else self.rate

    @property
    def mode(self) -> Mode:
        """The mode with the constrained flow."""
        flow, texts, edges = list(self.base.flow), list(self.base.flow_texts), list(self.base.edges)
        for i, row in self.rows.items():
            flow[i], texts[i] = row, text_of(row)
        edges[self.edge] = self.release
        further = (edge for edge, _ in self.further)
        return replace(self.base, flow=tuple(flow), flow_texts=tuple(texts), edges=(*edges, *further))


Alike = dict[tuple[Any, ...], "tuple[Contact | None, Shape]"]


def contact(
    mode: Mode, k: int, numbers: Collection[str] = (), moving: Slopes = NO_SLOPES, alike: Alike | None = None
) -> Contact | None:
    """The motion along the guard of edge k of a mode; None where there is none, or where it is not unique.

    ``numbers`` are states that are modes of parts, ``moving`` has the slopes of inputs. ``alike`` keeps what is found,
    for edges that are the same up to names.
    """
    edge = mode.edges[k]
    if edge.target != mode.name or edge.target_states != mode.states or mode.derived or not fires(edge):
        return None
    kept = [i for i, name in enumerate(mode.states) if not without_memory([name])] if edge.of_event else []
    if any(mode.states[i] in numbers for i in edge.reset.changes if i not in kept):
        return None
    near = Nearby(mode, edge, mode_of_part(edge, numbers), kept, moving=moving)
    if not near.changed or not near.is_small():
        return None
    if alike is None or edge.of_event:
        return _found(near, k, kept)
    shape, kinds = near.shape(atoms_of(edge.condition))
    if (key := (*kinds, *shape.key)) not in alike:
        alike[key] = _found(near, k, kept), shape
    found, known = alike[key]
    names = dict(zip(map(symbol, known.names), map(symbol, shape.names), strict=True))
    return found and _renamed(found, near, k, names)


def _found(near: Nearby, k: int, kept: Sequence[int]) -> Contact | None:
    """The motion along the guard of edge k."""
    mode, edge = near.mode, near.edge
    if (near := branched(near)) is None:
        return None
    near = near.without(counts) if (counts := (*kept, *counts_of(near))) else near
    constrained = _constrained(near) if near.changed and near.is_small() else None
    if constrained is None:
        return None
    rows, projection, landing, at = constrained
    push, order = _push(near, at)
    if order is None or (edge.of_event and order == 1 and not _stays(near.guard, near, rows, at)):
        return None  # a condition that stays true does not turn true again
    lasting = tuple(atom for atom in atoms_of(edge.condition) if _is_kept(_falling(atom), near, rows, push, at))
    rate = cancelled(near.along(near.guard))
    along = _direction(near, near.guard if order == 1 else rate, projection, at)
    return Contact(k, order, mode, rows, projection, rate, push, landing, near, counts, lasting, along)


def _renamed(found: Contact, near: Nearby, k: int, names: Mapping[sp.Symbol, sp.Symbol]) -> Contact:
    """The motion along the guard of edge k, which is that of another edge but for names."""
    if found.edge == k:
        return found
    done: dict[Any, Any] = {}

    def of(value: Any) -> Any:
        return renamed(value, names, done)

    was = found.base.edges[found.edge]
    place = dict(zip(was.reset.changes, near.edge.reset.changes, strict=True))
    counts = tuple(place[i] for i in found.counts)
    if (impact := found.near.impact) is not None:
        changes = {place[i]: of(value) for i, value in found.near.edge.reset.changes.items()}
        near = near.by(
            replace(near.edge, reset=Altered(near.edge.reset.kept, changes)), {of(x): v for x, v in impact.items()}
        )
    near = near.without(counts) if counts else near
    pairs = zip(atoms_of(was.condition), atoms_of(near.edge.condition), strict=True)
    return Contact(
        k,
        found.order,
        near.mode,
        {place[i]: of(row) for i, row in found.rows.items()},
        {place[i]: {of(x): of(share) for x, share in shares.items()} for i, shares in found.projection.items()},
        of(found.rate),
        of(found.push),
        Altered(near.states, {place[i]: of(value) for i, value in found.landing.changes.items()}),
        near,
        counts,
        tuple(atom for other, atom in pairs if other in found.kept),
        found.along and {of(x): of(share) for x, share in found.along.items()},
    )


def atoms_of(condition: sp.Basic | None) -> list[Relational]:
    """The inequalities in a condition."""
    return sorted(condition.atoms(Relational), key=str) if condition is not None else []


def fires(edge: Edge) -> bool:
    """Whether an edge is no event's, or makes an event where its condition turns true, however others are ranked."""
    if not edge.of_event:
        return True
    names = {name.name for name in edge.condition.free_symbols} if edge.condition is not None else set[str]()
    remembered = names - {*without_memory(names)}
    return edge.name == edge.of_event[0] and remembered == {memory(edge.of_event[0], "armed")}


def _constrained(near: Nearby):
    """The rows of the flow that stays where a reset keeps the state, what they take away, the way there, and a point.

    None where there is none.
    """
    if (at := fixed_point(near)) is None:
        return None
    moved, own = near.moved, [near.states[i] for i in near.changed]
    among = list(dict.fromkeys((*near.among(sp.Tuple(*moved)), *own)))
    slopes, own = jacobian(moved, among), jacobian(moved, own)
    count = rank(own, at)
    if not 0 < count <= MOST_DIRECTIONS or rank(slopes, at) > count:
        return None
    part, size = sp.eye(len(near.changed)), sp.trace(own)
    for k in range(2, count + 1):  # Faddeev and LeVerrier: own part / size projects along the reset's directions
        part = product(own, part) - size * sp.eye(len(near.changed))
        size = sp.trace(product(own, part)) / k
    if is_zero(size, at):  # the reset does not contract: a shear
        return None
    rows: dict[int, sp.Expr] = {}
    part, away, sided = product(part, slopes), product(part, moved), _sided(own, count, at)
    for i, correction in zip(near.changed, product(part, sp.Matrix(list(map(near.flow, among)))), strict=True):
        flow = near.flow(near.states[i])
        rows[i] = flow if is_zero(correction, at) else cancelled(flow - correction / size) * sided
    projection: dict[int, dict[sp.Symbol, sp.Expr]] = {}
    for i, shares in zip(near.changed, part.tolist(), strict=True):
        found = {x: cancelled(share / size) for x, share in zip(among, shares, strict=True)}
        projection[i] = {x: share for x, share in found.items() if share != 0}
    steps = zip(near.changed, away, strict=True)
    landing = {i: cancelled(near.states[i] - correction / size) for i, correction in steps}
    return rows, projection, Altered(near.states, landing), at


def _sided(own: sp.Matrix, count: int, at: Point) -> sp.Expr:
    """1 where kinks of a reset are on the sides that a point is on; no value at those beyond which it keeps less.

    That is on an edge of what it keeps, as of `max(u - v, 0)` at u = 0: no one flow is known there.
    """
    found = sp.S.One
    for kink in sorted(own.atoms(sign), key=str):
        here = sp.Integer(1 if value_at(kink.args[0], at) > 0 else -1)
        if rank(own.xreplace({kink: -here}), at) > count:
            found *= 2 / (kink**2 + here * kink)
    return found


def _direction(near: Nearby, last: sp.Expr, projection: dict[int, dict[sp.Symbol, sp.Expr]], at: Point):
    """The direction of a reset that keeps the states where ``last`` is zero: by a state with a constant slope in that.

    It is short where the projection is long, and divides by nothing that parameters may make zero.
    """
    slopes = {x: derivative(last, x) for x in near.among(last)}
    if (x := next((x for x in near.own if x in slopes and slopes[x].is_Number and slopes[x] != 0), None)) is None:
        return None
    found = {y: derivative(change, x) for y, change in zip(near.own, near.moved, strict=True)}
    if not (found := {y: sp.Mul.make_args(u) for y, u in found.items() if not is_zero(u, at)}):
        return None
    common = set.intersection(*map(set, found.values()))
    along = {y: sp.Mul(*(factor for factor in u if factor not in common)) for y, u in found.items()}
    whole = sp.Add(*(u * slopes[y] for y, u in along.items() if y in slopes))
    for i, y in zip(near.changed, near.own, strict=True):
        for z in {**slopes, **projection[i]}:
            share = along.get(y, sp.S.Zero) * slopes.get(z, sp.S.Zero)
            if not is_zero(projection[i].get(z, sp.S.Zero) * whole - share, at):
                return None
    return along


def _push(near: Nearby, at: Point):
    """The first derivative of a guard along the flow that the reset takes back, and which one it is."""
    rate = near.along(near.guard)
    moved = {near.states[i]: change for i, change in zip(near.changed, near.moved, strict=True)}
    for order, value in ((1, near.guard), (2, rate)):
        slopes = [(derivative(value, x), moved[x]) for x in near.among(value) if x in moved]
        by = near.among(sp.Tuple(*(change for _, change in slopes)))
        back = [sum(g * derivative(change, y) for g, change in slopes) for y in by if y != TIME]
        if not all(is_zero(b, at) for b in back):
            return cancelled(near.along(value)), order
    return rate, None


def _is_kept(value: sp.Expr, near: Nearby, rows: dict[int, sp.Expr], push: sp.Expr, at: Point) -> bool:
    """Whether a value is zero all along the guard, and rises where the flow presses: what it decides never ends."""
    presses = value_at(near.along(value), at) * value_at(push, at) > 0
    return presses and is_zero(value, at) and _stays(value, near, rows, at)


def _stays(value: sp.Expr, near: Nearby, rows: dict[int, sp.Expr], at: Point) -> bool:
    """Whether a value does not change along the guard."""
    constrained = {near.states[i]: row for i, row in rows.items()}
    flow = {x: constrained[x] if x in constrained else near.flow(x) for x in near.among(value)}
    return is_zero(lie_derivative(value, flow), at)


def _falling(atom: Relational) -> sp.Expr:
    """What is positive where an inequality holds."""
    return atom.gts - atom.lts if hasattr(atom, "gts") else atom.lhs - atom.rhs


def _ends_of_condition(found: Contact, condition: sp.Basic | None, ending: Sequence[Relational]):
    """Edges where an `if` may end, one for each inequality ``ending`` and each way that counts, and when it does."""
    if condition is None or not ending:
        return []
    release, ends = found.release, list[tuple[Edge, sp.Basic]]()
    plain = isinstance(condition, Relational) or (
        isinstance(condition, sp.And) and set(condition.args) == condition.atoms(Relational)
    )
    for atom in ending:
        falling = _falling(atom)
        for residual, beyond in ((-falling, sp.false),) if plain else ((-falling, sp.false), (falling, sp.true)):
            end = replace(release, surface=zero_surface(residual))
            ends.append((end, sp.Not(condition.xreplace({atom: beyond}))))
    return ends


def zero_surface(residual: sp.Expr) -> Surface:
    """The surface where an expression rises through zero."""
    return Surface(residual, sp.S.Zero, residual, f"{text_of(residual)} >= 0")


KINKED = (absolute, maximum, minimum, sign)
SPEEDS = (1e-6, 1e-9, 1e-12)  # of the rate of the guard: impacts that are examined
SEEDS = range(1, 9)  # of points where they are


class Undecided(Exception):
    """The side from which impacts come does not decide a sign."""


def branched(near: Nearby) -> Nearby | None:
    """What a motion depends on, with the branch of the reset that impacts take; None where they take no one branch."""
    if not near.moved.has(*KINKED) and not any(map(_is_root, near.moved.atoms(sp.Pow))):
        return near
    series = (list(takewhile(bool, (_impact(near, speed, seed) for speed in SPEEDS))) for seed in SEEDS)
    impacts = [points for points in series if len(points) == len(SPEEDS)]  # one is found at each speed
    if not impacts:
        return near
    branch = _Branch(near, impacts)
    try:
        changes = near.edge.reset.changes
        values = {i: branch.of(value) if i in near.changed else value for i, value in changes.items()}
    except Undecided:
        return None
    if values == changes:
        return near
    return near.by(replace(near.edge, reset=Altered(near.edge.reset.kept, values)), impacts[0][0])


def _impact(near: Nearby, speed: float, seed: int) -> Point | None:
    """A random point of a guard that is reached at a speed; at any where the rate of the guard is a constant."""
    rate = near.along(near.guard)
    free = [x for x in near.among(sp.Tuple(near.guard, rate)) if x != TIME]
    at = drawn((near.guard, rate, *near.moved, *near.flows()), seed, {*near.states, TIME})
    found = solved([near.guard, rate - as_float(speed * size_at(rate, at))], free, at)
    return found if found and value_at(rate, found) > 0 else None


def _is_root(power: sp.Pow) -> bool:
    return not power.exp.is_Integer and bool(power.base.free_symbols)


@dataclass
class _Branch:
    """A branch of expressions, by series of ever slower impacts."""

    near: Nearby
    impacts: Sequence[Sequence[Point]]
    done: dict[sp.Basic, sp.Basic] = field(default_factory=dict[sp.Basic, sp.Basic])

    def of(self, expr: sp.Basic) -> sp.Basic:
        """The branch of an expression."""
        return rewritten(expr, self._chosen, self.done)

    def _chosen(self, expr: sp.Basic) -> sp.Basic:
        if isinstance(expr, (sign, absolute)) and (side := self._side(expr.args[0])):
            return side * (expr.args[0] if isinstance(expr, absolute) else sp.S.One)
        if isinstance(expr, (maximum, minimum)) and (side := self._side(expr.args[0] - expr.args[1])):
            return expr.args[0 if (side > 0) == isinstance(expr, maximum) else 1]
        return self._power(*expr.args) if expr.is_Pow and _is_root(expr) else expr

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> sp.Expr:
        """A power; of what is zero at rest it is that to the first order."""
        if base.is_Pow and base.exp.is_Integer and base.exp % 2 == 0 and (side := self._side(base.base)):
            base, exponent = side * base.base, base.exp * exponent
        if exponent == 1 or not self._vanishes(base):
            return power(base, exponent)
        if exponent.is_number and exponent > 1:
            return sp.S.Zero
        raise Undecided

    def _vanishes(self, value: sp.Expr) -> bool:
        """Whether a value is zero at rest."""
        return all(abs(value_at(value, at[-1])) <= abs(value_at(value, at[0])) / 2 for at in self.impacts)

    def _side(self, value: sp.Expr) -> int:
        """The sign of a value before slow impacts; 0 where it has either, and is not zero at rest."""
        if not self.near.among(value):
            return 0
        found = [[value_at(value, at) for at in points] for points in self.impacts]
        signs = {(number > 0) - (number < 0) for values in found for number in values}
        if len(signs) == 1 and signs != {0}:
            return signs.pop()
        if any(abs(values[-1]) <= abs(values[0]) / 2 for values in found):
            raise Undecided
        return 0
