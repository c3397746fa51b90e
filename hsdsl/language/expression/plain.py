# pyright: basic
"""Expressions over plain symbols: every name means itself, and nothing is substituted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hsdsl.base.functions import CONSTANTS
from hsdsl.language.expression import symbolic
from hsdsl.language.expression.conditions import the_comparison
from hsdsl.language.expression.parse import Call, Expected, Name, Tree, mapped, parse, walk
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
