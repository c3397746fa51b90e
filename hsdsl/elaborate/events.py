# pyright: basic
"""Events: edges that fire where a condition turns true, written as edges with memory.

The memory of an event NAME is in states that do not flow (`hsdsl.names.memory`): ``NAME@armed`` is 1 once the
condition was false, and ``NAME@due`` where a reset made it true. With a delay the state ``NAME@waiting`` is 1 until
``NAME@at``, and ``NAME@to.x`` is the value that x then gets; those of further executions that wait end in ``[2]``.
An event of a part belongs to one mode of it: in the others its surfaces are inside and its memory means nothing.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from itertools import pairwise
from typing import Any

from hsdsl.expression.scope import symbol
from hsdsl.expression.selection import is_mode, placed, select, total, whole
from hsdsl.expression.trigger import Reached, comparisons, condition, number, reached
from hsdsl.functions import below, maximum, minimum
from hsdsl.names import SINCE, memory
from hsdsl.parts import Part
from hsdsl.system import (
    HALF,
    ONE,
    TIME,
    TRUTH,
    ZERO,
    Edge,
    HybridSystem,
    Initial,
    Mode,
    Surface,
    all_of,
    at_least,
    started,
)

Values = dict[str, Any]
_AGAIN = " triggers again"


def with_events(system: HybridSystem) -> HybridSystem:
    """The system with the memory of its events, and edges that fire, wait and arm again."""
    timed = SINCE not in (*system.states, *(parameter.name for parameter in system.parameters))
    events = {mode.name: _events(system, mode, timed) for mode in system.modes}
    if not any(events.values()):
        return system
    final = tuple(_overflow(e, system) for own in events.values() for e in own if e.delay is not None)
    events |= {mode.name: () for mode in final}
    order = {mode.name: (*mode.states, *_memory(events[mode.name])) for mode in (*system.modes, *final)}
    memories = {name: _Memory(own) for name, own in events.items()}
    modes = tuple(_mode(mode, memories, order) for mode in system.modes)
    parts = tuple(_part(part, [event for own in events.values() for event in own]) for part in system.parts)
    return replace(system, modes=modes + final, initial=_start(system, events), parts=parts)


def _events(system: HybridSystem, mode: Mode, timed: bool) -> tuple[_Event, ...]:
    constants = frozenset(system.parameter_symbols)
    flow = {TIME: ONE} | ({symbol(SINCE): ONE} if timed else {})
    flow |= dict(zip(map(symbol, mode.states), mode.flow, strict=True))
    drafts = [_Event(edge, mode, timed, flow, constants) for edge in mode.edges if edge.event is not None]
    index, jumps = _Memory(drafts), set[str]()
    for meaning in (_meaning(edge, timed) for edge in mode.edges if edge.target == mode.name and drafts):
        jumps |= {event.edge.name for event in index.concerned(meaning) if event.touched(meaning)}
    return tuple(replace(e, jumps=not e.event.initially or e.edge.name in jumps) for e in drafts)


def _meaning(edge: Edge, timed: bool) -> dict[Any, Any]:
    """The new value of each symbol that an edge changes."""
    pairs = ((symbol(name), value) for name, value in zip(edge.target_states, edge.reset, strict=True))
    meaning: dict[Any, Any] = {name: value for name, value in pairs if value != name}
    return meaning if edge.stays or not timed else meaning | {symbol(SINCE): ZERO}


@dataclass(frozen=True)
class _Event:
    """An event as it was written, ``edge``, and the names of the states that remember what it did.

    ``timed`` says that `since` is the time since the mode was entered, and ``jumps`` that the condition may turn true
    by a reset, or hold where the mode is entered. ``flow`` has the rates of symbols; ``constants`` are parameters.
    """

    edge: Edge
    mode: Mode
    timed: bool
    flow: Mapping[Any, Any]
    constants: frozenset[Any]
    jumps: bool = False

    @cached_property
    def names(self) -> dict[str, str]:
        return {part: memory(self.edge.name, part) for part in (["armed"] + (["due"] if self.jumps else []))}

    @cached_property
    def slots(self) -> tuple[_Slot, ...]:
        """The executions that can wait at a time; one that is not persistent is gone before it is triggered again."""
        if self.delay is None:
            return ()
        given = dict(zip(self.edge.target_states, self.edge.reset, strict=True))
        stored = tuple(state for state in self.event.given if given.get(state, symbol(state)) != symbol(state))
        most = self.event.waiting if self.event.persistent else 1
        return tuple(_Slot(self.edge.name, stored, "" if k == 1 else f"[{k}]") for k in range(1, most + 1))

    @property
    def full(self) -> Any:
        """1 where as many executions wait as can, else 0."""
        return self.slots[-1].waits if self.slots else ZERO

    @cached_property
    def symbols(self) -> frozenset[Any]:
        """What its condition depends on."""
        return frozenset().union(*(c.residual.free_symbols for c in comparisons(self.event.trigger)))

    def rate(self, expression: Any) -> Any:
        """How fast an expression changes along the flow of the mode."""
        known, done = _number(self.edge), dict[Any, Any]()
        moving = ((s, self.flow[s]) for s in sorted(expression.free_symbols, key=str) if s in self.flow)
        return sum((expression.diff(s) * placed(flow, known, done) for s, flow in moving), ZERO)

    @property
    def delay(self) -> Any | None:
        return self.event.delay

    @cached_property
    def priority(self) -> Any:
        """The number that decides which event goes first; 0 where its part is in another mode."""
        given, here = self.event.priority, self.here({}, {})
        return whole(self.edge.priority) if given is None else select(here, self.guarded(given, here), ZERO)

    @cached_property
    def ready(self) -> Any:
        """1 where it is to be made at this instant, else 0."""
        if self.slots:
            ready = reduce(maximum, (slot.ready for slot in self.slots))
        else:
            ready = self.symbol("armed") * self.rises()
            ready = maximum(ready, self.symbol("due")) if self.jumps else ready
        here = self.here({}, {})
        return ready if here == 1 else select(here, self.guarded(ready, here), ZERO)

    @property
    def event(self) -> Any:
        assert self.edge.event is not None
        return self.edge.event

    @property
    def states(self) -> tuple[str, ...]:
        return (*self.names.values(), *(name for slot in self.slots for name in slot.states))

    def symbol(self, part: str) -> Any:
        return symbol(self.names[part])

    def here(self, meaning: Mapping[Any, Any], known: Mapping[Any, Any]) -> Any:
        """1 where its part is in its mode, at new values of states."""
        if self.edge.part is None:
            return ONE
        number = symbol(self.edge.part[0])
        return is_mode(meaning.get(number, number).xreplace(known), self.edge.part[1])

    def guarded(self, expression: Any, truth: Any) -> Any:
        """An expression that has a value also where something is not true."""
        return total(expression, lambda a, b: select(truth, a, b), self.constants)

    def surface(self, left: Any, right: Any, text: str) -> Surface:
        """A surface of its mode; inside everywhere where its part is in another one."""
        here = self.here({}, {})
        if here == 1:
            return Surface(left, right, left - right, text)
        rest = ((left, ZERO), (right, ZERO), (left - right, -ONE))
        left, right, residual = (select(here, self.guarded(side, here), other) for side, other in rest)
        return Surface(left, right, residual, text)

    def touched(self, meaning: Mapping[Any, Any]) -> bool:
        """Whether new values of states change its condition."""
        return any(c.residual.xreplace(meaning) != c.residual for c in comparisons(self.event.trigger))

    def after(self, meaning: Mapping[Any, Any], reached: Reached | None = None) -> Any:
        """1 where the condition holds at new values of states.

        Of the comparisons that stay the one that was ``reached`` holds, and those that counted as reached with it.
        """

        def of(part: Reached) -> Any:
            if reached is None or part.residual.xreplace(meaning) != part.residual:
                return part.holds(meaning)
            turns = part.turns(reached)
            return part.nearly_holds(self.rate(part.residual), TIME) if turns is None else number(turns, of)

        return number(self.event.trigger, of)

    def rises(self) -> Any:
        """1 where the flow turns the condition true at this instant, else 0."""
        return number(self.event.trigger, lambda part: part.rises(self.rate(part.residual), TIME))


@dataclass(frozen=True)
class _Slot:
    """An execution that can wait: its event, states that get the values that are ``stored``, and its number."""

    name: str
    stored: tuple[str, ...]
    number: str

    def _state(self, part: str) -> str:
        return memory(self.name, f"{part}{self.number}")

    @property
    def waits(self) -> Any:
        return symbol(self._state("waiting"))

    @property
    def at(self) -> Any:
        return symbol(self._state("at"))

    @property
    def ready(self) -> Any:
        """1 where it is to be made at this instant, else 0."""
        return self.waits * reached(TIME, self.at)

    @property
    def values(self) -> dict[str, str]:
        return {state: self._state(f"to.{state}") for state in self.stored}

    @property
    def states(self) -> tuple[str, ...]:
        return (self.waits.name, self.at.name, *self.values.values())


class _Memory:
    """The events of a mode, by the symbols that change what they remember."""

    def __init__(self, events: Sequence[_Event]) -> None:
        self.events = events
        self._by_symbol: dict[Any, list[_Event]] = defaultdict(list)
        for event in events:
            for name in event.symbols | _number(event.edge).keys():
                self._by_symbol[name].append(event)

    def concerned(self, meaning: Iterable[Any]) -> list[_Event]:
        """The events that new values of symbols may concern."""
        return list({event.edge.name: event for name in meaning for event in self._by_symbol.get(name, ())}.values())


def _number(edge: Edge) -> dict[Any, Any]:
    """The number of the part's mode that an edge leaves."""
    return {} if edge.part is None else {symbol(edge.part[0]): whole(edge.part[1])}


