# pyright: basic
"""What a file gives a name: parameters, functions, `let`, unknowns of `solve`; and the units of names."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from hsdsl.base.graphs import cycle
from hsdsl.base.names import counted, did_you_mean, shown
from hsdsl.language.elaborate.symbols import KINDS, Meanings, SymbolTable, definition_order
from hsdsl.language.expression import parse
from hsdsl.language.expression.algebra import Solved, linear_solutions
from hsdsl.language.expression.scope import Function, Meaning, Refusal, Scope, Value, functions_called, symbol
from hsdsl.language.schema.documents import (
    AutomatonDocument,
    FunctionDocument,
    ModelDocument,
    ParameterEntry,
    SolveDocument,
)
from hsdsl.language.source import ABSENT, Key, Scalar
from hsdsl.language.system import Definition, FunctionText, Parameter

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
    least, most = bounds
    message, hint = None, None
    if least is not None and most is not None and least.number > most.number:
        message, hint = f"the least value of '{name}' is above its largest", "exchange `min` and `max`"
    elif least is not None and value.number < least.number:
        message = f"'{name}' is {float(value.number):.6g}, below its least value {float(least.number):.6g}"
    elif most is not None and value.number > most.number:
        message = f"'{name}' is {float(value.number):.6g}, above its largest value {float(most.number):.6g}"
    if message:
        symbols.report(scalar.place, "HS309", message, hint)
    low, high = (None if bound is None else bound.expr for bound in bounds)
    parameter = Parameter(name, value.expr, scalar.value, None, low, high, symbols.text(entry.about))
    return Value(symbol(name), value.number), parameter


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


_WHAT = "a function uses its arguments, parameters and other functions"


def define_functions(symbols: SymbolTable) -> tuple[FunctionText, ...]:
    """The meaning of every function, in ``symbols.values``, and what was written for it.

    The parameters that a function uses count as they are known at a call: see ``symbols.of_functions``.
    """
    documents = symbols.document.functions
    later = "'{}' is not defined yet: a parameter is an expression of earlier ones"
    symbols.of_functions |= {str(name): Refusal("HS302", later.format(name)) for name in symbols.document.parameters}
    made = {str(name): _function(symbols, name, document) for name, document in documents.items()}
    symbols.values.update(made)
    symbols.of_functions.update(made)

    def spoil(function: Function) -> None:
        """Mark a function as broken and reported."""
        symbols.values[function.name] = symbols.of_functions[function.name] = replace(function, tree=None)

    parameters: Meanings = {str(name): Value(symbol(name)) for name in symbols.document.parameters}
    names = symbols.scope((), _WHAT, {**parameters, **made}, "make it an argument").values
    for key, document in documents.items():
        function = made[str(key)]
        own: Meanings = {argument: Value(symbol(argument)) for argument in function.arguments}
        scope = Scope(ChainMap(own, names))  # pyright: ignore[reportArgumentType]
        if function.tree is not None and not symbols.names_known(document.expression, function.tree, scope):
            spoil(function)
    calls = {name: tuple(functions_called(f.tree)) if f.tree is not None else () for name, f in made.items()}
    while (found := cycle(calls)) is not None:
        message = f"`{found[0]}` is defined by itself: {' -> '.join((*found, found[0]))}"
        place = next(key for key in documents if key == found[0]).place
        symbols.report(place, "HS302", message, "no function may lead back to itself")
        for name in found:
            calls[name] = ()
            spoil(made[name])
    return tuple(FunctionText(f.name, f.arguments, f.text) for f in made.values())


def named_functions(texts: Iterable[FunctionText], values: Mapping[str, Meaning]) -> dict[str, Function]:
    """The functions of a system, over the meaning of the parameters that they use."""
    names: dict[str, Meaning] = {}
    others = ChainMap(names, values)  # pyright: ignore[reportArgumentType]
    made = {f.name: Function(f.name, f.arguments, parse(f.text), f.text, others) for f in texts}
    names.update(made)
    return made


def _function(symbols: SymbolTable, name: Key, document: FunctionDocument) -> Function:
    known = ABSENT not in document.of
    for place, argument in enumerate(document.of):
        kind = symbols.names.get(argument)
        if argument in document.of[:place]:
            symbols.report(argument.place, "HS301", f"`{name}` has two arguments '{argument}'", "give one another name")
            known = False
        elif kind in ("parameters", "functions"):
            message = f"the argument '{argument}' of `{name}` has the name of {KINDS[kind]}"
            symbols.report(argument.place, "HS301", message, "give one of them another name")
            known = False
    tree = symbols.tree(document.expression)
    arguments, text = tuple(map(str, document.of)), document.expression.value
    return Function(str(name), arguments, tree if known else None, text, symbols.of_functions)


def placeholders(document: SolveDocument | None, mode: str = "") -> Meanings:
    """A symbol of its own for each unknown, until the equations are solved."""
    return {str(name): Value(symbol(_inner(name, mode))) for name in (document.unknowns if document else ())}


def _inner(name: str, mode: str) -> str:
    return f"unknown {name} {mode}"


def solutions(symbols: SymbolTable, document: SolveDocument, scope: Scope, mode: str = "") -> Solved | None:
    """What each unknown is, with its placeholder; None where something is reported."""
    for name in document.unknowns:
        kind = symbols.names.get(name)
        if kind is not None and not (kind == "unknowns" and not mode):
            message = f"'{name}' is an unknown of `solve` here, and also {KINDS[kind]}"
            symbols.report(name.place, "HS301", message, "give one of them another name")
            return None
    if len(document.unknowns) != len(document.equations):
        lists = {"unknown": document.unknowns, "equation": document.equations}
        count = " and ".join(counted(len(items), what) for what, items in lists.items())
        place = document.unknowns[0].place if document.unknowns else document.equations[0].place
        symbols.report(place, "HS325", f"`solve` has {count}", "give one equation for each unknown")
        return None
    sides = [symbols.equation(scalar, scope) for scalar in document.equations]
    if any(pair is None for pair in sides):
        return None
    unknowns = [symbol(_inner(name, mode)) for name in document.unknowns]
    made = linear_solutions([pair for pair in sides if pair is not None], unknowns)
    if isinstance(made, Solved):
        return made
    place, why, hint = made
    symbols.report(document.equations[place].place, "HS325", why, hint)
    return None


def with_solutions(values: Mapping[str, object], solved: Solved) -> Meanings:
    """Values with the solutions in the place of the unknowns' symbols."""
    made: Meanings = {}
    for name, value in values.items():
        if isinstance(value, Value) and value.expr.free_symbols & solved.values.keys():
            uses, size = value.uses | solved.uses, value.size + solved.size
            made[name] = replace(value, expr=value.expr.xreplace(solved.values), uses=uses, size=size, number=None)
    return made
