# pyright: basic
"""Text and expressions over plain symbols, both ways: every name means itself, and nothing is substituted.

What is written is exact: the same mathematics is read back.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from hsdsl.base.functions import CONSTANTS, FUNCTIONS
from hsdsl.language.expression import symbolic
from hsdsl.language.expression.algebra import positive
from hsdsl.language.expression.conditions import the_comparison
from hsdsl.language.expression.parse import LARGEST_INTEGER, Call, Expected, Name, Tree, mapped, parse, walk
from hsdsl.language.expression.scope import Function, Scope, state

_NONE: dict[str, Function] = {}
RANGES = ("sum", "min", "max", "count")  # that one argument may range over instances of parts


def names_in(text: str) -> list[str]:
    """The names in an expression or a condition, constants of the language aside."""
    return [node.name for node in walk(parse(text)) if isinstance(node, Name) and node.name not in CONSTANTS]


def value(text: str, functions: Mapping[str, Function] = _NONE) -> Any:
    """The SymPy expression, with calls of ``functions`` written out.

    Raises ExpressionError: a function that there is not, a constant without a value, too large.
    """
    tree = _parsed(text)
    return symbolic.number(tree, _scope(tree, functions), text).expr


def condition(text: str, functions: Mapping[str, Function] = _NONE) -> Any:
    """The SymPy Boolean; errors as for :func:`value`."""
    tree = _parsed(text, "condition")
    return symbolic.condition(tree, _scope(tree, functions), text)


def inequality(text: str, functions: Mapping[str, Function] = _NONE) -> tuple[Any, str, Any]:
    """Both sides of an inequality with its sign; errors as for :func:`value`."""
    tree = _parsed(text, "inequality")
    comparison, scope = the_comparison(tree, "when", text), _scope(tree, functions)
    left, right = (symbolic.number(side, scope, text).expr for side in comparison.operands)
    return left, comparison.operators[0], right


def _parsed(text: str, expected: Expected = "number") -> Tree:
    """The tree of a text, in which a sum over instances of parts is one name."""

    def whole(tree: Tree) -> Tree:
        inside = text[tree.start : tree.end]
        one = isinstance(tree, Call) and len(tree.arguments) == 1 and tree.function in RANGES
        if one and ("." in inside or inside.startswith("count")):
            return Name(inside, tree.start, tree.end)
        return mapped(tree, whole)

    tree = parse(text, expected)
    return whole(tree) if "." in text or "count" in text else tree


def _scope(tree: Tree, functions: Mapping[str, Function]) -> Scope:
    named = {node.name: state(node.name) for node in walk(tree) if isinstance(node, Name)}
    scope = Scope({**named, **functions}, expanded=(lambda t: t) if any("." in name for name in named) else None)
    if faults := scope.faults(tree):
        raise faults[0]
    return scope


_NAMES = {function: name for name, (function, *_) in FUNCTIONS.items()}  # `below` apart
_MOST_PLACES = 12


class _Printer(StrPrinter):
    """SymPy's own text with the language's names of functions, and short fractions as decimals."""

    def _print_Function(self, expr: Any) -> str:
        name = _NAMES.get(expr.func, expr.func.__name__)
        return f"{name}({', '.join(map(self._print, expr.args))})"

    def _print_below(self, expr: Any) -> str:
        return f"select({', '.join(map(self._print, (positive(expr), *expr.args[2:])))})"

    def _print_Exp1(self, expr: Any) -> str:
        return "exp(1)"

    def _print_Abs(self, expr: Any) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_Integer(self, expr: Any) -> str:
        return f"{expr.p}e0" if abs(expr.p) > LARGEST_INTEGER else str(expr.p)

    def _print_Rational(self, expr: Any) -> str:
        for places in range(1, _MOST_PLACES):
            if 10**places % expr.q == 0:
                whole, part = divmod(abs(expr.p) * 10**places // expr.q, 10**places)
                return f"{'-' * (expr.p < 0)}{whole}.{part:0{places}d}"
        return f"{self._print(sp.Integer(expr.p))}/{self._print(sp.Integer(expr.q))}"

    def _print_And(self, expr: Any) -> str:
        return " and ".join(self._part(a) for a in expr.args)

    def _print_Or(self, expr: Any) -> str:
        return " or ".join(self._part(a) for a in expr.args)

    def _print_Not(self, expr: Any) -> str:
        return f"not {self._part(expr.args[0])}"

    def _part(self, expr: Any) -> str:
        text = self._print(expr)
        return f"({text})" if isinstance(expr, sp.And | sp.Or | sp.Not) else text


def text_of(expr: Any) -> str:
    """The text of an expression, or of a condition."""
    return _Printer().doprint(expr)
