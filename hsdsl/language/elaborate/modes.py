# pyright: basic
"""Modes: their flow, walls, edges, outputs and scene.

An output of the whole model is read in each mode with that mode's own `let`. One that a mode defines itself goes before
it, and has no value in the other modes. The numbers of the scene's shapes are read as outputs are.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from hsdsl.base.defaults import MOST_WAITING
from hsdsl.base.functions import floor, sign
from hsdsl.base.names import SINCE, did_you_mean, shown
from hsdsl.base.parts import numbers_of
from hsdsl.language.elaborate.definitions import placeholders, solutions, with_solutions
from hsdsl.language.elaborate.symbols import KINDS, Meanings, SymbolTable, all_of, definition_order
from hsdsl.language.expression.algebra import by_constants
from hsdsl.language.expression.conditions import Trigger, comparisons
from hsdsl.language.expression.scope import Refusal, Scope, Value, state, symbol
from hsdsl.language.schema.documents import ModeDocument, TransitionDocument
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import ZERO, Altered, Edge, Event, HybridSystem, Mode, Shape, Surface, places_of, symbols_of


def elaborate_modes(symbols: SymbolTable, outputs: dict[Key, Value | None]) -> tuple[Mode, ...]:
    """Every mode, in file order. Where something is reported the modes are not complete, and no system is made."""
    modes = [_mode(symbols, name, document, outputs) for name, document in symbols.document.modes.items()]
    return tuple(mode for mode in modes if mode is not None)


def _mode(symbols: SymbolTable, name: Key, document: ModeDocument, shared: dict[Key, Value | None]) -> Mode | None:
    if document.flow is None and not document.final:
        message = f"the mode '{name}' has no `flow`"
        symbols.report(name.place, "HS304", message, "write `flow: {}` for a mode without states, or `final: true`")
        return None
    if symbols.without_states(document) and (document.transitions or document.domain or document.outputs):
        message = f"the final mode '{name}' has no states of its own, and so no domain, transitions or outputs"
        symbols.report(name.place, "HS315", message, "give it a `flow`, or leave them out")
        return None
    scope = symbols.scopes[str(name)] = mode_scope(symbols, name, document)
    flow = symbols.numbers((document.flow or {}).values(), scope)
    walls = all_of([surface(symbols, scalar, scope, "domain") for scalar in document.domain])
    names = edge_names(name, document.transitions, lambda at, *fault: symbols.report(at.place, *fault))
    pairs = zip(names, document.transitions, strict=True)
    edges = all_of([_edge(symbols, str(name), label, transition, scope) for label, transition in pairs])
    given = {str(name): scalar for name, scalar in symbols.document.outputs.items()}
    outputs = {name: output_here(symbols, given[name], value, scope) for name, value in shared.items()}
    outputs |= {str(name): symbols.number(scalar, scope) for name, scalar in document.outputs.items()}
    values = (outputs.get(name) for name in symbols.all_outputs)  # None for one that the mode does not have
    if flow is None or walls is None or edges is None:
        return None
    return Mode(
        name=str(name),
        states=symbols.states[name],
        flow=tuple(value.expr for value in flow),
        flow_texts=tuple(scalar.value for scalar in (document.flow or {}).values()),
        walls=tuple(walls),
        edges=tuple(edges),
        outputs=tuple(None if value is None else value.expr for value in values),
        final=document.final,
    )


def mode_scope(symbols: SymbolTable, name: Key, document: ModeDocument) -> Scope:
    """The names that can be used in a mode: those of the model, under those of the mode's own `let`."""
    timed = symbols.timed and not symbols.without_states(document)
    states = frozenset((*symbols.states[str(name)], *[SINCE] * timed))
    place = f"the mode '{name}'"
    own: Meanings = placeholders(document.solve, str(name))
    refused: Meanings = {}
    scope = Scope(ChainMap(refused, own, symbols.values, symbols.elsewhere), states, place)  # pyright: ignore[reportArgumentType]
    for key in definition_order(document.let, "`let` names", refused):
        kind = symbols.names.get(key)
        if kind not in (None, "let"):
            message = f"'{key}' is a `let` name of {place}, and also {KINDS[kind]}"
            symbols.report(key.place, "HS301", message, "give one of them another name")
        own[key] = symbols.number(document.let[key], scope)
    if document.solve is not None:
        solved = solutions(symbols, document.solve, scope, str(name))
        own |= dict.fromkeys(map(str, document.solve.unknowns)) if solved is None else with_solutions(own, solved)
    return scope


