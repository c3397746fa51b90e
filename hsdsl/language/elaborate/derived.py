# pyright: basic, reportAttributeAccessIssue=false
"""Systems made of a system: with timers, smaller, or flat.

`with_timers` gives modes that use `since` a state that flows at 1 and that every transition sets to 0. `only` keeps the
states that some names depend on: a state of a mode is needed where its name is given, where a given output, a guard, a
condition or a domain uses it, where the flow of a needed state of that mode uses it, or where the reset of a needed
state of the next mode does. No transition and no needed value depends on the rest. `flat_part` has some product modes
of a system of parts as modes; an edge to another one is a wall there, and nothing where it has an `if`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import reduce
from operator import and_
from typing import Any

import sympy as sp

from hsdsl.base.functions import replaced
from hsdsl.base.graphs import closure
from hsdsl.base.names import SINCE
from hsdsl.base.parts import numbered, numbers_of, present, product_name
from hsdsl.language.expression.algebra import is_number, whole
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import ONE, ZERO, Edge, HybridSystem, Initial, Mode, Surface, started

Node = tuple[str, str]  # a mode and one of its states


def only(system: HybridSystem, given: Iterable[str]) -> HybridSystem:
    """The system with the given states and outputs and what they need; all transitions stay."""
    names = frozenset(given)
    needed = closure(_roots(system, names), _uses(system).__getitem__)
    if all((mode.name, state) in needed for mode in system.modes for state in mode.states):
        return system
    outputs = [k for k, name in enumerate(system.outputs) if name in names]
    own = {mode.name for mode in system.modes if mode.states}
    mode, states = system.initial.mode, {state for _, state in needed}
    start = [name for name, _ in system.initial.values if mode not in own or (mode, name) in needed]
    scale = tuple(item for item in system.experiment.scale if item[0] in states)
    return replace(
        system,
        modes=tuple(_smaller_mode(mode, needed, outputs, own) for mode in system.modes),
        outputs=tuple(system.outputs[k] for k in outputs),
        experiment=replace(system.experiment, scale=scale),
        initial=started(mode, start, system.initial.in_order),
    )


def left_out(system: HybridSystem, reduced: HybridSystem) -> tuple[str, ...]:
    """The states that a reduced system has in no mode or in fewer ones: ``NAME``, or ``NAME in MODE``."""
    gone: list[str] = []
    for mode, smaller in zip(system.modes, reduced.modes, strict=True):
        gone += [
            s if s not in reduced.states else f"{s} in {mode.name}" for s in mode.states if s not in smaller.states
        ]
    return tuple(dict.fromkeys(gone))


def _roots(system: HybridSystem, names: frozenset[str]) -> Iterator[Node]:
    for mode in system.modes:
        expressions = [part for s in mode.surfaces for part in (s.residual, s.left, s.right)]
        expressions += [edge.condition for edge in mode.edges if edge.condition is not None]
        outputs = zip(system.outputs, mode.outputs, strict=True)
        expressions += [output for name, output in outputs if name in names and output is not None]
        yield from _states(mode, expressions)
        yield from ((mode.name, state) for state in mode.states if state in names)


def _uses(system: HybridSystem) -> dict[Node, list[Node]]:
    uses: dict[Node, list[Node]] = defaultdict(list)
    own = {mode.name for mode in system.modes if mode.states}
    for mode in system.modes:
        for state, expression in zip(mode.states, mode.flow, strict=True):
            uses[mode.name, state] += _states(mode, [expression])
        for edge in mode.edges:
            for state, expression in edge.values.items():
                uses[_entered(own, edge, state)] += _states(mode, [expression])
    return uses


def _entered(own: set[str], edge: Edge, state: str) -> Node:
    """The node that a reset defines: a final mode without a flow has the states of the mode it is entered from."""
    return (edge.target if edge.target in own else edge.source), state


def _states(mode: Mode, expressions: Iterable[sp.Basic]) -> Iterator[Node]:
    names = {symbol.name for expression in expressions for symbol in sp.sympify(expression).free_symbols}
    yield from ((mode.name, state) for state in mode.states if state in names)


def _smaller_mode(mode: Mode, needed: set[Node], outputs: list[int], own: set[str]) -> Mode:
    kept = [k for k, state in enumerate(mode.states) if (mode.name, state) in needed]
    gone = {(mode.name, state) for state in mode.states} - needed
    return replace(
        mode,
        states=tuple(mode.states[k] for k in kept),
        flow=tuple(mode.flow[k] for k in kept),
        flow_texts=tuple(mode.flow_texts[k] for k in kept),
        edges=tuple(
            edge.of_states([state for state in edge.target_states if _entered(own, edge, state) in needed])
            for edge in mode.edges
        ),
        outputs=tuple(mode.outputs[k] for k in outputs),
        queues=tuple(
            q.of_states([mode.states[k] for k in kept]) for q in mode.queues if (mode.name, q.waiting) in needed
        ),
        scene=tuple(None if value is None or gone & {*_states(mode, [value])} else value for value in mode.scene),
    )


def flat_part(system: HybridSystem, names: Iterable[str]) -> HybridSystem:
    """The flat system of the product modes of these names; the system itself where it has no parts."""
    if not system.parts:
        return system
    start = {name: int(value) for name, value in system.initial.values if name in numbered(system.parts)}
    first = product_name(system.parts, start)
    every = tuple(dict.fromkeys((first, *names)))
    modes = tuple(_ProductMode(system, name, every).mode() for name in every)
    own = present(system.parts, start)
    values = tuple((name, value) for name, value in system.initial.values if name in own)
    return replace(system, modes=modes, initial=Initial(first, values), parts=())


class _ProductMode:
    """One product mode of a system, among ``every`` one that is made."""

    def __init__(self, system: HybridSystem, name: str, every: tuple[str, ...]) -> None:
        self.system, self.name, self.every = system, name, every
        self.whole: Mode = system.modes[0]
        self.numbers = numbers_of(system.parts, name)
        self.own = present(system.parts, self.numbers)
        self._known = {symbol(part): whole(number) for part, number in self.numbers.items()}
        self._done: dict[Any, Any] = {}

    def here(self, expression: Any) -> Any:
        return None if expression is None else replaced(expression, self._known, self._done)

    def mode(self) -> Mode:
        rows = zip(self.whole.states, self.whole.flow, self.whole.flow_texts, strict=True)
        kept = [(name, self.here(flow), text) for name, flow, text in rows if name in self.own]
        walls, edges = list(filter(None, map(self._surface, self.whole.walls))), list[Edge]()
        for edge in self.whole.edges:
            surface = self._surface(edge.surface)
            made = [] if surface is None else list(self._edges(edge, surface))
            edges += made
            if surface is not None and not made and edge.condition is None:
                walls.append(replace(surface, left=surface.right, right=surface.left))
        final = any(part.final[part.number(self.numbers)] for part in self.system.parts)
        return replace(
            self.whole,
            name=self.name,
            states=tuple(name for name, _, _ in kept),
            flow=tuple(flow for _, flow, _ in kept),
            flow_texts=tuple(text for _, _, text in kept),
            walls=tuple(walls),
            edges=() if final else tuple(edges),
            outputs=tuple(map(self.here, self.whole.outputs)),
            scene=tuple(map(self.here, self.whole.scene)),
            final=final,
        )

    def _surface(self, surface: Surface) -> Surface | None:
        """A surface in this mode; None where its part is in another."""
        residual = self.here(surface.residual)
        if residual == -ONE:
            return None
        return Surface(self.here(surface.left), self.here(surface.right), residual, surface.text)

    def _edges(self, edge: Edge, surface: Surface) -> Iterator[Edge]:
        """An edge for each of the modes that it can lead to."""
        whole = replace(edge.mapped(self.here), source=self.name, surface=surface)
        values = whole.values
        for target in self.every:
            numbers = numbers_of(self.system.parts, target)
            conditions = [is_number(values[part], number) for part, number in numbers.items()]
            if any(condition == False for condition in conditions):  # noqa: E712 - SymPy's own
                continue
            kept = whole.of_states(present(self.system.parts, numbers))
            parts = [c for c in (whole.condition, *conditions) if c is not None and c != True]  # noqa: E712
            yield replace(kept, target=target, condition=reduce(and_, parts) if parts else None)


_TIMER = symbol(SINCE)


def with_timers(system: HybridSystem) -> HybridSystem:
    """The system with the state `since` in every mode whose expressions use it, and in no other."""
    own = {mode.name: not (mode.final and not mode.states) for mode in system.modes}
    timed = {mode.name for mode in system.modes if own[mode.name] and _uses_timer(mode)}
    given, start = dict(system.initial.values), system.initial
    if not timed:
        pairs = [tuple(pair for pair in pairs if pair[0] != SINCE) for pairs in (start.values, start.written)]
        return replace(system, initial=replace(start, values=pairs[0], written=pairs[1])) if SINCE in given else system
    if SINCE not in given:
        start = replace(start, values=(*start.values, (SINCE, ZERO)))
        start = replace(start, written=(*start.written, (SINCE, ZERO)) if start.written else ())
    unit = {SINCE: system.units["t"]} if "t" in system.units else {}
    return replace(
        system,
        modes=tuple(_timed_mode(mode, timed, own) for mode in system.modes),
        initial=start,
        units=system.units | unit,
    )


def _uses_timer(mode: Mode) -> bool:
    parts = [*mode.flow, *mode.outputs, *mode.scene]
    parts += [side for s in mode.surfaces for side in (s.residual, s.left, s.right)]
    parts += [part for edge in mode.edges for part in (edge.condition, *edge.reset.changes.values())]
    return any(_TIMER in getattr(part, "free_symbols", ()) for part in parts)


def _timed_mode(mode: Mode, timed: set[str], own: dict[str, bool]) -> Mode:
    edges = tuple(_timed_edge(edge, timed, own) for edge in mode.edges)
    if mode.name not in timed:
        return replace(mode, edges=edges)
    states, flow = (*mode.states, SINCE), (*mode.flow, ONE)
    return replace(mode, states=states, flow=flow, flow_texts=(*mode.flow_texts, "1"), edges=edges)


def _timed_edge(edge: Edge, timed: set[str], own: dict[str, bool]) -> Edge:
    """An edge that starts the timer of its target; a final mode without a flow keeps that of its source."""
    kept = not own[edge.target] and edge.source in timed
    if edge.target not in timed and not kept:
        return edge
    value, text = (_TIMER, SINCE) if kept or edge.stays else (ZERO, "0")
    return replace(
        edge,
        target_states=(*edge.target_states, SINCE),
        reset=(*edge.reset, value),
        reset_texts=(*edge.reset_texts, text),
    )
