# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false, reportCallIssue=false
"""All motions of a mode along its guards in one copy of the mode, in which numbers choose the guards in contact.

Contacts are independent where none changes what another one depends on. Each chooses its own rows of the flow, so any
subset costs as much as all of them. Of the others each connected set has rows of its own.

A contact takes u (w phi)/(w u) away of a flow phi. Here u is a direction of its reset, and w the row that the reset
keeps; some resets have a few such pairs. With Q f the flow along the guards of a set, that with one contact more is
Q f - Q u (w Q f)/(w Q u). This is exact in symbols, so what is at rest has the rate zero.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from hsdsl.base.functions import absolute, below
from hsdsl.base.parts import numbered
from hsdsl.language.expression.algebra import derivative, lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, Surface
from hsdsl.mathematics.completion.contact import Alike, Contact, contact
from hsdsl.mathematics.completion.nearby import MOST_NODES, NO_SLOPES, Slopes, cancelled, size, slopes_of_inputs
from hsdsl.mathematics.program import HELD, LOOKED_AT

_NAN = symbol("nan")


class ConstrainedMode(NamedTuple):
    """A mode's motions along its guards, by the numbers of contacts.

    ``mode`` has the states and walls of the mode, its edges, and then ends of `if`. ``flags`` are `HELD` for contacts
    that hold, which constrain the flow, `LOOKED_AT` for others that may, and else 0. Where a flag is not 0, the surface
    of the contact's edge is the push on its guard, negative, along the flow that the others leave. The flow is
    not-a-number where contacts hold that have none together. ``releases`` has for each edge of ``mode`` the number of
    the contact that it ends.
    """

    mode: Mode
    flags: tuple[sp.Symbol, ...]
    contacts: tuple[Contact, ...]
    releases: tuple[int | None, ...]


def constrained_modes(system: HybridSystem) -> list[ConstrainedMode | None]:
    """The motions along guards of each mode of a system."""
    numbers, moving = frozenset(numbered(system.parts)), slopes_of_inputs(system)
    return [constrained_mode(mode, numbers, moving) for mode in system.modes]


def constrained_mode(mode: Mode, numbers: Collection[str] = (), moving: Slopes = NO_SLOPES) -> ConstrainedMode | None:
    """The motions along guards of a mode, None without any; for ``numbers`` and ``moving`` see `contact`."""
    alike: Alike = {}
    contacts = [found for k in range(len(mode.edges)) if (found := contact(mode, k, numbers, moving, alike))]
    if not contacts:
        return None
    flags = tuple(symbol(f"contact {i}") for i in range(len(contacts)))
    flow, pushes = _flow_and_pushes(mode, contacts, flags)
    chosen = flags if len(flags) > 1 else (sp.Integer(HELD),)
    edges, releases = list(mode.edges), list[int | None]([None] * len(mode.edges))
    for i, (found, flag) in enumerate(zip(contacts, chosen, strict=True)):
        edges[found.edge] = _released(found, flag, flags[i], *pushes[i])
        releases[found.edge] = i
        for end, _ in found.further:  # is reached in contact only
            residual = below(flag, LOOKED_AT, sp.S.NegativeOne, end.surface.residual)
            edges.append(replace(end, surface=Surface(residual, sp.S.Zero, residual, end.surface.text)))
        releases += [i] * len(found.further)
    known = dict(zip(flags, chosen, strict=True)) if len(flags) == 1 else {}
    whole = replace(mode, flow=tuple(row.xreplace(known) for row in flow) if known else tuple(flow), edges=tuple(edges))
    return ConstrainedMode(whole, flags, tuple(contacts), tuple(releases))


def _flow_and_pushes(mode: Mode, contacts: Sequence[Contact], flags: Sequence[sp.Symbol]):
    """The flow with all choices, and for each contact its push and the size of that."""
    flow, near = list(mode.flow), neighbours(contacts)
    off = [below(flag, HELD, sp.S.One, sp.S.Zero) for flag in flags]
    pairs: dict[int, Pairs] = {}
    seen: set[int] = set()

    def choose(few: Sequence[int], rows: dict[int, sp.Expr]) -> None:
        beyond = set().union(*(near[k] for k in few)).difference(few)
        other = sp.Add(*(off[k] for k in few), *(1 - off[k] for k in sorted(beyond)))
        alone = len(few) == 1 and not beyond
        for i, row in rows.items():
            flow[i] = below(flags[few[0]], HELD, flow[i], row) if alone else below(other, 1, row, flow[i])

    for k, found in enumerate(contacts):
        choose((k,), found.rows)
    for first in range(len(contacts)):
        if first in seen or not near[first]:
            continue
        sets = connected_sets(near, first)
        for few in sets or ():
            seen |= few
            members = sorted(few)
            rows = coupled_flow([contacts[k] for k in members], pairs)
            choose(members, rows or {i: _NAN for k in members for i in contacts[k].rows})
        if sets is None:
            for i in contacts[first].rows:
                other = sp.Add(*(1 - off[j] for j in sorted(near[first])))
                flow[i] = below(flags[first], HELD, flow[i], below(other, 1, flow[i], _NAN))
    places = dict(zip(mode.vector_field, flow, strict=True))
    return flow, [_push(found, places, flag) if near[k] else
                  (found.push, _size(found, found.near.rates(found.last)))
                  for k, (found, flag) in enumerate(zip(contacts, flags, strict=True))]  # fmt: skip


def _push(found: Contact, flow: Mapping[sp.Symbol, sp.Expr], flag: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """The push on a guard along the flow that the others leave, and the size of its terms."""
    left = {x: rate for x, rate in found.near.rates(found.last).items() if x != TIME}
    left |= {x: flow[x].xreplace({flag: sp.S.Zero}) for x in left if x in flow}
    return lie_derivative(found.last, left), _size(found, left)


def _size(found: Contact, flow: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """The size of the terms of a push along a flow."""
    return sp.Add(*(absolute(sp.diff(found.last, x) * rate) for x, rate in {TIME: sp.S.One, **flow}.items()))


def _released(found: Contact, chosen: sp.Expr, flag: sp.Symbol, push: sp.Expr, size: sp.Expr) -> Edge:
    """An edge that, in contact, is reached where the push on its guard falls through zero.

    Where it is examined, the parts of its `if` hold that motion along its guard keeps at their limits.
    """
    edge = found.near.edge
    was, condition = edge.surface, edge.condition
    left, right, residual = (
        below(chosen, LOOKED_AT, side, other)
        for side, other in ((was.left, size), (was.right, sp.S.Zero), (was.residual, -push))
    )
    if condition is not None:
        parts = condition.args if isinstance(condition, sp.And) else (condition,)
        lasting = dict.fromkeys(found.kept, sp.true)
        looked_at, holds = sp.Ge(flag, LOOKED_AT), sp.Ge(flag, HELD)  # in contact it holds
        condition = sp.And(*(sp.Or(p, holds, sp.And(looked_at, p.xreplace(lasting))) for p in parts))
    condition = None if condition in (None, sp.true) else condition
    return replace(edge, surface=Surface(left, right, residual, was.text), condition=condition)


MOST_SETS = 64  # of contacts that are connected: further ones of such contacts hold only one at a time
Vector = dict[sp.Symbol, sp.Expr]  # of time and states; without those that are zero
Pairs = tuple[tuple[Vector, Vector], ...]


def neighbours(contacts: Sequence[Contact]) -> list[set[int]]:
    """For each contact those that change what it depends on, or the other way round, by number."""
    by_state: dict[sp.Symbol, list[int]] = {}
    for i, found in enumerate(contacts):
        for x in found.near.own:
            by_state.setdefault(x, []).append(i)
    near: list[set[int]] = [set() for _ in contacts]
    for k, found in enumerate(contacts):
        for j in {i for x in depends_on(found) for i in by_state.get(x, ()) if i != k}:
            if contacts[j].projection != found.projection:  # both stops of one mass: together as each of them
                near[k].add(j)
                near[j].add(k)
    return near


def depends_on(found: Contact) -> set[sp.Symbol]:
    """What a motion along a guard depends on."""
    shares = set[sp.Symbol]().union(*found.projection.values())
    rate = found.rate.free_symbols if found.order == 2 else set()
    return set(found.near.own) | found.near.guard.free_symbols | rate | shares


def connected_sets(near: Sequence[set[int]], first: int) -> list[frozenset[int]] | None:
    """The connected sets of two contacts and more among those connected with one, small ones first; None for many."""
    group, latest = {first}, {first}
    while latest:
        latest = set().union(*(near[k] for k in latest)) - group
        group |= latest
    found: list[frozenset[int]] = []
    sets = {frozenset((k,)) for k in group}
    while sets:
        sets = {few | {j} for few in sets for k in few for j in near[k] - few}
        found += sorted(sets, key=sorted)
        if len(found) > MOST_SETS:
            return None
    return found


def coupled_flow(contacts: Sequence[Contact], pairs: dict[int, Pairs]) -> dict[int, sp.Expr] | None:
    """The rows of the flow along the guards of a connected set, by states' numbers; None where that is not one flow.

    ``pairs`` keeps what is known of contacts, by their edges.
    """
    rates, rows = Vector(), dict[int, sp.Symbol]()
    for found in contacts:
        near = found.near
        rows |= dict(zip(near.changed, near.own, strict=True))
        for x in (*near.own, *(y for shares in found.projection.values() for y in shares)):
            rates.setdefault(x, near.flow(x))
        if found.edge not in pairs:
            pairs[found.edge] = tuple(_split(found))
    along = _along([pair for found in contacts for pair in pairs[found.edge]], rates)
    if along is None or size(along.values()) > MOST_NODES:
        return None
    return {i: along.get(x, sp.S.Zero) for i, x in rows.items()}


def _split(found: Contact):
    """The pairs of a direction and a row whose products add up to a contact's projection, but for factors."""
    if found.along is not None:
        yield found.along, {x: derivative(found.last, x) for x in found.near.among(found.last)}
        return
    names = dict(zip(found.near.changed, found.near.own, strict=True))
    left = {names[i]: dict(shares) for i, shares in found.projection.items()}
    while rest := {x: shares for x, shares in left.items() if shares}:
        x, y = next(((x, y) for x, shares in rest.items() for y in shares if y == x), None) or next(
            (x, y) for x, shares in rest.items() for y in shares if y != TIME
        )
        u = {z: shares[y] / rest[x][y] for z, shares in rest.items() if y in shares}
        w = rest[x]
        yield u, w
        left = {z: _less(shares, w, u.get(z, sp.S.Zero)) for z, shares in rest.items()}


def _less(vector: Vector, other: Vector, share: sp.Expr) -> Vector:
    """A vector less a multiple of another one."""
    names = dict.fromkeys((*vector, *other)) if share != 0 else dict.fromkeys(vector)
    found = {x: cancelled(vector.get(x, sp.S.Zero) - share * other.get(x, sp.S.Zero)) for x in names}
    return {x: value for x, value in found.items() if value != 0}


def _dot(row: Vector, vector: Vector) -> sp.Expr:
    return cancelled(sp.Add(*(share * vector[x] for x, share in row.items() if x in vector)))


def _along(pairs: Sequence[tuple[Vector, Vector]], vector: Vector) -> Vector | None:
    """A vector projected along all directions onto what all rows keep; None where these depend on each other."""
    directions = [u for u, _ in pairs]
    for i, (_, w) in enumerate(pairs):
        u = directions[i]
        if (whole := _dot(w, u)) == 0:
            return None
        vector = _less(vector, u, _dot(w, vector) / whole)
        directions[i + 1 :] = [_less(other, u, _dot(w, other) / whole) for other in directions[i + 1 :]]
    return vector
