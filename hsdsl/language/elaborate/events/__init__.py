# pyright: basic
"""Events: edges that fire where a condition turns true, written as edges with memory.

The memory of an event NAME is in states that do not flow (`hsdsl.base.names.memory`): ``NAME@armed`` is 1 once the
condition was false, and ``NAME@due`` where a reset made it true. With a delay ``NAME@waiting`` counts the executions
that wait; the first is made at ``NAME@at``, and ``NAME@to.x`` is the value that x then gets. Others are no states.
An event of a part belongs to one mode of it: in the others its surfaces are inside and its memory means nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace

from hsdsl.base.names import SINCE
from hsdsl.base.parts import Part
from hsdsl.language.elaborate.events.event import Event, chosen
from hsdsl.language.elaborate.events.firing import edges_of
from hsdsl.language.elaborate.events.remembering import Memory, Order, all_states, entered, new_values, remembered
from hsdsl.language.expression.algebra import whole
from hsdsl.language.expression.conditions import comparisons
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import ONE, TIME, ZERO, Edge, HybridSystem, Initial, Mode, started


def with_events(system: HybridSystem) -> HybridSystem:
    """The system with the memory of its events, and edges that fire, wait and arm again."""
    timed = SINCE not in (*system.states, *(parameter.name for parameter in system.parameters))
    events = {mode.name: _events(system, mode, timed) for mode in system.modes}
    if not any(events.values()):
        return system
    order = {
        mode.name: (*mode.states, *all_states(events[mode.name])) if mode.states or not mode.final else None
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
    changes = [(edge.name, new_values(edge, timed)) for edge in mode.edges if edge.target == mode.name and drafts]
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
    if any(read & new_values(other, timed).keys() for other in others):
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
        made = [remembered(draft, memories, order) for draft in drafts]
        given = () if edge.event is None else (edge.name, edge.event.text, *edge.event.options)
        edges += made if not given else [replace(part, of_event=given) for part in made]
    further = all_states(own)
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
        kept |= chosen(event, event.here({}, {}), entered(event, meaning), kept)
        if all(value.free_symbols <= known for value in kept.values()):
            values |= kept
    names = [name for name, _ in initial.values] + [name for name in values if name not in dict(initial.values)]
    return started(initial.mode, names, tuple(values.items()))