def elaborate_outputs(symbols: SymbolTable) -> dict[Key, Value | None]:
    """The value of each output of the whole model; None where its expression is broken.

    A `let` name that some mode defines means itself, like a state, until the mode is known.
    """
    scope = output_scope(symbols)
    outputs: dict[Key, Value | None] = {}
    for name, scalar in symbols.document.outputs.items():
        outputs[name] = symbols.number(scalar, scope)
    for name in (*outputs, *(name for mode in symbols.document.modes.values() for name in mode.outputs)):
        if symbols.names.get(name) == "states":
            message = f"the output '{name}' has the name of a state"
            symbols.report(name.place, "HS301", message, "states are recorded anyway")
    return outputs


def output_scope(symbols: SymbolTable) -> Scope:
    """The names that can be used in an output of the whole model."""
    inner: Meanings = symbols.recorded | {name: state(name) for name in symbols.inner_lets}
    return symbols.scope(("time", "parameters", "inputs", "states", "let", "unknowns"), "", inner)


def output_here(symbols: SymbolTable, scalar: Scalar, value: Value | None, scope: Scope) -> Value | None:
    """An output of the whole model in one mode; None where it has no value there."""
    if value is None:
        return None
    inner = value.uses & symbols.inner_lets
    if any(isinstance(scope.values[name], Refusal) for name in inner):
        return None
    if inner:
        value = symbols.number(scalar, replace(scope, states=None))  # pyright: ignore[reportArgumentType]
    return value if value is not None and value.uses <= (scope.states or frozenset()) else None


Numbers = list[tuple[Scalar | None, Value | None]]  # each with what it means to the whole model; 0 where left out


def elaborate_scene(symbols: SymbolTable, scope: Scope | None = None) -> tuple[tuple[Shape, ...], Numbers]:
    """The shapes of a model, and the numbers of all of them."""
    shapes: list[Shape] = []
    numbers: Numbers = []
    scope = scope or output_scope(symbols)
    for document in symbols.document.scene:
        scalars = [*(scalar for point in document.points for scalar in point), *document.sizes]
        shapes.append(Shape(document.kind, len(document.points), len(scalars)))
        numbers += [(s, None if s is None else symbols.number(s, scope)) for s in scalars]
    return tuple(shapes), numbers


def scene_of(symbols: SymbolTable, numbers: Numbers, scope: Scope) -> tuple:
    """The numbers of a scene in a mode; None for one that it does not have."""
    found = (ZERO if s is None else output_here(symbols, s, value, scope) for s, value in numbers)
    return tuple(value.expr if isinstance(value, Value) else value for value in found)


def scene_as_outputs(system: HybridSystem) -> HybridSystem:
    """The system with the numbers of its scene as further outputs, which a run then records."""
    count = sum(shape.numbers for shape in system.scene)
    modes = tuple(replace(mode, outputs=(*mode.outputs, *mode.scene)) for mode in system.modes)
    outputs = (*system.outputs, *(f"scene {i}" for i in range(count)))  # no name of a model has a blank
    return replace(system, modes=modes, outputs=outputs)


NOWHERE = Surface(ZERO, ZERO, ZERO, "")
_GUARDED = re.compile(r"(\S+)\s+(?:if|when)\s+(.+)")


