# pyright: basic
"""Parameters and the named subexpressions of `let`: each may use the ones before it."""

from __future__ import annotations

from collections import ChainMap

from hsdsl.elaborate.symbols import SymbolTable, Values, definition_order
from hsdsl.expression.scope import Scope, Value, symbol
from hsdsl.schema import ParameterEntry
from hsdsl.source import Scalar
from hsdsl.system import Parameter

_UNDER_LET = "give it under `let`, which may use everything"
_ONLY_PARAMETERS = "a parameter is an expression of earlier parameters"


def define_parameters(symbols: SymbolTable) -> tuple[Parameter, ...]:
    """Every parameter; what its name means goes to ``symbols.values``."""
    refused: Values = {}
    earlier: Values = {}
    scope = Scope(ChainMap(refused, earlier, symbols.scope((), _ONLY_PARAMETERS, hint=_UNDER_LET).values))  # pyright: ignore[reportArgumentType]
    found: list[Parameter] = []
    for name in definition_order(symbols.document.parameters, "parameters", refused):
        entry = symbols.document.parameters[name]
        scalar = entry.value if isinstance(entry, ParameterEntry) else entry
        value = symbols.resolver.number(scalar, scope, finite_now=True)
        symbols.values[name] = earlier[name] = None if value is None else Value(symbol(name), value.number)
        extra = _extra(symbols, entry, scope) if isinstance(entry, ParameterEntry) else {}
        if value is not None:
            _check_bounds(symbols, name, scalar, value, extra)
            exprs = {key: part.expr if isinstance(part, Value) else part for key, part in extra.items()}
            unit = exprs.pop("unit", None) or symbols.text(symbols.document.units.get(name))
            found.append(Parameter(name, value.expr, scalar.value, unit, **exprs))
    return tuple(found)


def _extra(symbols: SymbolTable, entry: ParameterEntry, scope: Scope) -> dict:
    bounds = {"minimum": entry.min, "maximum": entry.max}
    read = {k: symbols.resolver.number(s, scope, finite_now=True) for k, s in bounds.items() if s is not None}
    return {**read, "unit": symbols.text(entry.unit), "about": symbols.text(entry.about)}


def _check_bounds(symbols: SymbolTable, name: str, scalar: Scalar, value: Value, extra: dict) -> None:
    least, most = extra.get("minimum"), extra.get("maximum")
    if least is not None and most is not None and least.number > most.number:
        message = f"the least value of '{name}' is above its largest"
        symbols.resolver.add(scalar.place, "HS309", message, "exchange `min` and `max`")
    elif least is not None and value.number < least.number:
        message = f"'{name}' is {_number(value)}, below its least value {_number(least)}"
        symbols.resolver.add(scalar.place, "HS309", message)
    elif most is not None and value.number > most.number:
        message = f"'{name}' is {_number(value)}, above its largest value {_number(most)}"
        symbols.resolver.add(scalar.place, "HS309", message)


def _number(value: Value) -> str:
    return f"{float(value.number):.6g}"


def define_lets(symbols: SymbolTable) -> None:
    """The meaning of every top-level `let`, in ``symbols.values``: it may use states, and says which it used."""
    base = symbols.scope(("time", "parameters", "inputs", "states"), "").values
    refused: Values = {}
    earlier: Values = {}
    scope = Scope(ChainMap(refused, earlier, base))  # pyright: ignore[reportArgumentType]
    for name in definition_order(symbols.document.let, "`let` names", refused):
        symbols.values[name] = earlier[name] = symbols.resolver.number(symbols.document.let[name], scope)
