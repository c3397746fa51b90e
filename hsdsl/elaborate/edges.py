# pyright: basic
"""Edges: surface, condition and reset of each transition."""

from __future__ import annotations

import re

from hsdsl.elaborate.reader import Reader, all_of
from hsdsl.elaborate.world import World
from hsdsl.expression.scope import Scope, symbol
from hsdsl.names import did_you_mean, shown
from hsdsl.schema import Mode as ModeDocument
from hsdsl.schema import Transition
from hsdsl.source import ABSENT, Key, Place, Scalar
from hsdsl.system import Edge, Surface

_GUARDED = re.compile(r"(\S+)\s+(?:if|when)\s+(.+)")


def surface(reader: Reader, scalar: Scalar, scope: Scope, key: str) -> Surface | None:
    """The surface of an inequality, its residual negative inside the domain.

    ``when: L >= R`` ends the domain where L - R rises through 0; a wall ``L >= R`` where R - L does.
    """
    found = reader.inequality(scalar, scope, key)
    if found is None:
        return None
    left, right = found.left.expr, found.right.expr
    greater = found.operator in (">", ">=")
    residual = left - right if greater == (key == "when") else right - left
    return Surface(left, right, residual, scalar.value)


def elaborate_edges(world: World, name: Key, document: ModeDocument, scope: Scope) -> list[Edge | None]:
    """The edges that leave a mode, in file order; None for one with faults."""
    names = _names(world, name, document.transitions)
    return [
        _edge(world, str(name), edge_name, transition, scope)
        for edge_name, transition in zip(names, document.transitions, strict=True)
    ]


def _names(world: World, source: Key, transitions: list[Transition]) -> list[str]:
    """The name of each transition: its own, or `SRC->DST`, `SRC->DST#2` and so on."""
    given: set[str] = set()
    for transition in transitions:
        name = world.text(transition.name)
        if name in given and transition.name is not None:
            message = f"the mode '{source}' has a transition '{shown(name)}' already"
            world.reader.add(transition.name.place, "HS307", message, "give it another name")
        elif name is not None:
            given.add(name)
    counts: dict[str, int] = {}
    return [world.text(t.name) or _unnamed(f"{source}->{t.to.value}", counts, given) for t in transitions]


def _unnamed(pair: str, counts: dict[str, int], given: set[str]) -> str:
    while True:
        counts[pair] = counts.get(pair, 0) + 1
        name = pair if counts[pair] == 1 else f"{pair}#{counts[pair]}"
        if name not in given:
            return name


def _edge(world: World, source: str, name: str, transition: Transition, scope: Scope) -> Edge | None:
    reader = world.reader
    crossed = surface(reader, transition.when, scope, "when")
    condition = None if transition.condition is None else reader.condition(transition.condition, scope)
    values = all_of([reader.number(scalar, scope) for scalar in transition.reset.values()])
    target = known_mode(world, transition.to)
    if target is None:
        return None
    states = _target_states(world, source, target)
    complete = _check_reset(world, source, target, states, transition)
    if crossed is None or values is None or not complete or (transition.condition and condition is None):
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
        priority=transition.priority,
    )


def known_mode(world: World, label: Scalar) -> str | None:
    """The mode that a label names."""
    if label.value == ABSENT:
        return None
    if label.value in world.document.modes:
        return label.value
    message = f"there is no mode '{shown(label.value)}'"
    guarded = _GUARDED.fullmatch(label.value)
    hint = did_you_mean(label.value, world.document.modes)
    if guarded and guarded.group(1) in world.document.modes:
        hint = f"write {guarded.group(1)} alone, and if: {shown(guarded.group(2))}"
    world.reader.add(label.place, "HS303", message, hint)
    return None


def _target_states(world: World, source: str, target: str) -> tuple[str, ...]:
    if world.without_states(world.document.modes[target]):  # pyright: ignore[reportArgumentType]
        return world.states[source]
    return world.states[target]


def _check_reset(world: World, source: str, target: str, states: tuple[str, ...], transition: Transition) -> bool:
    if world.document.modes[target].flow is None and not world.document.modes[target].final:  # pyright: ignore[reportArgumentType]
        return False  # that mode is reported, and its states are not known
    complete = True
    for key in transition.reset:
        if key not in states and key in world.undeclared:
            complete = False  # reported under `initial`
        elif key not in states:
            message = f"the mode '{target}' has no state '{shown(key)}' to reset"
            name, equals, value = (part.strip() for part in key.partition("="))
            written = f"write {name}: {value}" if equals and name in states and value else did_you_mean(key, states)
            world.reader.add(key.place, "HS306", message, written)
            complete = False
    own = world.states[source]
    for state in states:
        if state not in transition.reset and state not in own:
            message = (
                f"the transition to '{target}' gives its state '{state}' no value, and '{source}' has no such state"
            )
            world.reader.add(_place(transition), "HS305", message, f"write reset: {{{state}: ...}}")
            complete = False
    return complete


def _place(transition: Transition) -> Place:
    return transition.to.place
