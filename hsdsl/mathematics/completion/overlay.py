# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportReturnType=false, reportCallIssue=false
"""All motions of a mode along its guards in one copy of the mode, in which numbers choose the guards in contact.

Contacts are independent where none changes what another one depends on. Each chooses its own rows of the flow, so any
subset costs as much as all of them. Of the others each connected set has rows of its own (`coupled_contacts`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from hsdsl.base.functions import absolute, below
from hsdsl.base.parts import numbered
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, Surface
from hsdsl.mathematics.completion.contact import Contact, contact
from hsdsl.mathematics.completion.coupled_contacts import Pairs, connected_sets, coupled_flow, neighbours
from hsdsl.mathematics.completion.nearby import NO_SLOPES, Slopes, slopes_of_inputs
from hsdsl.mathematics.program import HELD, LOOKED_AT

_NAN = symbol("nan")


@dataclass(frozen=True)
class Overlay:
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


def overlays(system: HybridSystem) -> list[Overlay | None]:
    """The motions along guards of each mode of a system."""
    numbers, moving = numbered(system.parts), slopes_of_inputs(system)
    return [overlay(mode, numbers, moving) for mode in system.modes]


def overlay(mode: Mode, numbers: Sequence[str] = (), moving: Slopes = NO_SLOPES) -> Overlay | None:
    """The motions along guards of a mode, None without any; for ``numbers`` and ``moving`` see `contact`."""
    contacts = [found for k in range(len(mode.edges)) if (found := contact(mode, k, numbers, moving))]
    if not contacts:
        return None
    flags = tuple(symbol(f"contact {i}") for i in range(len(contacts)))
    flow, pushes = _flow_and_pushes(mode, contacts, flags)
    chosen = flags if len(flags) > 1 else (sp.Integer(HELD),)
    edges, releases = list(mode.edges), list[int | None]([None] * len(mode.edges))
    for i, (found, flag) in enumerate(zip(contacts, chosen, strict=True)):
        edges[found.edge] = _released(found, flag, flags[i], *pushes[i])
        releases[found.edge] = i
        edges += [replace(end, surface=_nowhere_else(end.surface, flag)) for end in found.further]
        releases += [i] * len(found.further)
    known = dict(zip(flags, chosen, strict=True)) if len(flags) == 1 else {}
    whole = replace(mode, flow=tuple(row.xreplace(known) for row in flow) if known else tuple(flow), edges=tuple(edges))
    return Overlay(whole, flags, tuple(contacts), tuple(releases))


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
    return flow, [_push(mode, found, flow, flag) if near[k] else
                  (found.push, _size(found, found.near.rates(found.last)))
                  for k, (found, flag) in enumerate(zip(contacts, flags, strict=True))]  # fmt: skip


def _push(mode: Mode, found: Contact, flow: Sequence[sp.Expr], flag: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    """The push on a guard along the flow that the others leave, and the size of its terms."""
    places = dict(zip(found.near.states, flow, strict=True))
    left = {x: rate for x, rate in found.near.rates(found.last).items() if x != TIME}
    left |= {x: places[x].xreplace({flag: sp.S.Zero}) for x in left if x in places}
    return lie_derivative(found.last, left), _size(found, left)


def _size(found: Contact, flow: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """The size of the terms of a push along a flow."""
    return sp.Add(*(absolute(sp.diff(found.last, x) * rate) for x, rate in {TIME: sp.S.One, **flow}.items()))


def _released(found: Contact, chosen: sp.Expr, flag: sp.Symbol, push: sp.Expr, size: sp.Expr) -> Edge:
    """An edge that, in contact, is reached where the push on its guard falls through zero.

    Where it is looked at, the parts of its `if` hold that motion along its guard keeps at their limits.
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
        condition = sp.And(*(_of_contact(part, part.xreplace(lasting), flag) for part in parts))
    condition = None if condition in (None, sp.true) else condition
    return replace(edge, surface=Surface(left, right, residual, was.text), condition=condition)


def _of_contact(part: sp.Basic, lasting: sp.Basic, flag: sp.Symbol) -> sp.Basic:
    """A part of an `if`: in contact it holds; where that is looked at, what ``lasting`` says of it."""
    return sp.Or(part, sp.Ge(flag, HELD), sp.And(sp.Ge(flag, LOOKED_AT), lasting))


def _nowhere_else(surface: Surface, flag: sp.Expr) -> Surface:
    """A surface that is reached in contact only."""
    residual = below(flag, LOOKED_AT, sp.S.NegativeOne, surface.residual)
    return Surface(residual, sp.S.Zero, residual, surface.text)
