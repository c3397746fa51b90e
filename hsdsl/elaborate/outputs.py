# pyright: basic
"""Outputs: expressions that are recorded with the states. A mode has those whose names all mean something in it.

An output of the whole model is read in each mode with that mode's own `let`. One that a mode defines itself goes before
it, and has no value in the other modes.
"""

from __future__ import annotations

from dataclasses import replace

from hsdsl.elaborate.symbols import SymbolTable
from hsdsl.expression.scope import Refusal, Scope, Value, state
from hsdsl.schema import ModeDocument
from hsdsl.source import Key


def elaborate_outputs(symbols: SymbolTable) -> dict[str, Value | None]:
    """What each output of the whole model is; None where its expression is broken.

    A `let` name that some mode defines means itself, like a state, until the mode is known.
    """
    scope = symbols.scope(
        ("time", "parameters", "inputs", "states", "let"), "", {name: state(name) for name in symbols.inner_lets}
    )
    outputs: dict[str, Value | None] = {}
    for name, scalar in symbols.document.outputs.items():
        _check_name(symbols, name)
        outputs[name] = symbols.number(scalar, scope)
    for mode in symbols.document.modes.values():
        for name in mode.outputs:
            _check_name(symbols, name)
    return outputs


def _check_name(symbols: SymbolTable, name: Key) -> None:
    if symbols.names.get(name) == "states":
        message = f"the output '{name}' has the name of a state"
        symbols.report(name.place, "HS301", message, "states are recorded anyway")


def outputs_of(symbols: SymbolTable, shared: dict[str, Value | None], document: ModeDocument, scope: Scope) -> tuple:
    """The outputs of a mode, in the order of `SymbolTable.all_outputs`; None for one that it does not have."""
    outputs = {name: _here(symbols, name, value, scope) for name, value in shared.items()}
    outputs |= {str(name): symbols.number(scalar, scope) for name, scalar in document.outputs.items()}
    values = (outputs.get(name) for name in symbols.all_outputs)
    return tuple(None if value is None else value.expr for value in values)


def _here(symbols: SymbolTable, name: str, value: Value | None, scope: Scope) -> Value | None:
    """An output of the whole model in one mode."""
    if value is None:
        return None
    inner = value.uses & symbols.inner_lets
    if any(isinstance(scope.values[name], Refusal) for name in inner):
        return None
    if inner:
        value = symbols.number(symbols.document.outputs[name], replace(scope, states=None))  # pyright: ignore[reportArgumentType]
    return value if value is not None and value.uses <= (scope.states or frozenset()) else None
