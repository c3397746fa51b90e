# pyright: basic
"""Modes: their flow, walls and edges."""

from __future__ import annotations

from collections import ChainMap

from hsdsl.elaborate.edges import elaborate_edges, surface
from hsdsl.elaborate.outputs import outputs_of
from hsdsl.elaborate.reader import all_of
from hsdsl.elaborate.world import KINDS, Values, World, in_turn
from hsdsl.expression.scope import Scope, Value
from hsdsl.schema import Mode as ModeDocument
from hsdsl.source import Key
from hsdsl.system import Mode


def elaborate_modes(world: World, outputs: dict[str, Value | None]) -> tuple[Mode, ...]:
    """Every mode, in file order. Where something is reported the modes are not complete, and no system is made."""
    modes = [_mode(world, name, document, outputs) for name, document in world.document.modes.items()]
    return tuple(mode for mode in modes if mode is not None)


def _mode(world: World, name: Key, document: ModeDocument, shared: dict[str, Value | None]) -> Mode | None:
    if document.flow is None and not document.final:
        message = f"the mode '{name}' has no `flow`"
        world.reader.add(name.place, "HS304", message, "write `flow: {}` for a mode without states, or `final: true`")
        return None
    if world.without_states(document) and (document.transitions or document.domain or document.outputs):
        message = f"the final mode '{name}' has no states of its own, and so no domain, transitions or outputs"
        world.reader.add(name.place, "HS315", message, "give it a `flow`, or leave them out")
        return None
    scope = world.scopes[str(name)] = mode_scope(world, name, document)
    flow = all_of([world.reader.number(scalar, scope) for scalar in (document.flow or {}).values()])
    walls = all_of([surface(world.reader, scalar, scope, "domain") for scalar in document.domain])
    edges = all_of(elaborate_edges(world, name, document, scope))
    outputs = outputs_of(world, shared, document, scope)
    if flow is None or walls is None or edges is None:
        return None
    return Mode(
        name=str(name),
        states=world.states[name],
        flow=tuple(value.expr for value in flow),
        flow_texts=tuple(scalar.value for scalar in (document.flow or {}).values()),
        walls=tuple(walls),
        edges=tuple(edges),
        outputs=outputs,
        final=document.final,
    )


def mode_scope(world: World, name: Key, document: ModeDocument) -> Scope:
    """The names that can be used in a mode: those of the model, under those of the mode's own `let`."""
    states = frozenset(world.states[name])
    place = f"the mode '{name}'"
    own: Values = {}
    refused: Values = {}
    scope = Scope(ChainMap(refused, own, world.values, world.elsewhere), states, place)  # pyright: ignore[reportArgumentType]
    for key in in_turn(document.let, "`let` names", refused):
        kind = world.names.get(key)
        if kind not in (None, "let"):
            message = f"'{key}' is a `let` name of {place}, and also {KINDS[kind]}"
            world.reader.add(key.place, "HS301", message, "give one of them another name")
        own[key] = world.reader.number(document.let[key], scope)
    return scope
