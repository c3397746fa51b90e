# pyright: basic
"""What events remember: the values of their states after each edge of a mode, and where a mode is entered."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hsdsl.base.functions import maximum
from hsdsl.base.names import SINCE
from hsdsl.language.elaborate.events.event import Event, Values, chosen, dropped, number_left
from hsdsl.language.elaborate.events.firing import Draft
from hsdsl.language.expression.algebra import select
from hsdsl.language.expression.conditions import Reached
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import ONE, ZERO, Edge


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


def new_values(edge: Edge, timed: bool) -> dict[Any, Any]:
    return edge.changes if edge.stays or not timed else edge.changes | {symbol(SINCE): ZERO}


def all_states(events: Sequence[Event]) -> tuple[str, ...]:
    return tuple(name for event in events for name in event.states)


Order = tuple[str, ...] | None  # of the states of a mode; None of a final one, which has those of the mode before it


def remembered(draft: Draft, memories: Mapping[str, Memory], order: Mapping[str, Order]) -> Edge:
    """An edge with what the events of its target remember after it."""
    edge, fired, reached = draft
    given = edge.values
    index, inside = memories[edge.target], edge.source == edge.target
    values: Values = {}
    if not inside:
        for event in index.events:
            values |= entered(event, new_values(edge, event.timed))
    else:
        values |= _stayed(edge, fired, reached, index)
    own = order[edge.target]
    for name in all_states(memories[edge.source if own is None else edge.target].events):
        values.setdefault(name, symbol(name) if inside or own is None else ZERO)
    values |= {name: value for name, value in given.items() if name not in values or value != symbol(name)}
    names = (*given, *all_states(memories[edge.source].events)) if own is None else own
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
    meaning, known = new_values(edge, bool(index.events) and index.events[0].timed), number_left(edge)
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
            values |= chosen(event, entering, names | entered(event, meaning), others)
    return values


def entered(event: Event, meaning: Mapping[Any, Any]) -> Values:
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
