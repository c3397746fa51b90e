# pyright: basic
"""Quantities given by linear equations: the unknowns of `solve`, solved at each evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hsdsl.base.names import counted
from hsdsl.language.elaborate.symbols import KINDS, Meanings, SymbolTable
from hsdsl.language.expression.algebra import Solved, linear_solutions
from hsdsl.language.expression.scope import Scope, Value, symbol
from hsdsl.language.schema.documents import SolveDocument


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
    sides = [symbols.resolver.equation(scalar, scope) for scalar in document.equations]
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
