# pyright: basic
"""Functions that a file defines: their arguments, their expressions, and cycles among them."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable, Mapping
from dataclasses import replace

from hsdsl.base.graphs import cycle
from hsdsl.language.elaborate.symbols import KINDS, Meanings, SymbolTable
from hsdsl.language.expression import parse
from hsdsl.language.expression.scope import Function, Meaning, Refusal, Scope, Value, functions_called, symbol
from hsdsl.language.schema.documents import FunctionDocument
from hsdsl.language.source import ABSENT, Key
from hsdsl.language.system import FunctionText

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
    names = symbols.scope((), _WHAT, {**_parameters(symbols), **made}, "make it an argument").values
    for name, function in made.items():
        _check(symbols, documents[name], function, names)  # pyright: ignore[reportArgumentType]
    _refuse_cycles(symbols, made)
    return tuple(FunctionText(f.name, f.arguments, f.text) for f in made.values())


def named_functions(texts: Iterable[FunctionText], values: Mapping[str, Meaning]) -> dict[str, Function]:
    """The functions of a system, over the meaning of the parameters that they use."""
    names: dict[str, Meaning] = {}
    others = ChainMap(names, values)  # pyright: ignore[reportArgumentType]
    made = {f.name: Function(f.name, f.arguments, parse(f.text), f.text, others) for f in texts}
    names.update(made)
    return made


def _parameters(symbols: SymbolTable) -> Meanings:
    return {str(name): Value(symbol(name)) for name in symbols.document.parameters}


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
    tree = symbols.resolver.tree(document.expression)
    arguments, text = tuple(map(str, document.of)), document.expression.value
    return Function(str(name), arguments, tree if known else None, text, symbols.of_functions)


def _check(symbols: SymbolTable, document: FunctionDocument, function: Function, names: Mapping[str, Meaning]) -> None:
    own: Meanings = {argument: Value(symbol(argument)) for argument in function.arguments}
    scope = Scope(ChainMap(own, names))  # pyright: ignore[reportArgumentType]
    if function.tree is not None and not symbols.resolver.names_known(document.expression, function.tree, scope):
        _spoil(symbols, function)


def _spoil(symbols: SymbolTable, function: Function) -> None:
    """Mark a function as broken and reported."""
    symbols.values[function.name] = symbols.of_functions[function.name] = replace(function, tree=None)


def _refuse_cycles(symbols: SymbolTable, made: Mapping[str, Function]) -> None:
    calls = {name: tuple(functions_called(f.tree)) if f.tree is not None else () for name, f in made.items()}
    while (found := cycle(calls)) is not None:
        message = f"`{found[0]}` is defined by itself: {' -> '.join((*found, found[0]))}"
        symbols.report(_key(symbols, found[0]).place, "HS302", message, "no function may lead back to itself")
        for name in found:
            calls[name] = ()
            _spoil(symbols, made[name])


def _key(symbols: SymbolTable, name: str) -> Key:
    return next(key for key in symbols.document.functions if key == name)
