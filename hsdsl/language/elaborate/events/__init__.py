# pyright: basic
"""Events: edges that fire where a condition turns true, written as edges with memory.

The memory of an event NAME is in states that do not flow (`hsdsl.base.names.memory`): ``NAME@armed`` is 1 once the
condition was false, and ``NAME@due`` where a reset made it true. With a delay ``NAME@waiting`` counts the executions
that wait; the first is made at ``NAME@at``, and ``NAME@to.x`` is the value that x then gets. Others are no states.
An event of a part belongs to one mode of it: in the others its surfaces are inside and its memory means nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hsdsl.base.functions import maximum
from hsdsl.base.names import SINCE
from hsdsl.base.parts import Part
from hsdsl.language.elaborate.events.event import Draft, Event, Values, chosen, dropped, edges_of, number_left
from hsdsl.language.expression.algebra import select, whole
from hsdsl.language.expression.conditions import Reached, comparisons
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import ONE, TIME, ZERO, Edge, HybridSystem, Initial, Mode, started

Order = tuple[str, ...] | None  # of the states of a mode; None of a final one, which has those of the mode before it


def with_events(system: HybridSystem) -> HybridSystem:
    """The system with the memory of its events, and edges that fire, wait and arm again."""
    timed = SINCE not in (*system.states, *(parameter.name for parameter in system.parameters))
    events = {mode.name: _events(system, mode, timed) for mode in system.modes}
    if not any(events.values()):
        return system
    order = {
        mode.name: (*mode.states, *_all_states(events[mode.name])) if mode.states or not mode.final else None
        for mode in system.modes
    }
    memories = {name: Memory(own) for name, own in events.items()}
    modes = tuple(_mode(mode, memories, order) for mode in system.modes)
    parts = tuple(_part(part, [event for own in events.values() for event in own]) for part in system.parts)
    return replace(system, modes=modes, initial=_start(system, events), parts=parts)


def _events(system: HybridSystem, mode: Mode, timed: bool) -> tuple[Event, ...]:
    constants = frozenset(system.parameter_symbols)
    flow = {TIME: ONE} | ({symbol(SINCE): ONE} if timed else {})
    flow |= mode.vector_field
    edges = _ranked(mode, [_at_once(edge, mode, timed) for edge in mode.edges if edge.event is not None])
    drafts = [Event(edge, mode, timed, flow, constants) for edge in edges]
    index, jumps = Memory(drafts), set[str]()
    changes = [(edge.name, _new_values(edge, timed)) for edge in mode.edges if edge.target == mode.name and drafts]
    for event in drafts:  # what is stored may be that of a state itself
        changes.append((event.edge.name, {symbol(x): symbol(name) for x, name in event.stored.items()}))
    for name, meaning in changes:
        for event in index.concerned(meaning):  # a reset of its own that it makes later is one as any other
            other = event.edge.name != name or event.delay is not None
            jumps |= {event.edge.name} if event.touched(meaning) or (other and event.leaves(meaning)) else set()
    return tuple(replace(e, jumps=not e.event.initially or e.edge.name in jumps) for e in drafts)


def _ranked(mode: Mode, edges: list[Edge]) -> list[Edge]:
    """Events of a mode that has no other transitions: if the values of priorities rank them, numbers are such values.

    So the file orders equal values, whether they are written as numbers or not.
    """
    given = [event.priority for edge in edges if (event := edge.event) is not None]
    if len(edges) != len(mode.edges) or all(priority is None for priority in given):
        return edges
    values = (whole(edge.priority) if rank is None else rank for edge, rank in zip(edges, given, strict=True))
    return [
        replace(edge, priority=0, event=edge.event and replace(edge.event, priority=value))
        for edge, value in zip(edges, values, strict=True)
    ]


def _at_once(edge: Edge, mode: Mode, timed: bool) -> Edge:
    """An edge of an event, without a delay of 0 where no other edge of its mode changes what it reads.

    Then its values and its condition are the same where it is triggered and where it is made.
    """
    event = edge.event
    if event is None or event.delay != 0 or edge.target != mode.name:
        return edge
    read = frozenset().union(*(edge.values[x].free_symbols for x in event.given if x in edge.values))
    read |= frozenset().union(*(c.residual.free_symbols for c in comparisons(event.trigger)))
    others = (other for other in mode.edges if other is not edge and other.target == mode.name)
    if any(read & _new_values(other, timed).keys() for other in others):
        return edge
    return replace(edge, event=replace(event, delay=None, at_execution=False))


def _part(part: Part, events: Sequence[Event]) -> Part:
    """A part with the memory of its events among the states of their modes."""
    own: dict[int, list[str]] = defaultdict(list)
    for event in events:
        if event.edge.part is None or event.edge.part[0] == part.name:
            own[0 if event.edge.part is None else event.edge.part[1] - 1] += event.states
    return replace(part, states=tuple((*states, *own[k]) for k, states in enumerate(part.states)))


def _mode(mode: Mode, memories: Mapping[str, Memory], order: Mapping[str, Order]) -> Mode:
    own, edges = memories[mode.name].events, list[Edge]()
    by_name = {e.edge.name: e for e in own}
    for edge in mode.edges:
        drafts = [(edge, None, None)] if edge.event is None else edges_of(by_name[edge.name], own)
        made = [_remembered(draft, memories, order) for draft in drafts]
        given = () if edge.event is None else (edge.name, edge.event.text, *edge.event.options)
        edges += made if not given else [replace(part, of_event=given) for part in made]
    further = _all_states(own)
    return replace(
        mode,
        states=(*mode.states, *further),
        flow=(*mode.flow, *(ZERO for _ in further)),
        flow_texts=(*mode.flow_texts, *("0" for _ in further)),
        edges=tuple(edges),
        queues=tuple(event.queue for event in own if event.queue is not None),
    )


def _start(system: HybridSystem, events: Mapping[str, tuple[Event, ...]]) -> Initial:
    """The initial values with the memory of every event whose condition they decide."""
    values, initial = dict(system.initial.in_order), system.initial
    known = {symbol(name) for name in values} | set(system.parameter_symbols)
    meaning = {TIME: ZERO} | ({} if symbol(SINCE) in known else {symbol(SINCE): ZERO})
    for event in (event for own in events.values() for event in own):
        kept = dict.fromkeys(event.states, ZERO)
        kept |= chosen(event, event.here({}, {}), _entered(event, meaning), kept)
        if all(value.free_symbols <= known for value in kept.values()):
            values |= kept
    names = [name for name, _ in initial.values] + [name for name in values if name not in dict(initial.values)]
    return started(initial.mode, names, tuple(values.items()))


class Memory:
    """The events of a mode, by the symbols that change what they remember."""

    def __init__(self, events: Sequence[Event]) -> None:
        self.events = events
        self._by_symbol: dict[Any, list[Event]] = defaultdict(list)
        for event in events:
            for name in event.symbols | number_left(event.edge).keys():
                self._by_symbol[name].append(event)

    def concerned(self, meaning: Iterable[Any]) -> list[Event]:
        """The events that new values of symbols may concern."""
        return list({event.edge.name: event for name in meaning for event in self._by_symbol.get(name, ())}.values())


def _new_values(edge: Edge, timed: bool) -> dict[Any, Any]:
    return edge.changes if edge.stays or not timed else edge.changes | {symbol(SINCE): ZERO}


def _all_states(events: Sequence[Event]) -> tuple[str, ...]:
    return tuple(name for event in events for name in event.states)


def _remembered(draft: Draft, memories: Mapping[str, Memory], order: Mapping[str, Order]) -> Edge:
    """An edge with what the events of its target remember after it."""
    edge, fired, reached = draft
    given = edge.values
    index, inside = memories[edge.target], edge.source == edge.target
    values: Values = {}
    if not inside:
        for event in index.events:
            values |= _entered(event, _new_values(edge, event.timed))
    else:
        values |= _stayed(edge, fired, reached, index)
    own = order[edge.target]
    for name in _all_states(memories[edge.source if own is None else edge.target].events):
        values.setdefault(name, symbol(name) if inside or own is None else ZERO)
    values |= {name: value for name, value in given.items() if name not in values or value != symbol(name)}
    names = (*given, *_all_states(memories[edge.source].events)) if own is None else own
    ordered = {name: values[name] for name in names}
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    return replace(
        edge,
        target_states=tuple(ordered),
        reset=tuple(ordered.values()),
        reset_texts=tuple(texts.get(name, name) for name in ordered),  # readers see no other memory
    )


def _stayed(edge: Edge, fired: Event | None, reached: Reached | None, index: Memory) -> Values:
    """What events remember after an edge that does not leave the mode; that of a part may enter another one of it."""
    values: Values = {}
    meaning, known = _new_values(edge, bool(index.events) and index.events[0].timed), number_left(edge)
    for event in {e.edge.name: e for e in (*index.concerned(meaning), *([fired] if fired else []))}.values():
        before, after = event.here({}, known), event.here(meaning, known)
        if fired is not None and event.edge is fired.edge:
            stays = _after_firing(event, meaning, reached)
        else:
            stays = _changed(event, meaning, reached)
        entering = after * (1 - before) if event.edge.part is not None and after != before else ZERO
        values |= chosen(event, before, stays, {name: symbol(name) for name in stays})
        if entering != 0:
            names = dict.fromkeys(event.states, ZERO)
            others = {name: values.get(name, symbol(name)) for name in names}
            values |= chosen(event, entering, names | _entered(event, meaning), others)
    return values


def _entered(event: Event, meaning: Mapping[Any, Any]) -> Values:
    """The memory where the mode is entered from another one, or a run starts."""
    holds = event.after(meaning)
    due = ZERO if event.event.initially else holds
    return {event.names["armed"]: ONE - holds} | ({event.names["due"]: due} if event.jumps else {})


def _after_firing(event: Event, meaning: Mapping[Any, Any], reached: Reached | None) -> Values:
    """The memory after the event fired: at a surface it holds, unless it is changed or the flow is turned back there.

    Then its condition is false however short the flow goes back for, unless that drops what waits. Where it was due it
    need not have held: a reset that makes it true then sets it off again.
    """
    changed, armed = event.touched(meaning), ZERO
    left = maximum(event.symbol("due") - 1, ZERO) if event.jumps and reached is None else ZERO
    if reached is None or changed or event.leaves(meaning):
        holds = event.going_on(meaning, reached, not dropped(event))
        armed, left = ONE - holds, left + (event.symbol("armed") * holds if changed and reached is None else ZERO)
    return {event.names["armed"]: armed} | ({event.names["due"]: left} if event.jumps else {})


def _changed(event: Event, meaning: Mapping[Any, Any], reached: Reached | None) -> Values:
    """The memory after another edge changed the condition, or how it changes along the flow."""
    touched, persistent = event.touched(meaning), event.event.persistent
    if not touched and not event.leaves(meaning):
        return {}
    armed, holds, rises = event.symbol("armed"), event.going_on(meaning, reached), event.rises(reached)
    now = (maximum(holds, rises) if persistent else holds) if touched else rises  # the flow may turn it true at once
    due = event.symbol("due") + armed * now  # each time that it turns true at one instant
    values = {
        event.names["armed"]: ONE - holds if touched else select(rises, ONE - holds, armed),
        event.names["due"]: due if persistent else maximum(event.symbol("due"), armed * now) * holds,
    }
    return values | {name: symbol(name) * holds for name in dropped(event)}