def _part(part: Part, events: Sequence[_Event]) -> Part:
    """A part with the memory of its events among the states of their modes."""
    own: dict[int, list[str]] = defaultdict(list)
    for event in events:
        if event.edge.part is None or event.edge.part[0] == part.name:
            own[0 if event.edge.part is None else event.edge.part[1] - 1] += event.states
    return replace(part, states=tuple((*states, *own[k]) for k, states in enumerate(part.states)))


def _mode(mode: Mode, memories: Mapping[str, _Memory], order: Mapping[str, tuple[str, ...]]) -> Mode:
    own, edges = memories[mode.name].events, list[Edge]()
    highest = _highest(own)
    by_name = {e.edge.name: e for e in own}
    for edge in mode.edges:
        drafts = [(edge, None, None)] if edge.event is None else _edges(by_name[edge.name], highest)
        made = [_remembered(draft, memories, order) for draft in drafts]
        edges += made if edge.event is None else [replace(part, of_event=True) for part in made]
    further = _memory(own)
    return replace(
        mode,
        states=(*mode.states, *further),
        flow=(*mode.flow, *(ZERO for _ in further)),
        flow_texts=(*mode.flow_texts, *("0" for _ in further)),
        edges=tuple(edges),
    )


def as_written(system: HybridSystem) -> tuple[int, int]:
    """How many modes and transitions the file has, without those that make its events."""
    parts = [edge for mode in system.modes for edge in mode.edges if edge.of_event]
    full = {edge.target for edge in parts if edge.name.endswith(_AGAIN)}
    events = sum(name.endswith(memory("", "armed")) for mode in system.modes for name in mode.states)
    plain = sum(not edge.of_event for mode in system.modes for edge in mode.edges)
    return len(system.modes) - len(full), plain + events


