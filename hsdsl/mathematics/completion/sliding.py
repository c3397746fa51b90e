# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false
"""Sliding: the flow on a surface that two modes press on (Filippov 1988, doi:10.1007/978-94-015-7793-3).

Mode a has an edge to b where r >= 0, b one back where r <= 0, and neither changes a state. Where r grows along the flow
of a and falls along that of b, a state can follow neither. It stays on the surface and follows s b + (1 - s) a with
the share s for which r does not change. A method keeps a surface that is affine. Off one that is curved s brings the
state back, in the time that the size of r takes at its rates but not faster than within a part of the run, and leaving
takes it onto the surface along the difference of the flows: errors of steps do not add up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import sympy as sp

from hsdsl.base.functions import atan2, below, floor, sign
from hsdsl.language.expression.algebra import lie_derivative
from hsdsl.language.expression.plain import text_of
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, Edge, HybridSystem, Mode, Surface
from hsdsl.mathematics.completion.contact import zero_surface
from hsdsl.mathematics.completion.nearby import cancelled, slopes_of_inputs

PART = sp.Rational(1, 1024)  # of the run: a surface's size alone, zero where all states in it are, bounds no rate
JUMP = sp.Rational(1, 2**26)  # of the size of a surface: the root of the round-off; steps leave it by less
JUMPING = (floor, sign, below, atan2)


class Sliding(NamedTuple):
    """Sliding between two modes: ``mode`` slides, ``entries`` are the edges of both modes into it."""

    mode: Mode
    entries: tuple[Edge, Edge]


def with_sliding(system: HybridSystem) -> HybridSystem:
    """The system with a mode for each surface that two modes press on; the same where there is none."""
    found = slidings(system)
    if not found:
        return system
    return replace(system, modes=(*with_entries(system, found), *(sliding.mode for sliding in found)))


def with_entries(system: HybridSystem, found: Sequence[Sliding]) -> tuple[Mode, ...]:
    """The modes of a system with the edges into slidings."""
    modes = {mode.name: mode for mode in system.modes}
    for sliding in found:
        for entry in sliding.entries:
            mode = modes[entry.source]
            modes[mode.name] = replace(mode, edges=(*mode.edges, entry))
    return tuple(modes.values())


def slidings(system: HybridSystem) -> list[Sliding]:
    """The slidings of a system, in file order of the edges into their surfaces."""
    names = {mode.name for mode in system.modes}
    found: list[Sliding] = []
    for a, out, b, back in _pairs(system):
        name = base = f"sliding_{a.name}_{b.name}"
        number = 2
        while name in names:
            name, number = f"{base}_{number}", number + 1
        names.add(name)
        found.append(_sliding(system, name, a, out, b, back))
    return found


def _pairs(system: HybridSystem) -> Iterator[tuple[Mode, Edge, Mode, Edge]]:
    """Two modes with the edges from one to the other on one surface, each pair once."""
    modes = list(system.modes)
    for i, a in enumerate(modes):
        for b in modes[i + 1 :]:
            if a.states and sorted(a.states) == sorted(b.states):
                for out in a.edges:
                    for back in b.edges:
                        to_and_fro = out.target == b.name and back.target == a.name and _opposite(out, back)
                        if to_and_fro and not _first(a, out) & _first(b, back):
                            yield a, out, b, back


def _first(mode: Mode, edge: Edge) -> set[str]:
    """The modes that edges of higher priority on the same surface lead to; a common one is sliding that is written."""
    return {e.target for e in mode.edges if e.priority > edge.priority and _factor(e, edge) > 0}


def _opposite(out: Edge, back: Edge) -> bool:
    """Whether two edges that change no state cross one surface in opposite directions, whenever it is reached."""
    plain = all(e.condition is None and e.reset == tuple(map(symbol, e.target_states)) for e in (out, back))
    return plain and _factor(out, back) < 0


def _factor(one: Edge, other: Edge) -> sp.Number:
    """The number by which the residual of an edge is that of another one; 0 where it is none."""
    r, s = (sp.expand(edge.surface.residual).as_coefficients_dict() for edge in (one, other))
    term = next(iter(r))
    factor = r[term] / s[term] if s.get(term) else sp.S.Zero
    return factor if {each: value * factor for each, value in s.items()} == dict(r) else sp.S.Zero


def _sliding(system: HybridSystem, name: str, a: Mode, out: Edge, b: Mode, back: Edge) -> Sliding:
    states = [symbol(state) for state in a.states]
    flows = a.flow, tuple(b.vector_field[x] for x in states)
    r, until = out.surface.residual, system.experiment.until
    moving = slopes_of_inputs(system)
    outwards, inwards = (cancelled(lie_derivative(r, {**mode.vector_field, **moving})) for mode in (a, b))
    slopes = [sp.diff(r, x) for x in states]
    curved = any(slope.free_symbols & {TIME, *states, *moving} for slope in (*slopes, sp.diff(r, TIME)))
    pressing = cancelled(outwards - inwards)

    def size(part: sp.Expr) -> sp.Expr:
        """The size of the surface, not below what it may move by in a part of the run."""
        terms = ((slope * x) ** 2 for slope, x in zip(slopes, states, strict=True))
        return sp.sqrt((part * until * pressing) ** 2 + sp.Add(*terms))

    share, back_to = outwards / pressing, r / size(PART) if curved else sp.S.Zero

    def blended(f: sp.Expr | None, g: sp.Expr | None) -> sp.Expr | None:
        """A flow or an output in between."""
        if f is None or g is None or f == g:
            return f if f == g else None
        return cancelled(f + share * (g - f)) + back_to * (g - f)

    flow = tuple(map(blended, *flows))
    stay = {"target_states": a.states, "reset": tuple(states), "reset_texts": a.states, "condition": None}
    pairs = zip(a.states, states, *flows, strict=True)
    onto = {state: x + r * (g - f) / pressing if curved else x for state, x, f, g in pairs}

    def leave(mode: Mode, surface: Surface, priority: int) -> Edge:
        reset = tuple(onto[state] for state in mode.states)
        texts = tuple(map(text_of, reset))
        given = {**stay, "target_states": mode.states, "reset": reset, "reset_texts": texts}
        return Edge(f"{name}->{mode.name}", name, mode.name, surface, priority=priority, **given)

    leave_a = leave(a, zero_surface(-outwards), out.priority)
    leave_b = leave(b, zero_surface(inwards), back.priority)
    thrown = _thrown(system, r, leave_a, leave_b, JUMP * size(sp.S.One))
    mode = replace(
        a,
        name=name,
        flow=flow,
        flow_texts=tuple(map(text_of, flow)),
        edges=(leave_a, leave_b, *thrown, *_others(name, a, out, b, back)),
        walls=tuple(dict.fromkeys((*a.walls, *b.walls))),
        outputs=tuple(map(blended, a.outputs, b.outputs)),
        scene=tuple(map(blended, a.scene, b.scene)),
        slides=(a.name, b.name),
    )
    enter = {**stay, "target": name}
    into_a = replace(out, name=f"{a.name}->{name}", priority=out.priority + 1, **enter)
    into_b = replace(back, name=f"{b.name}->{name}", priority=back.priority + 1, **enter)
    pairs = (into_a, sp.Lt(inwards, 0)), (into_b, sp.Gt(outwards, 0))
    entries = [replace(edge, condition=where, condition_text=text_of(where)) for edge, where in pairs]
    return Sliding(mode, (entries[0], entries[1]))


def _thrown(system: HybridSystem, r: sp.Expr, leave_a: Edge, leave_b: Edge, least: sp.Expr) -> list[Edge]:
    """The edges by which a surface that jumps away from a state leaves it behind, in one mode or the other.

    They go before those that put it on the surface.
    """
    given = {symbol(each.name): bool(each.jump_times) for each in system.inputs}
    known = {TIME, *given, *system.parameter_symbols}
    switched = (e for e in r.atoms(*JUMPING) if e.free_symbols <= known and e.free_symbols & {TIME, *given})
    if not any(given.get(x) for x in r.free_symbols) and not any(switched):
        return []
    found: list[Edge] = []
    for edge, beyond in ((leave_a, -r - least), (leave_b, r - least)):
        name, states = f"{edge.name}_behind", edge.target_states
        stay = {"reset": tuple(map(symbol, states)), "reset_texts": states, "priority": edge.priority + 1}
        found.append(replace(edge, name=name, surface=zero_surface(beyond), **stay))
    return found


def _others(name: str, a: Mode, out: Edge, b: Mode, back: Edge) -> list[Edge]:
    """The further edges of both modes, those of the first one first; one of two that do the same."""
    found: list[Edge] = []
    seen: list[Edge] = []
    for mode, own in ((a, out), (b, back)):
        for edge in mode.edges:
            if edge is own:
                continue
            edge = _kept_on(name, a.states, out.surface.residual, edge)
            if any(_same(e, edge) for e in seen):
                continue
            seen.append(edge)
            label = edge.name if edge.name not in {e.name for e in found} else f"{edge.name}_{mode.name}"
            found.append(replace(edge, name=label, source=name))
    return found


def _kept_on(name: str, states: tuple[str, ...], r: sp.Expr, edge: Edge) -> Edge:
    """An edge of a mode, as one that leads back to the sliding where it leads back to its mode and keeps the surface.

    So a ball that comes to rest beside a sliding does so in it. Where nothing presses after the reset, sliding ends.
    """
    resets = dict(zip(edge.target_states, zip(edge.reset, edge.reset_texts, strict=True), strict=True))
    if edge.target != edge.source or edge.of_event or set(resets) != set(states):
        return edge
    reset, texts = zip(*map(resets.__getitem__, states), strict=True)
    there = r.xreplace({symbol(state): value for state, value in zip(states, reset, strict=True)})
    if sp.expand(there - r) != 0:
        return edge
    return replace(edge, target=name, target_states=states, reset=reset, reset_texts=texts)


def _same(one: Edge, other: Edge) -> bool:
    """Whether two edges do the same: of two that lead back to their own modes the first counts."""
    back = one.target == one.source and other.target == other.source
    keys = ("condition", "priority", "target_states", "reset")
    alike = all(getattr(one, key) == getattr(other, key) for key in keys)
    if not alike or not (back or one.target == other.target):
        return False
    return _factor(one, other) > 0
