# pyright: basic
"""Modes: their flow, walls, edges and outputs.

An output of the whole model is read in each mode with that mode's own `let`. One that a mode defines itself goes before
it, and has no value in the other modes.
"""

from __future__ import annotations

from collections import ChainMap
from dataclasses import replace

from hsdsl.language.elaborate.edges import elaborate_edges, surface
from hsdsl.language.elaborate.resolver import all_of
from hsdsl.language.elaborate.solve import placeholders, solutions, with_solutions
from hsdsl.language.elaborate.symbols import KINDS, Meanings, SymbolTable, definition_order
from hsdsl.language.expression.scope import Refusal, Scope, Value, state
from hsdsl.language.schema.documents import ModeDocument
from hsdsl.language.source import Key, Scalar
from hsdsl.language.system import Mode


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
    states = symbols.states_within(str(name))
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


def elaborate_outputs(symbols: SymbolTable) -> dict[str, Value | None]:
    """The value of each output of the whole model; None where its expression is broken.

    A `let` name that some mode defines means itself, like a state, until the mode is known.
    """
    scope = output_scope(symbols)
    outputs: dict[str, Value | None] = {}
    for name, scalar in symbols.document.outputs.items():
        _check_name(symbols, name)
        outputs[name] = symbols.number(scalar, scope)
    for mode in symbols.document.modes.values():
        for name in mode.outputs:
            _check_name(symbols, name)
    return outputs


def output_scope(symbols: SymbolTable) -> Scope:
    """The names that can be used in an output of the whole model."""
    inner: Meanings = symbols.recorded | {name: state(name) for name in symbols.inner_lets}
    return symbols.scope(("time", "parameters", "inputs", "states", "let", "unknowns"), "", inner)


def _check_name(symbols: SymbolTable, name: Key) -> None:
    if symbols.names.get(name) == "states":
        message = f"the output '{name}' has the name of a state"
        symbols.report(name.place, "HS301", message, "states are recorded anyway")


def outputs_of(symbols: SymbolTable, shared: dict[str, Value | None], document: ModeDocument, scope: Scope) -> tuple:
    """The outputs of a mode, in the order of `SymbolTable.all_outputs`; None for one that it does not have."""
    given = {str(name): scalar for name, scalar in symbols.document.outputs.items()}
    outputs = {name: output_here(symbols, given[name], value, scope) for name, value in shared.items()}
    outputs |= {str(name): symbols.number(scalar, scope) for name, scalar in document.outputs.items()}
    values = (outputs.get(name) for name in symbols.all_outputs)
    return tuple(None if value is None else value.expr for value in values)


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
