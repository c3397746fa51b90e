# pyright: basic
"""Executions that wait: the values where one begins to, and the edges that make them.

States have the first that waits; where several can, `hsdsl.engine.simulate.transitions` keeps the others.
"""

from __future__ import annotations

from dataclasses import replace

from hsdsl.base.functions import maximum
from hsdsl.language.elaborate.events.event import Event, Values
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HALF, ONE, TIME, ZERO, Edge, at_least


def begins_to_wait(event: Event) -> Values:
    """The values where an event is triggered: those of the execution that begins to wait."""
    delay = maximum(event.delay, ZERO) if event.delay != 0 else ZERO
    given, waiting = event.edge.values, event.symbol("waiting")
    values = {waiting.name: ONE if event.queue is None else waiting + 1, event.at.name: TIME + delay}
    return values | {name: given[state] for state, name in event.stored.items()}


def dropped(event: Event) -> Values:
    return {} if event.event.persistent or event.delay is None else {event.names["waiting"]: ZERO}


def executes(event: Event) -> Edge:
    """The edge that gives the states, after the delay, the values that were stored."""
    edge, waiting = replace(event.edge, event=None), event.symbol("waiting")
    texts = dict(zip(edge.target_states, edge.reset_texts, strict=True))
    values = edge.values | {state: symbol(name) for state, name in event.stored.items()}
    if edge.target == event.mode.name:
        values[waiting.name] = ZERO if event.queue is None else waiting - 1
    surface = event.surface(TIME, event.at, f"t >= {event.at.name}")
    states, reset = tuple(values), tuple(values.values())
    edge = replace(edge, surface=surface, condition=at_least(waiting, HALF), target_states=states, reset=reset)
    return replace(
        edge, reset_texts=tuple(texts.get(name, name) for name in states), condition_text=f"{waiting.name} >= 1/2"
    )
