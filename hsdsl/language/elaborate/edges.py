# pyright: basic
"""Edges: surface, condition and reset of each transition."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from hsdsl.base.defaults import MOST_WAITING
from hsdsl.base.functions import floor, sign
from hsdsl.base.names import SINCE, did_you_mean, shown
from hsdsl.base.parts import numbers_of
from hsdsl.language.elaborate.resolver import ExpressionResolver
from hsdsl.language.elaborate.symbols import SymbolTable
from hsdsl.language.expression.algebra import by_constants
from hsdsl.language.expression.conditions import Trigger, comparisons
from hsdsl.language.expression.scope import Scope, symbol
from hsdsl.language.schema.documents import ModeDocument, TransitionDocument
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import ZERO, Edge, Event, Surface

NOWHERE = Surface(ZERO, ZERO, ZERO, "")
_GUARDED = re.compile(r"(\S+)\s+(?:if|when)\s+(.+)")


def surface(resolver: ExpressionResolver, scalar: Scalar, scope: Scope, key: str) -> Surface | None:
    """The surface of an inequality, its residual negative inside the domain.

    ``when: L >= R`` ends the domain where L - R rises through 0; a wall ``L >= R`` where R - L does.
    """
    sides = resolver.inequality(scalar, scope, key)
    if sides is None:
        return None
    left, right = sides.left.expr, sides.right.expr
    greater = sides.operator in (">", ">=")
    residual = left - right if greater == (key == "when") else right - left
    return Surface(left, right, residual, scalar.value)


def elaborate_edges(symbols: SymbolTable, name: Key, document: ModeDocument, scope: Scope) -> list[Edge | None]:
    """The edges that leave a mode, in file order; None for one with faults."""
    names = _names(symbols, name, document.transitions)
    return [
        _edge(symbols, str(name), edge_name, transition, scope)
        for edge_name, transition in zip(names, document.transitions, strict=True)
    ]


def _names(symbols: SymbolTable, source: Key, transitions: list[TransitionDocument]) -> list[str]:
    """The name of each transition: its own, or `SRC->DST`, `SRC->DST#2` and so on."""
    given: set[str] = set()
    for transition in transitions:
        name = symbols.text(transition.name)
        if name in given and transition.name is not None:
            message = f"the mode '{source}' has a transition '{shown(name)}' already"
            symbols.report(transition.name.place, "HS307", message, "give it another name")
        elif name is not None:
            given.add(name)
    counts: dict[str, int] = {}
    targets = [str(source) if t.event is not None and t.to.value == ABSENT else t.to.value for t in transitions]
    return [
        symbols.text(t.name) or unnamed(f"{source}->{target}", counts, given)
        for t, target in zip(transitions, targets, strict=True)
    ]


def unnamed(pair: str, counts: dict[str, int], given: set[str]) -> str:
    """The name of a transition that has none: `SRC->DST`, `SRC->DST#2` and so on."""
    while True:
        counts[pair] = counts.get(pair, 0) + 1
        name = pair if counts[pair] == 1 else f"{pair}#{counts[pair]}"
        if name not in given:
            return name


def _edge(symbols: SymbolTable, source: str, name: str, transition: TransitionDocument, scope: Scope) -> Edge | None:
    resolver = symbols.resolver
    flow = symbols.document.modes[source].flow or {}  # pyright: ignore[reportArgumentType]
    still = frozenset(symbol(str(state)) for state, rate in flow.items() if rate.value.strip() == "0")
    event = event_of(symbols, transition, scope, still)
    crossed = surface(resolver, transition.when, scope, "when") if transition.event is None else NOWHERE
    condition = None if transition.condition is None else resolver.condition(transition.condition, scope)
    values = symbols.numbers(transition.reset.values(), scope)
    stays = transition.event is not None and transition.to.value == ABSENT
    target = source if stays else known_mode(symbols, transition.to)
    if target is None:
        return None
    document = symbols.document.modes[target]  # pyright: ignore[reportArgumentType]
    states = symbols.states[source if symbols.without_states(document) else target]
    if document.flow is not None or document.final:  # else that mode is reported, and its states are not known
        _check_reset(symbols, source, target, states, transition)
    if crossed is None or values is None or (transition.condition and condition is None):
        return None
    if transition.event is not None and event is None:
        return None
    resets = dict(zip(map(str, transition.reset), values, strict=True))
    texts = {str(key): scalar.value for key, scalar in transition.reset.items()}
    return Edge(
        name=name,
        source=source,
        target=target,
        surface=crossed,
        condition=condition,
        target_states=states,
        reset=tuple(resets[s].expr if s in resets else symbol(s) for s in states),
        reset_texts=tuple(texts.get(s, s) for s in states),
        priority=transition.priority if isinstance(transition.priority, int) else 0,
        condition_text=None if transition.condition is None else transition.condition.value,
        event=None if event is None else replace(event, given=tuple(resets)),
        stays=stays,
    )


def of_events(transition: TransitionDocument) -> list[str]:
    """The keys of a transition that only events have."""
    return [
        key for key in ("delay", "values", "persistent", "initially", "waiting") if key in transition.model_fields_set
    ]


def event_of(
    symbols: SymbolTable, transition: TransitionDocument, scope: Scope, still: frozenset[Any] = frozenset()
) -> Event | None:
    """What a transition has that fires where a condition turns true; None for another one, and where it has faults.

    States that are ``still`` do not flow: what a condition chooses by them does not jump by itself.
    """
    given = transition.event
    if not _is_event(symbols, transition) or given is None:
        return None
    trigger = symbols.resolver.trigger(given, scope)
    delay = None if transition.delay is None else symbols.number(transition.delay, scope)
    ranked = transition.priority
    priority = None if isinstance(ranked, int) else symbols.number(ranked, scope)
    if trigger is None or (transition.delay and delay is None) or not (isinstance(ranked, int) or priority):
        return None
    if (fault := next(_faults(symbols, transition, trigger, still), None)) is not None:
        symbols.report(given.place, "HS323", *fault)
        return None
    return Event(
        trigger,
        given.value,
        None if delay is None else delay.expr,
        transition.persistent,
        transition.initially,
        waiting=transition.waiting,
        priority=None if priority is None else priority.expr,
        options=transition.options,
        at_execution=transition.values == "execution",
    )


def _is_event(symbols: SymbolTable, transition: TransitionDocument) -> bool:
    """Whether a transition has `event`, and no keys of other ones; what it has of both kinds is reported."""
    if transition.event is None:
        for key in of_events(transition):
            message = f"only a transition with `event` has `{key}`"
            place = transition.delay if key == "delay" and transition.delay else transition.when
            symbols.report(place.place, "HS323", message, "use `since`, or `event` instead of `when`")
        return False
    for key, other in (("when", transition.when), ("if", transition.condition)):
        if other is not None and other.value != ABSENT:
            message = f"a transition has either `event` or `{key}`"
            symbols.report(other.place, "HS323", message, "join conditions by `and` under `event`")
            return False
    return True


def _faults(
    symbols: SymbolTable, transition: TransitionDocument, trigger: Trigger, still: frozenset[Any]
) -> Iterator[tuple[str, str]]:
    """What is wrong with an event, and what to do: it never changes, jumps by itself, or has options out of range."""
    if not comparisons(trigger):
        yield "a condition that never changes is no event", "write an inequality"
    constants = still | {symbol(str(name)) for name in symbols.document.parameters}
    sampled = {symbol(str(name)) for name in symbols.document.inputs}
    for part in comparisons(trigger):
        residual = by_constants(part.residual, constants)
        if residual.free_symbols & sampled or residual.has(sign, floor):
            message = f"`{shown(part.text, 40)}` may jump, and an event is not looked for at jumps of samples or steps"
            yield message, "use `when`, which fires on entry there"
    if not 1 <= transition.waiting <= MOST_WAITING:
        message = f"`waiting`: expected a number from 1 to {MOST_WAITING}, got {transition.waiting}"
        yield message, "so many executions of an event can wait at a time"
    if transition.delay is None and transition.values == "execution":
        hint = "without a delay an event has the values where it is made: leave it out"
        yield "only a transition with `delay` has `values`", hint


def known_mode(symbols: SymbolTable, label: Scalar) -> str | None:
    """The mode that a label names."""
    if label.value == ABSENT:
        return None
    if label.value in symbols.document.modes:
        return label.value
    if symbols.parts:
        return _product(symbols, label)
    message = f"there is no mode '{shown(label.value)}'"
    guarded = _GUARDED.fullmatch(label.value)
    hint = did_you_mean(label.value, symbols.document.modes)
    if guarded and guarded.group(1) in symbols.document.modes:
        hint = f"write {guarded.group(1)} alone, and if: {shown(guarded.group(2))}"
    symbols.report(label.place, "HS303", message, hint)
    return None


def _product(symbols: SymbolTable, label: Scalar) -> str | None:
    """The product mode that a label names."""
    try:
        numbers_of(symbols.parts, label.value)
    except ValueError as problem:
        symbols.report(label.place, "HS303", f"there is no mode '{shown(label.value)}': {problem}")
        return None
    return label.value


def _check_reset(
    symbols: SymbolTable, source: str, target: str, states: tuple[str, ...], transition: TransitionDocument
) -> None:
    for key in transition.reset:
        if key not in states and key not in symbols.undeclared:  # those are reported under `initial`
            name, equals, value = (part.strip() for part in key.partition("="))
            hint = f"write {name}: {value}" if equals and name in states and value else did_you_mean(key, states)
            if key == SINCE and symbols.timed:
                hint = "every transition into a mode starts it at 0"
            message = f"the mode '{target}' has no state '{shown(key)}' to reset"
            symbols.report(key.place, "HS306", message, hint)
    own = symbols.states[source]
    for state in () if states == own else states:
        if state not in transition.reset and state not in own:
            message = (
                f"the transition to '{target}' gives its state '{state}' no value, and '{source}' has no such state"
            )
            symbols.report(transition.to.place, "HS305", message, f"write reset: {{{state}: ...}}")
