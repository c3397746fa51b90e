# pyright: basic
"""The one inequality that ``when`` and an item of ``domain`` are."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.expression import symbolic
from hsdsl.expression.scope import Scope, Value
from hsdsl.expression.syntax import Comparison, ExpressionError, Logic, Not, Tree


@dataclass(frozen=True)
class Inequality:
    """``left operator right``."""

    left: Value
    operator: str
    right: Value


def inequality(tree: Tree, scope: Scope, text: str, key: str) -> Inequality:
    """The two sides of an inequality whose names the scope has.

    Raises
    ------
    ExpressionError
        As `symbolic.number`, and where there is no inequality or more than one.
    """
    comparison = the_comparison(tree, key)
    left, right = (symbolic.number(side, scope, text) for side in comparison.operands)
    return Inequality(left, comparison.operators[0], right)


def the_comparison(tree: Tree, key: str) -> Comparison:
    """The tree, if it is exactly one inequality.

    Raises
    ------
    ExpressionError
        Otherwise, with what to write under ``key``.
    """
    if isinstance(tree, (Logic, Not)) or (isinstance(tree, Comparison) and len(tree.operands) > 2):
        more = "put the rest under `if`" if key == "when" else "write each inequality as an item of its own"
        raise ExpressionError("HS116", f"`{key}` takes one inequality", tree.start, tree.end, more)
    if not isinstance(tree, Comparison):
        message = f"`{key}` takes an inequality, and this is not one"
        raise ExpressionError("HS116", message, tree.start, tree.end, "write it as left >= right")
    operator = tree.operators[0]
    if operator in ("==", "!="):
        message = f"`{key}` takes an inequality, not `{operator}`"
        hint = "write `>=` or `<=`, with the side on which the mode ends" if key == "when" else "write `>=` or `<=`"
        raise ExpressionError("HS107", message, tree.start, tree.end, hint)
    return tree
