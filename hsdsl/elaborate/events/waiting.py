# pyright: basic
"""Executions that wait: the values where one begins to, the edges that make them, and those that end a run."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

from hsdsl.elaborate.events.event import Event, Slot, Values
from hsdsl.expression.scope import symbol
from hsdsl.functions import below, maximum
from hsdsl.system import HALF, ONE, TIME, ZERO, Edge, HybridSystem, Mode, at_least


def begins_to_wait(event: Event) -> Values:
    """The values where an event is triggered: the execution that waits comes before those that are made later."""
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given = event.edge.values
    waiting, time = _waiting(event), TIME + delay
    values = {waiting.name: ONE if len(event.slots) == 1 else waiting + 1}
    latest = time if delay.free_symbols else None  # with the same delay none is made before one that waits
    for slot, before in zip(event.slots, (None, *event.slots), strict=False):
        new = {slot.at.name: time} | {name: given[state] for state, name in slot.values.items()}
        if before is not None and latest is not None:
            moved = dict(zip(slot.states, map(symbol, before.states), strict=True))
            new = {name: _kept(waiting, before, latest, value, moved[name]) for name, value in new.items()}
        if len(event.slots) > 1:
            new = {name: _kept(waiting, slot, latest, symbol(name), value) for name, value in new.items()}
        values |= new
    return values


def _waiting(event: Event) -> Any:
    """How many executions wait."""
    return event.symbol("waiting")


def _kept(waiting: Any, slot: Slot, latest: Any | None, old: Any, new: Any) -> Any:
    """One value where a slot has an execution, that is made at the latest time or before, and another one elsewhere."""
    kept = old if latest is None else below(latest, slot.at, new, old)
    return below(waiting, slot.number - HALF, new, kept)


def has_room(event: Event) -> Any:
    """Whether one more execution can wait."""
    return at_least(len(event.slots) - HALF, _waiting(event))


def is_full(event: Event) -> Any:
    """Whether as many executions wait as can."""
    return at_least(_waiting(event), len(event.slots) - HALF)


def due(event: Event, full: bool) -> Any:
    """A number that is 1 or more where the event is due while the slots are full, or are not; else 0 or less."""
    most, waiting = len(event.slots), _waiting(event)
    return most * event.symbol("due") + (waiting + 1 - 2 * most if full else -waiting)


def dropped(event: Event) -> Values:
    return {} if event.event.persistent or not event.slots else {_waiting(event).name: ZERO}


def executes(event: Event) -> Edge:
    """The edge that gives the states, after the delay, the values that were stored; later slots move up."""
    edge, first, waiting = replace(event.edge, event=None), event.slots[0], _waiting(event)
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    values = edge.values | {state: symbol(name) for state, name in first.values.items()}
    if edge.target == event.mode.name:
        for slot, following in pairwise(event.slots):
            values |= dict(zip(slot.states, map(symbol, following.states), strict=True))
        values[waiting.name] = ZERO if len(event.slots) == 1 else waiting - 1
    surface = event.surface(TIME, first.at, f"t >= {first.at.name}")
    states, reset = tuple(values), tuple(values.values())
    edge = replace(edge, surface=surface, condition=at_least(waiting, HALF), target_states=states, reset=reset)
    return replace(
        edge, reset_texts=tuple(texts.get(name, name) for name in states), condition_text=f"{waiting.name} >= 1/2"
    )


def _overflow_name(event: Event) -> str:
    return f"{event.edge.name}-waits-already"


def overflowing(fires: Edge, event: Event) -> Edge:
    """The edge that ends a run in which an event is triggered while as many executions wait as can."""
    states = event.mode.states
    edge = replace(fires, name=f"{event.edge.name} triggers again", target=_overflow_name(event))
    return replace(edge, target_states=states, reset=tuple(map(symbol, states)), reset_texts=states, stays=True)


def overflow(event: Event, system: HybridSystem) -> Mode:
    nothing = (None,) * len(system.outputs)
    return Mode(_overflow_name(event), (), (), (), (), (), nothing, True, scene=(None,) * len(event.mode.scene))
