# pyright: basic
"""Executions that wait: the values where one begins to, the edges that make them, and those that end a run."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from hsdsl.elaborate.events.event import Event, Slot, Values, chosen
from hsdsl.expression.scope import symbol
from hsdsl.functions import maximum
from hsdsl.system import HALF, ONE, TIME, ZERO, Edge, HybridSystem, Mode, at_least

AGAIN = " triggers again"


def begins_to_wait(event: Event) -> Values:
    """The values where an event is triggered: the first slot that is free gets the execution that waits."""
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given = dict(zip(event.edge.target_states, event.edge.reset, strict=True))
    values, before = Values(), ONE  # 1 where the slot before is taken
    for slot in event.slots:
        taken = before * (1 - slot.waits) if len(event.slots) > 1 else ONE
        new = {slot.at.name: TIME + delay} | {name: given[state] for state, name in slot.values.items()}
        values |= {slot.waits.name: ONE if taken == 1 else maximum(slot.waits, before)}
        values |= chosen(event, taken, new, {name: symbol(name) for name in new})
        before = slot.waits
    return values


def dropped(event: Event) -> Values:
    return {} if event.event.persistent else {slot.waits.name: ZERO for slot in event.slots}


def executes(event: Event, slot: Slot) -> Edge:
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


def _overflow_name(event: Event) -> str:
    return f"{event.edge.name}-waits-already"


def overflowing(fires: Edge, event: Event) -> Edge:
    """The edge that ends a run in which an event is triggered while as many executions wait as can."""
    states = event.mode.states
    edge = replace(fires, name=event.edge.name + AGAIN, target=_overflow_name(event))
    return replace(edge, target_states=states, reset=tuple(map(symbol, states)), reset_texts=states, stays=True)


def overflow(event: Event, system: HybridSystem) -> Mode:
    nothing = (None,) * len(system.outputs)
    return Mode(_overflow_name(event), (), (), (), (), (), nothing, True, scene=(None,) * len(event.mode.scene))
