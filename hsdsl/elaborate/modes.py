# pyright: basic
"""Modes: their flow, walls and edges."""

from __future__ import annotations

from collections import ChainMap

from hsdsl.elaborate.edges import elaborate_edges, surface
from hsdsl.elaborate.outputs import outputs_of
from hsdsl.elaborate.resolver import all_of
from hsdsl.elaborate.symbols import KINDS, Meanings, SymbolTable, definition_order
from hsdsl.expression.scope import Scope, Value
from hsdsl.schema import ModeDocument
from hsdsl.source import Key
from hsdsl.system import Mode


def elaborate_modes(symbols: SymbolTable, outputs: dict[str, Value | None]) -> tuple[Mode, ...]:
    """Every mode, in file order. Where something is reported the modes are not complete, and no system is made."""
    modes = [_mode(symbols, name, document, outputs) for name, document in symbols.document.modes.items()]
    return tuple(mode for mode in modes if mode is not None)


def _mode(symbols: SymbolTable, name: Key, document: ModeDocument, shared: dict[str, Value | None]) -> Mode | None:
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
    walls = all_of([surface(symbols.resolver, scalar, scope, "domain") for scalar in document.domain])
    edges = all_of(elaborate_edges(symbols, name, document, scope))
    outputs = outputs_of(symbols, shared, document, scope)
    if flow is None or walls is None or edges is None:
        return None
    return Mode(
        name=str(name),
        states=symbols.states[name],
        flow=tuple(value.expr for value in flow),
        flow_texts=tuple(scalar.value for scalar in (document.flow or {}).values()),
        walls=tuple(walls),
        edges=tuple(edges),
        outputs=outputs,
        final=document.final,
    )


def mode_scope(symbols: SymbolTable, name: Key, document: ModeDocument) -> Scope:
    """The names that can be used in a mode: those of the model, under those of the mode's own `let`."""
    states = frozenset(symbols.states[name])
    place = f"the mode '{name}'"
    own: Meanings = {}
    refused: Meanings = {}
    scope = Scope(ChainMap(refused, own, symbols.values, symbols.elsewhere), states, place)  # pyright: ignore[reportArgumentType]
    for key in definition_order(document.let, "`let` names", refused):
        kind = symbols.names.get(key)
        if kind not in (None, "let"):
            message = f"'{key}' is a `let` name of {place}, and also {KINDS[kind]}"
            symbols.report(key.place, "HS301", message, "give one of them another name")
        own[key] = symbols.number(document.let[key], scope)
    return scope
