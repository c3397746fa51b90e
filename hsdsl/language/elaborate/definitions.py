# pyright: basic
"""Parameters, the named subexpressions of `let`, and the units of names."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator

from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.elaborate.solve import placeholders, solutions, with_solutions
from hsdsl.language.elaborate.symbols import Meanings, SymbolTable, definition_order
from hsdsl.language.expression.scope import Scope, Value, symbol
from hsdsl.language.schema.documents import AutomatonDocument, ModelDocument, ParameterEntry
from hsdsl.language.source import Scalar
from hsdsl.language.system import Definition, Parameter

_UNDER_LET = "give it under `let`, which may use everything"
_ONLY_PARAMETERS = "a parameter is an expression of earlier parameters"


def define_parameters(symbols: SymbolTable) -> tuple[Parameter, ...]:
    """Every parameter; what its name means goes to ``symbols.values``."""
    refused: Meanings = {}
    earlier: Meanings = {}
    scope = Scope(ChainMap(refused, earlier, symbols.scope((), _ONLY_PARAMETERS, hint=_UNDER_LET).values))  # pyright: ignore[reportArgumentType]
    parameters: list[Parameter] = []
    for name in definition_order(symbols.document.parameters, "parameters", refused):
        meaning, parameter = define_parameter(symbols, name, symbols.document.parameters[name], scope)
        symbols.values[name] = symbols.of_functions[name] = earlier[name] = meaning
        parameters += [] if parameter is None else [parameter]
    return tuple(parameters)


def define_parameter(
    symbols: SymbolTable,
    name: str,
    given: Scalar | ParameterEntry,
    scope: Scope,
    override: Scalar | None = None,
    outside: Scope | None = None,
) -> tuple[Value | None, Parameter | None]:
    """What the name of a parameter means, and the parameter; ``override`` is its value, read in the scope ``outside``.

    Both are None where its value is broken. The parameter has no unit yet.
    """
    entry = given if isinstance(given, ParameterEntry) else ParameterEntry.model_construct(value=given)
    scalar = entry.value if override is None else override
    value = symbols.number(scalar, scope if override is None else outside or scope, finite_now=True)
    bounds = [symbols.number(s, scope, finite_now=True) if s is not None else None for s in (entry.min, entry.max)]
    if value is None:
        return None, None
    _check_bounds(symbols, name, scalar, value, *bounds)
    least, most = (None if bound is None else bound.expr for bound in bounds)
    parameter = Parameter(name, value.expr, scalar.value, None, least, most, symbols.text(entry.about))
    return Value(symbol(name), value.number), parameter


def _check_bounds(
    symbols: SymbolTable, name: str, scalar: Scalar, value: Value, least: Value | None, most: Value | None
) -> None:
    message, hint = None, None
    if least is not None and most is not None and least.number > most.number:
        message, hint = f"the least value of '{name}' is above its largest", "exchange `min` and `max`"
    elif least is not None and value.number < least.number:
        message = f"'{name}' is {_number(value)}, below its least value {_number(least)}"
    elif most is not None and value.number > most.number:
        message = f"'{name}' is {_number(value)}, above its largest value {_number(most)}"
    if message:
        symbols.report(scalar.place, "HS309", message, hint)


def _number(value: Value) -> str:
    return f"{float(value.number):.6g}"


def define_lets(symbols: SymbolTable) -> None:
    """The meaning of every top-level `let`, in ``symbols.values``: it may use states, and says which it used."""
    solve = symbols.document.solve
    symbols.values |= placeholders(solve)
    base = symbols.scope(("time", "parameters", "inputs", "states", "unknowns"), "").values
    refused: Meanings = {}
    earlier: Meanings = {}
    scope = Scope(ChainMap(refused, earlier, base, symbols.above))  # pyright: ignore[reportArgumentType]
    for name in definition_order(symbols.document.let, "`let` names", refused):
        symbols.values[name] = earlier[name] = symbols.number(symbols.document.let[name], scope)
    if solve is not None:
        solved = solutions(symbols, solve, scope)
        unknowns = dict.fromkeys(map(str, solve.unknowns))
        symbols.values |= unknowns if solved is None else with_solutions(symbols.values, solved)


def substituted_definitions(document: ModelDocument) -> Iterator[Definition]:
    """What was written for each name that the mathematics no longer has: inputs that are expressions, and `let`."""
    inputs = {name: entry for name, entry in document.inputs.items() if isinstance(entry, Scalar)}
    yield from (Definition(str(name), scalar.value) for name, scalar in [*inputs.items(), *document.let.items()])
    for mode, content in document.modes.items():
        yield from (Definition(str(name), scalar.value, str(mode)) for name, scalar in content.let.items())


_OF_TIME: dict[str, str] = dict.fromkeys(("time", "tau"), "the time is t: write its unit for t")


def elaborate_units(symbols: SymbolTable) -> dict[str, str]:
    """The unit of each name that has one."""
    known = [name for name, kind in symbols.names.items() if kind not in ("let", "functions")]
    return units_of(symbols, symbols.document, [*known, *symbols.all_outputs, "t"])


def units_of(symbols: SymbolTable, document: ModelDocument | AutomatonDocument, known: list[str]) -> dict[str, str]:
    """The units of names of a model or of an automaton, which has those ``known``."""
    units: dict[str, str] = {}
    for key, scalar in document.units.items():
        if key not in known:
            message = f"'{shown(key)}' is neither a state nor a parameter, an input or an output"
            symbols.report(key.place, "HS313", message, _OF_TIME.get(key.lower()) or did_you_mean(key, known))
        unit = symbols.text(scalar)
        if unit is not None:
            units[str(key)] = unit
    for key, entry in document.parameters.items():
        unit = symbols.text(entry.unit) if isinstance(entry, ParameterEntry) else None
        if unit is None:
            continue
        if units.setdefault(str(key), unit) != unit:
            message = f"the parameter '{key}' has the unit '{shown(unit)}' here and '{shown(units[key])}' in `units`"
            symbols.report(key.place, "HS316", message, "keep one of them")
    return units