Draft = tuple[Edge, _Event | None, Reached | None]


def _highest(events: Sequence[_Event]) -> Any | None:
    """The highest priority of the events that are to be made at this instant; None where the edges' own decide."""
    if all(event.event.priority is None for event in events):
        return None
    least = reduce(minimum, (event.priority for event in events))
    return reduce(lambda most, e: e.ready * maximum(most, e.priority) + (1 - e.ready) * most, events, least)


def _edges(event: _Event, highest: Any | None) -> Iterator[Draft]:
    """The edges of an event: which of them fires it, and the comparison that was reached."""
    edge, trigger, armed = replace(event.edge, event=None), event.event.trigger, event.symbol("armed")
    fires = edge if event.delay is None else _staying(event, f"{edge.name} triggers", _waits(event))
    if event.delay is not None:  # what only remembers goes before anything that changes states
        fires = replace(fires, priority=1 + max(other.priority for other in event.mode.edges))
    turn = None if highest is None else at_least(event.priority, highest)
    free = [at_least(HALF, event.full)] if event.slots else [] if turn is None else [turn]
    for part in comparisons(trigger):
        others = condition(trigger, partial(_with, event, part, True))
        surface = event.surface(part.left, part.right, part.text)
        when = all_of(at_least(armed, HALF), others)
        yield replace(fires, surface=surface, condition=all_of(when, *free), condition_text=_text(event)), event, part
        if event.slots:
            full = all_of(when, at_least(event.full, HALF))
            yield replace(_overflowing(fires, event), surface=surface, condition=full), None, None
    if event.jumps:
        due = event.symbol("due")
        if highest is not None and not event.slots:
            due *= below(event.priority - highest, ZERO, ZERO, ONE)
        yield _when_due(fires, event, due - event.full), event, None
        if event.slots:
            yield _when_due(_overflowing(fires, event), event, due + event.full - 1), None, None
    for slot in event.slots:
        made = _executes(event, slot)
        yield made if turn is None else replace(made, condition=all_of(made.condition, turn)), None, None
    arms = _staying(event, f"{edge.name} re-arms", {event.names["armed"]: ONE} | _dropped(event))
    for part in comparisons(trigger):
        holds = condition(trigger, partial(_with, event, part, False))
        surface = event.surface(part.right, part.left, part.opposite)
        when = all_of(at_least(HALF, armed), ~holds)
        yield replace(arms, surface=surface, condition=when, condition_text=f"not ({_text(event)})"), None, None


