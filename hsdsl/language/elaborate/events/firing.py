# pyright: basic
"""The edges of an event: those that fire it, begin to wait, make what waited, and arm it again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from math import prod
from typing import Any

from hsdsl.base.functions import below
from hsdsl.language.elaborate.events.event import Event, Values, begins_to_wait, dropped, executes
from hsdsl.language.expression.conditions import Reached, comparisons, condition
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HALF, ONE, TIME, TRUTH, ZERO, Edge, all_of, at_least

Draft = tuple[Edge, Event | None, Reached | None]


def turn_of(event: Event, events: Sequence[Event]) -> Any | None:
    """1 where no event of a higher priority is to be made at this instant, else 0; None where the edges' own decide.

    Each pair is compared by itself, so that an error of a state that priorities read decides nothing between others.
    """
    if all(other.event.priority is None for other in events):
        return None
    others = [other for other in events if other is not event]
    higher = ((other, below(event.priority - other.priority, ZERO, ONE, ZERO)) for other in others)
    return prod((ONE - rank * other.ready for other, rank in higher if rank != 0), start=ONE)


def edges_of(event: Event, events: Sequence[Event]) -> Iterator[Draft]:
    """The edges of one of a mode's events: which of them fires it, and the comparison that was reached."""
    edge, trigger, armed = replace(event.edge, event=None), event.event.trigger, event.symbol("armed")
    fires = edge if event.delay is None else staying(event, f"{edge.name} triggers", begins_to_wait(event))
    if event.delay is not None:  # what only remembers goes before anything that changes states
        fires = replace(fires, priority=1 + max(other.priority for other in event.mode.edges))
    turn = turn_of(event, events)
    goes = () if turn is None or turn == 1 else (at_least(turn, HALF),)
    free = goes if event.delay is None else ()
    for part in comparisons(trigger):
        others = condition(trigger, partial(_with, event, part, True))
        surface = event.surface(part.left, part.right, part.text)
        when = all_of(at_least(armed, HALF), others, *free)
        fires = replace(fires, strict=part.strict)
        yield replace(fires, surface=surface, condition=when, condition_text=_text(event)), event, part
    if event.jumps:
        now = event.due
        if turn is not None and event.delay is None:
            now *= turn
        for other in events if event.delay is None else ():
            if other.delay is not None and other.goes_before(event):
                alike = ONE if turn is None else below(other.priority - event.priority, ZERO, ZERO, ONE)
                now *= 1 - other.ready * alike
            elif turn is None and other.delay is None and other.edge.priority > event.edge.priority:
                now *= 1 - other.ready
        yield _when_due(fires, event, now), event, None
    if event.delay is not None:
        made = executes(event)
        yield replace(made, condition=all_of(made.condition, *goes)), None, None
    arms = staying(event, f"{edge.name} re-arms", {event.names["armed"]: ONE} | dropped(event))
    for part in comparisons(trigger):
        holds = condition(trigger, partial(_with, event, part, False))
        surface = event.surface(part.right, part.left, part.opposite)
        when = all_of(at_least(HALF, armed), ~holds)
        if dropped(event):  # what waits is gone where a strict comparison ends, and is made where another one does
            others = [edge.priority for edge in event.mode.edges]
            arms = replace(arms, priority=max(others) + 1 if part.strict else min(others) - 1)
        yield replace(arms, surface=surface, condition=when, condition_text=f"not ({_text(event)})"), None, None


def _when_due(edge: Edge, event: Event, truth: Any) -> Edge:
    """An edge that goes where a number is 1 or more, and not where it is 0 or less."""
    surface = event.surface(truth, HALF, f"{event.names['due']} >= 1/2")
    return replace(edge, surface=surface, condition=None, condition_text=None, strict=False)


def _with(event: Event, reached: Reached, value: bool, part: Reached) -> Any:
    """The Boolean of a comparison where another one turns to a value."""
    turns = part.turns(reached)
    return part.follows(event.rates[part.residual], TIME) if turns is None else TRUTH[value == turns]


def _text(event: Event) -> str:
    return event.event.text


def staying(event: Event, name: str, values: Values) -> Edge:
    """An edge that changes some memory of an event, and nothing else."""
    mode = event.mode
    states = (*mode.states, *values)
    reset = (*map(symbol, mode.states), *values.values())
    edge = replace(event.edge, event=None, name=name, target=mode.name, target_states=states, reset=reset)
    return replace(edge, reset_texts=states, stays=True, condition_text=None)
