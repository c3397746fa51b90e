# pyright: basic
"""Events: edges that fire where a condition turns true, written as edges with memory.

The memory of an event NAME is in states that do not flow (`hsdsl.names.memory`): ``NAME@armed`` is 1 once the
condition was false, and ``NAME@due`` where a reset made it true. With a delay the state ``NAME@waiting`` is 1 until
``NAME@at``, and ``NAME@to.x`` is the value that x then gets.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from hsdsl.expression.scope import symbol
from hsdsl.expression.trigger import Reached, comparisons, condition, number
from hsdsl.functions import maximum
from hsdsl.names import SINCE, memory
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
    events = {mode.name: _events(mode, timed) for mode in system.modes}
    if not any(events.values()):
        return system
    final = tuple(_overflow(e, system) for own in events.values() for e in own if e.delay is not None)
    events |= {mode.name: () for mode in final}
    order = {mode.name: (*mode.states, *_memory(events[mode.name])) for mode in (*system.modes, *final)}
    modes = tuple(_mode(mode, events, order) for mode in system.modes)
    return replace(system, modes=modes + final, initial=_start(system, events))


def _events(mode: Mode, timed: bool) -> tuple[_Event, ...]:
    return tuple(_Event(edge, mode, timed) for edge in mode.edges if edge.event is not None)


@dataclass(frozen=True)
class _Event:
    """An event as it was written, ``edge``, and the names of the states that remember what it did.

    ``timed`` says that `since` is the time since the mode was entered.
    """

    edge: Edge
    mode: Mode
    timed: bool

    @cached_property
    def names(self) -> dict[str, str]:
        parts = ["armed"] + (["due"] if self.jumps else []) + (["waiting", "at"] if self.delay is not None else [])
        return {part: memory(self.edge.name, part) for part in parts}

    @cached_property
    def jumps(self) -> bool:
        """Whether the condition may turn true by a reset, or holds where the mode is entered."""
        loops = (edge for edge in self.mode.edges if edge.target == self.mode.name)
        return not self.event.initially or any(self.touched(self.meaning(edge)) for edge in loops)

    def meaning(self, edge: Edge) -> dict[Any, Any]:
        """The new value of each symbol that an edge changes."""
        pairs = zip(edge.target_states, edge.reset, strict=True)
        meaning: dict[Any, Any] = {symbol(name): value for name, value in pairs if value != symbol(name)}
        return meaning if edge.stays or not self.timed else meaning | {symbol(SINCE): ZERO}

    def rate(self, expression: Any) -> Any:
        """How fast an expression changes along the flow of the mode."""
        clocks = {TIME: ONE} | ({symbol(SINCE): ONE} if self.timed else {})
        moving = clocks | dict(zip(map(symbol, self.mode.states), self.mode.flow, strict=True))
        return sum((expression.diff(s) * flow for s, flow in moving.items() if s in expression.free_symbols), ZERO)

    @property
    def delay(self) -> Any | None:
        return self.event.delay

    @property
    def event(self) -> Any:
        assert self.edge.event is not None
        return self.edge.event

    @cached_property
    def stored(self) -> dict[str, str]:
        """The name of the value that each state gets after the delay."""
        if self.delay is None:
            return {}
        pairs = zip(self.edge.target_states, self.edge.reset, strict=True)
        return {state: memory(self.edge.name, f"to.{state}") for state, value in pairs if value != symbol(state)}

    @property
    def states(self) -> tuple[str, ...]:
        return (*self.names.values(), *self.stored.values())

    def symbol(self, part: str) -> Any:
        return symbol(self.names[part])

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


def _mode(mode: Mode, events: dict[str, tuple[_Event, ...]], order: Mapping[str, tuple[str, ...]]) -> Mode:
    own = events[mode.name]
    edges: list[Edge] = []
    by_name = {e.edge.name: e for e in own}
    for edge in mode.edges:
        drafts = [(edge, None, None)] if edge.event is None else _edges(by_name[edge.name])
        made = [_remembered(draft, events, order) for draft in drafts]
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


def _edges(event: _Event) -> Iterator[Draft]:
    """The edges of an event: which of them fires it, and the comparison that was reached."""
    edge, trigger, armed = replace(event.edge, event=None), event.event.trigger, event.symbol("armed")
    fires = edge if event.delay is None else _staying(event, f"{edge.name} triggers", _waits(event))
    free = [] if event.delay is None else [at_least(HALF, event.symbol("waiting"))]
    for part in comparisons(trigger):
        others = condition(trigger, partial(_with, event, part, True))
        surface = Surface(part.left, part.right, part.residual, part.text)
        when = all_of(at_least(armed, HALF), others)
        yield replace(fires, surface=surface, condition=all_of(when, *free), condition_text=_text(event)), event, part
        if event.delay is not None:
            full = replace(_overflowing(event), surface=surface)
            yield replace(full, condition=all_of(when, at_least(event.symbol("waiting"), HALF))), None, None
    if event.jumps:
        due = Surface(event.symbol("due"), HALF, event.symbol("due") - HALF, f"{event.names['due']} >= 1/2")
        yield replace(fires, surface=due, condition=None, condition_text=None), event, None
    if event.delay is not None:
        yield _executes(event), None, None
    arms = _staying(event, f"{edge.name} re-arms", {event.names["armed"]: ONE} | _dropped(event))
    for part in comparisons(trigger):
        holds = condition(trigger, partial(_with, event, part, False))
        surface = Surface(part.right, part.left, part.right - part.left, part.opposite)
        when = all_of(at_least(HALF, armed), ~holds)
        yield replace(arms, surface=surface, condition=when, condition_text=f"not ({_text(event)})"), None, None


def _with(event: _Event, reached: Reached, value: bool, part: Reached) -> Any:
    """The Boolean of a comparison where another one turns to a value."""
    turns = part.turns(reached)
    return part.follows(event.rate(part.residual), TIME) if turns is None else TRUTH[value == turns]


def _text(event: _Event) -> str:
    return event.event.text


def _waits(event: _Event) -> Values:
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given = dict(zip(event.edge.target_states, event.edge.reset, strict=True))
    values = {event.names["waiting"]: ONE, event.names["at"]: TIME + delay}
    return values | {name: given[state] for state, name in event.stored.items()}


def _dropped(event: _Event) -> Values:
    return {event.names["waiting"]: ZERO} if event.delay is not None and not event.event.persistent else {}


def _staying(event: _Event, name: str, values: Values) -> Edge:
    """An edge that changes some memory of an event, and nothing else."""
    mode = event.mode
    states = (*mode.states, *values)
    reset = (*map(symbol, mode.states), *values.values())
    edge = replace(event.edge, event=None, name=name, target=mode.name, target_states=states, reset=reset)
    return replace(edge, reset_texts=tuple(map(str, reset)), stays=True, condition_text=None)


def _executes(event: _Event) -> Edge:
    """The edge that gives the states, after the delay, the values that were stored."""
    edge, at = replace(event.edge, event=None), event.symbol("at")
    values = dict(zip(edge.target_states, edge.reset, strict=True))
    values |= {state: symbol(name) for state, name in event.stored.items()}
    if edge.target == event.mode.name:
        values[event.names["waiting"]] = ZERO
    surface = Surface(TIME, at, TIME - at, f"t >= {event.names['at']}")
    when = at_least(event.symbol("waiting"), HALF)
    states, reset = tuple(values), tuple(values.values())
    edge = replace(edge, surface=surface, condition=when, target_states=states, reset=reset)
    return replace(edge, reset_texts=tuple(map(str, reset)), condition_text=f"{event.names['waiting']} >= 1/2")


def _overflow_name(event: _Event) -> str:
    return f"{event.edge.name}-waits-already"


def _overflowing(event: _Event) -> Edge:
    """The edge that ends a run in which an event is triggered while it waits."""
    states = event.mode.states
    edge = replace(event.edge, event=None, name=event.edge.name + _AGAIN, target=_overflow_name(event))
    return replace(edge, target_states=states, reset=tuple(map(symbol, states)), reset_texts=states, stays=True)


def _overflow(event: _Event, system: HybridSystem) -> Mode:
    nothing = (None,) * len(system.outputs)
    return Mode(_overflow_name(event), (), (), (), (), (), nothing, True, scene=(None,) * len(event.mode.scene))


def _memory(events: tuple[_Event, ...]) -> tuple[str, ...]:
    return tuple(name for event in events for name in event.states)


def _remembered(draft: Draft, events: Mapping[str, tuple[_Event, ...]], order: Mapping[str, tuple[str, ...]]) -> Edge:
    """An edge with what the events of its target remember after it."""
    edge, fired, reached = draft
    given = dict(zip(edge.target_states, edge.reset, strict=True))
    inside = edge.source == edge.target
    values: Values = {}
    for event in events[edge.target]:
        own = fired is not None and event.edge is fired.edge
        if not inside:
            values |= _entered(event, event.meaning(edge))
        elif own:
            values |= _after_firing(event, event.meaning(edge), reached)
        elif event.touched(event.meaning(edge)):
            values |= _changed(event, event.meaning(edge))
    kept = inside or not order[edge.target]  # a final mode without a flow has the states of the mode before it
    for name in _memory(events[edge.target if order[edge.target] else edge.source]):
        values.setdefault(name, symbol(name) if kept else ZERO)
    values |= {name: value for name, value in given.items() if name not in values or value != symbol(name)}
    ordered = {name: values[name] for name in order[edge.target] or (*given, *_memory(events[edge.source]))}
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    return replace(
        edge,
        target_states=tuple(ordered),
        reset=tuple(ordered.values()),
        reset_texts=tuple(texts.get(name, str(value)) for name, value in ordered.items()),
    )


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
    values = {
        event.names["armed"]: maximum(armed, ONE - holds),
        event.names["due"]: maximum(due, now) if event.event.persistent else maximum(due * holds, now),
    }
    if _dropped(event):
        values[event.names["waiting"]] = event.symbol("waiting") * holds
    return values


def _start(system: HybridSystem, events: Mapping[str, tuple[_Event, ...]]) -> Initial:
    """The initial values with the memory of every event whose condition they decide."""
    values, initial = dict(system.initial.in_order), system.initial
    known = {symbol(name) for name in values} | set(system.parameter_symbols)
    meaning = {TIME: ZERO} | ({} if symbol(SINCE) in known else {symbol(SINCE): ZERO})
    for event in (event for own in events.values() for event in own):
        memory = _entered(event, meaning)
        if all(value.free_symbols <= known for value in memory.values()):
            values |= memory | {name: ZERO for name in event.states if name not in memory}
    names = [name for name, _ in initial.values] + [name for name in values if name not in dict(initial.values)]
    return started(initial.mode, names, tuple(values.items()))