def _when_due(edge: Edge, event: _Event, truth: Any) -> Edge:
    """An edge that goes where a number is 1, and not where it is 0 or less."""
    surface = event.surface(truth, HALF, f"{event.names['due']} >= 1/2")
    return replace(edge, surface=surface, condition=None, condition_text=None)


def _with(event: _Event, reached: Reached, value: bool, part: Reached) -> Any:
    """The Boolean of a comparison where another one turns to a value."""
    turns = part.turns(reached)
    return part.follows(event.rate(part.residual), TIME) if turns is None else TRUTH[value == turns]


def _text(event: _Event) -> str:
    return event.event.text


def _waits(event: _Event) -> Values:
    """The values where an event is triggered: the first slot that is free gets the execution that waits."""
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given = dict(zip(event.edge.target_states, event.edge.reset, strict=True))
    values, before = Values(), ONE  # 1 where the slot before is taken
    for slot in event.slots:
        taken = before * (1 - slot.waits) if len(event.slots) > 1 else ONE
        new = {slot.at.name: TIME + delay} | {name: given[state] for state, name in slot.values.items()}
        values |= {slot.waits.name: ONE if taken == 1 else maximum(slot.waits, before)}
        values |= _chosen(event, taken, new, {name: symbol(name) for name in new})
        before = slot.waits
    return values


def _dropped(event: _Event) -> Values:
    return {} if event.event.persistent else {slot.waits.name: ZERO for slot in event.slots}


def _staying(event: _Event, name: str, values: Values) -> Edge:
    """An edge that changes some memory of an event, and nothing else."""
    mode = event.mode
    states = (*mode.states, *values)
    reset = (*map(symbol, mode.states), *values.values())
    edge = replace(event.edge, event=None, name=name, target=mode.name, target_states=states, reset=reset)
    return replace(edge, reset_texts=tuple(map(str, reset)), stays=True, condition_text=None)


def _executes(event: _Event, slot: _Slot) -> Edge:
    """The edge that gives the states, after the delay, the values that were stored; later slots move up."""
    edge, waiting = replace(event.edge, event=None), slot.waits.name
    values = dict(zip(edge.target_states, edge.reset, strict=True))
    values |= {state: symbol(name) for state, name in slot.values.items()}
    if edge.target == event.mode.name:
        rest = event.slots[event.slots.index(slot) :]
        for one, following in pairwise(rest):
            values |= dict(zip(one.states, map(symbol, following.states), strict=True))
        values[rest[-1].waits.name] = ZERO
    surface = event.surface(TIME, slot.at, f"t >= {slot.at.name}")
    states, reset = tuple(values), tuple(values.values())
    edge = replace(edge, surface=surface, condition=at_least(slot.waits, HALF), target_states=states, reset=reset)
    return replace(edge, reset_texts=tuple(map(str, reset)), condition_text=f"{waiting} >= 1/2")


def _overflow_name(event: _Event) -> str:
    return f"{event.edge.name}-waits-already"


def _overflowing(fires: Edge, event: _Event) -> Edge:
    """The edge that ends a run in which an event is triggered while as many executions wait as can."""
    states = event.mode.states
    edge = replace(fires, name=event.edge.name + _AGAIN, target=_overflow_name(event))
    return replace(edge, target_states=states, reset=tuple(map(symbol, states)), reset_texts=states, stays=True)


def _overflow(event: _Event, system: HybridSystem) -> Mode:
    nothing = (None,) * len(system.outputs)
    return Mode(_overflow_name(event), (), (), (), (), (), nothing, True, scene=(None,) * len(event.mode.scene))


def _memory(events: Sequence[_Event]) -> tuple[str, ...]:
    return tuple(name for event in events for name in event.states)