def surface(symbols: SymbolTable, scalar: Scalar, scope: Scope, key: str) -> Surface | None:
    """The surface of an inequality, its residual negative inside the domain.

    ``when: L >= R`` ends the domain where L - R rises through 0; a wall ``L >= R`` where R - L does.
    """
    sides = symbols.inequality(scalar, scope, key)
    if sides is None:
        return None
    left, right = sides[0].expr, sides[2].expr
    residual = left - right if (sides[1] in (">", ">=")) == (key == "when") else right - left
    return Surface(left, right, residual, scalar.value)


def edge_names(
    mode: str, transitions: Sequence[TransitionDocument], report: Callable[[Scalar, str, str, str], None]
) -> list[str]:
    """The name of each transition of a mode: its own, or `SRC->DST`, `SRC->DST#2`, ...; one given twice is reported."""
    given: set[str] = set()
    counts: dict[str, int] = {}
    labels = [None if t.name is None or t.name.value == ABSENT else t.name for t in transitions]
    for label in filter(None, labels):
        if label.value in given:
            message = f"the mode '{mode}' has a transition '{shown(label.value)}' already"
            report(label, "HS307", message, "give it another name")
        given.add(label.value)

    def unnamed(pair: str) -> str:
        counts[pair] = counts.get(pair, 0) + 1
        name = pair if counts[pair] == 1 else f"{pair}#{counts[pair]}"
        return unnamed(pair) if name in given else name

    pairs = zip(labels, transitions, strict=True)
    return [unnamed(f"{mode}->{t.target or mode}") if label is None else label.value for label, t in pairs]


def _edge(symbols: SymbolTable, source: str, name: str, transition: TransitionDocument, scope: Scope) -> Edge | None:
    flow = symbols.document.modes[source].flow or {}  # pyright: ignore[reportArgumentType]
    still = frozenset(symbol(str(state)) for state, rate in flow.items() if rate.value.strip() == "0")
    event = event_of(symbols, transition, scope, still)
    crossed = surface(symbols, transition.when, scope, "when") if transition.event is None else NOWHERE
    condition = None if transition.condition is None else symbols.condition(transition.condition, scope)
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
    places = places_of(states)
    return Edge(
        name=name,
        source=source,
        target=target,
        surface=crossed,
        condition=condition,
        target_states=states,
        reset=Altered(symbols_of(states), {places[s]: value.expr for s, value in resets.items() if s in places}),
        reset_texts=Altered(states, {places[s]: text for s, text in texts.items() if s in places}),
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
    trigger = symbols.trigger(given, scope)
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
    if symbols.parts:  # then it names a product mode
        try:
            numbers_of(symbols.parts, label.value)
        except ValueError as problem:
            symbols.report(label.place, "HS303", f"there is no mode '{shown(label.value)}': {problem}")
            return None
        return label.value
    message = f"there is no mode '{shown(label.value)}'"
    guarded = _GUARDED.fullmatch(label.value)
    hint = did_you_mean(label.value, symbols.document.modes)
    if guarded and guarded.group(1) in symbols.document.modes:
        hint = f"write {guarded.group(1)} alone, and if: {shown(guarded.group(2))}"
    symbols.report(label.place, "HS303", message, hint)
    return None


def _check_reset(
    symbols: SymbolTable, source: str, target: str, states: tuple[str, ...], transition: TransitionDocument
) -> None:
    places = places_of(states)
    for key in transition.reset:
        if str(key) not in places and key not in symbols.undeclared:  # those are reported under `initial`
            name, equals, value = (part.strip() for part in key.partition("="))
            hint = f"write {name}: {value}" if equals and name in states and value else did_you_mean(key, states)
            if key == SINCE and symbols.timed:
                hint = "every transition into a mode starts it at 0"
            message = f"the mode '{target}' has no state '{shown(key)}' to reset"
            symbols.report(key.place, "HS306", message, hint)
    own = symbols.states[source]
    for name in states if own is not states else ():
        if name not in transition.reset and name not in own:
            message = (
                f"the transition to '{target}' gives its state '{name}' no value, and '{source}' has no such state"
            )
            symbols.report(transition.to.place, "HS305", message, f"write reset: {{{name}: ...}}")
