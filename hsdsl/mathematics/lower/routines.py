# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Expressions -> the text of routines: statements in order, with common subexpressions taken out."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from hsdsl.mathematics.lower.printer import KernelPrinter
from hsdsl.mathematics.lower.sharing import shared
from hsdsl.mathematics.lower.straight import Cut, Statement, in_order
from hsdsl.mathematics.program import Routines


@dataclass(frozen=True)
class Definition:
    """A routine before printing: its name, arguments and tuple of results.

    ``statements`` are the names that the results use besides the arguments, and their expressions. With ``places``
    only the arguments that are used have a name in the text: of many small routines with many arguments each, the
    heads would be all there is. ``places`` has the index of each argument.
    """

    name: str
    arguments: tuple[sp.Symbol, ...]
    results: tuple
    statements: Sequence[Statement] = ()
    places: Mapping[sp.Symbol, int] | None = None


def text_of(definition: Definition) -> str:
    """Print one routine as a Python function."""
    body = _body(definition.results, tuple(definition.statements))
    if definition.places is None:
        return f"def {definition.name}({', '.join(s.name for s in definition.arguments)}):\n{body}"
    parts = _parts(*map(sp.sympify, definition.results), *(expr for _, expr in definition.statements))
    places = sorted((definition.places[symbol], symbol.name) for symbol in parts & definition.places.keys())
    named = "".join(f"    {name} = given[{i}]\n" for i, name in places)
    return f"def {definition.name}(*given):\n{named}{body}"


def _parts(*expressions: sp.Basic) -> set[sp.Basic]:
    """Expressions and all their parts, each visited once."""
    found, waiting = set[sp.Basic](), list(expressions)
    while waiting:
        if (expr := waiting.pop()) not in found:
            found.add(expr)
            waiting += expr.args
    return found


@lru_cache(maxsize=4096)  # the modes of a large model have most of their routines in common
def _body(results: tuple, statements: tuple[Statement, ...]) -> str:
    printer = KernelPrinter()
    statements, results = written_out(results, statements)
    lines = [f"    {symbol.name} = {printer.doprint(expr)}\n" for symbol, expr in statements]
    return "".join([*lines, f"    return ({''.join(printer.doprint(expr) + ', ' for expr in results)})\n"])


def written_out(results: tuple, statements: Sequence[Statement] = ()) -> tuple[list[Statement], tuple]:
    """Cut down statements and results, and take out their common parts."""
    cut = Cut("v", powers=True)
    given = [(symbol, cut.down(expr)) for symbol, expr in statements]
    small = [cut.down(expr) for expr in map(sp.sympify, results)]
    known = [*given, *cut.statements]
    common, reduced = shared([*(e for _, e in known), *small], "w")
    last = tuple(reduced)[len(known) :]
    named = zip((symbol for symbol, _ in known), reduced, strict=False)
    return in_order([*common, *named], sp.Tuple(*last)), last


def print_routines(definitions: Iterable[Definition], data: Sequence[sp.Symbol]) -> Routines:
    """Put routines into one ``bind`` whose arguments are the data they close over."""
    definitions = tuple(definitions)
    names = tuple(d.name for d in definitions)
    body = "".join(textwrap.indent(text_of(d), "    ") for d in definitions)
    head = f"def bind({', '.join(s.name for s in data)}):\n"
    result = f"({', '.join(names)},)" if names else "()"
    return Routines(names, f"{head}{body}    return {result}\n")