def _remembered(draft: Draft, memories: Mapping[str, _Memory], order: Mapping[str, tuple[str, ...]]) -> Edge:
    """An edge with what the events of its target remember after it."""
    edge, fired, reached = draft
    given = dict(zip(edge.target_states, edge.reset, strict=True))
    index, inside = memories[edge.target], edge.source == edge.target
    values: Values = {}
    if not inside:
        for event in index.events:
            values |= _entered(event, _meaning(edge, event.timed))
    else:
        values |= _stayed(edge, fired, reached, index)
    kept = inside or not order[edge.target]  # a final mode without a flow has the states of the mode before it
    for name in _memory(memories[edge.target if order[edge.target] else edge.source].events):
        values.setdefault(name, symbol(name) if kept else ZERO)
    values |= {name: value for name, value in given.items() if name not in values or value != symbol(name)}
    ordered = {name: values[name] for name in order[edge.target] or (*given, *_memory(memories[edge.source].events))}
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    return replace(
        edge,
        target_states=tuple(ordered),
        reset=tuple(ordered.values()),
        reset_texts=tuple(texts.get(name, str(value)) for name, value in ordered.items()),
    )


def _stayed(edge: Edge, fired: _Event | None, reached: Reached | None, index: _Memory) -> Values:
    """What events remember after an edge that does not leave the mode; that of a part may enter another one of it."""
    values: Values = {}
    meaning, known = _meaning(edge, bool(index.events) and index.events[0].timed), _number(edge)
    for event in {e.edge.name: e for e in (*index.concerned(meaning), *([fired] if fired else []))}.values():
        before, after = event.here({}, known), event.here(meaning, known)
        if fired is not None and event.edge is fired.edge:
            stays = _after_firing(event, meaning, reached)
        else:
            stays = _changed(event, meaning) if event.touched(meaning) else {}
        entering = after * (1 - before) if event.edge.part is not None and after != before else ZERO
        values |= _chosen(event, before, stays, {name: symbol(name) for name in stays})
        if entering != 0:
            names = dict.fromkeys(event.states, ZERO)
            others = {name: values.get(name, symbol(name)) for name in names}
            values |= _chosen(event, entering, names | _entered(event, meaning), others)
    return values


def _chosen(event: _Event, truth: Any, values: Values, others: Values) -> Values:
    """Values where something is true, and others elsewhere."""
    if truth == 1:
        return values
    return {name: select(truth, event.guarded(value, truth), others[name]) for name, value in values.items()}


def _entered(event: _Event, meaning: Mapping[Any, Any]) -> Values:
    """The memory where the mode is entered from another one, or a run starts."""
    holds = event.after(meaning)
    if event.event.initially:
        return {event.names["armed"]: ONE - holds} | ({event.names["due"]: ZERO} if event.jumps else {})
    return {event.names["armed"]: ONE, event.names["due"]: holds}


def _after_firing(event: _Event, meaning: Mapping[Any, Any], reached: Reached | None) -> Values:
    """The memory after the event fired: at a surface it holds, unless it is changed; where it was due it need not."""
    known = reached is not None and not event.touched(meaning)
    armed = ZERO if known else ONE - event.after(meaning, reached)
    return {event.names["armed"]: armed} | ({event.names["due"]: ZERO} if event.jumps else {})


def _changed(event: _Event, meaning: Mapping[Any, Any]) -> Values:
    """The memory after another edge changed the condition."""
    armed, due, holds = event.symbol("armed"), event.symbol("due"), event.after(meaning)
    now = armed * holds
    if event.event.persistent:  # it also goes where the flow turns it true at this instant
        now = maximum(now, armed * event.rises())
    values = {
        event.names["armed"]: maximum(armed, ONE - holds),
        event.names["due"]: maximum(due, now) if event.event.persistent else maximum(due * holds, now),
    }
    return values | {name: symbol(name) * holds for name in _dropped(event)}


def _start(system: HybridSystem, events: Mapping[str, tuple[_Event, ...]]) -> Initial:
    """The initial values with the memory of every event whose condition they decide."""
    values, initial = dict(system.initial.in_order), system.initial
    known = {symbol(name) for name in values} | set(system.parameter_symbols)
    meaning = {TIME: ZERO} | ({} if symbol(SINCE) in known else {symbol(SINCE): ZERO})
    for event in (event for own in events.values() for event in own):
        kept = dict.fromkeys(event.states, ZERO)
        kept |= _chosen(event, event.here({}, {}), _entered(event, meaning), kept)
        if all(value.free_symbols <= known for value in kept.values()):
            values |= kept
    names = [name for name, _ in initial.values] + [name for name in values if name not in dict(initial.values)]
    return started(initial.mode, names, tuple(values.items()))
