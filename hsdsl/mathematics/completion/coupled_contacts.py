# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false, reportCallIssue=false
"""Flows along several guards of one mode at once, for each set of contacts that depend on each other.

A contact takes u (w phi)/(w u) away of a flow phi. Here u is a direction of its reset, and w the row that the reset
keeps; some resets have a few such pairs. With Q f the flow along the guards of a set, that with one contact more is
Q f - Q u (w Q f)/(w Q u). This is exact in symbols, so what is at rest has the rate zero.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from hsdsl.language.expression.algebra import derivative
from hsdsl.language.system import TIME
from hsdsl.mathematics.completion.contact import Contact
from hsdsl.mathematics.completion.nearby import MOST_NODES, cancelled, size

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
