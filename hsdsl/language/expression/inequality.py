# pyright: basic
"""The one inequality that ``when`` and an item of ``domain`` are."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.names import shown
from hsdsl.language.expression import symbolic
from hsdsl.language.expression.scope import Scope, Value
from hsdsl.language.expression.syntax import Comparison, ExpressionError, Logic, Not, Tree, Truth


@dataclass(frozen=True)
class Inequality:
    """``left operator right``."""

    left: Value
    operator: str
    right: Value


def inequality(tree: Tree, scope: Scope, text: str, key: str) -> Inequality:
    """The two sides of an inequality whose names the scope has.

    Raises ExpressionError: as `symbolic.number`, and where there is no inequality or more than one.
    """
    comparison = the_comparison(tree, key, text)
    left, right = (symbolic.number(side, scope, text) for side in comparison.operands)
    return Inequality(left, comparison.operators[0], right)


def equation(tree: Tree, scope: Scope, text: str) -> tuple[Value, Value]:
    """The two sides of an equation whose names the scope has.

    Raises ExpressionError: as `symbolic.number`, and where there is no single equation.
    """
    if not (isinstance(tree, Comparison) and tree.operators == ("==",)):
        raise ExpressionError.at(tree, "HS325", "expected one equation", "write it as left == right")
    left, right = (symbolic.number(side, scope, text) for side in tree.operands)
    return left, right


def the_comparison(tree: Tree, key: str, text: str) -> Comparison:
    """The tree, if it is exactly one inequality.

    Raises ExpressionError: otherwise, with what to write under ``key``.
    """
    if isinstance(tree, (Logic, Not)) or (isinstance(tree, Comparison) and len(tree.operands) > 2):
        message = f"`{key}` takes one inequality"
        raise ExpressionError.at(tree, "HS116", message, _apart(tree, key, text))
    if not isinstance(tree, Comparison):
        message = f"`{key}` takes an inequality, and this is not one"
        hint = "write it as left >= right" + ("" if isinstance(tree, Truth) else f": {_said(tree, text)} >= 0")
        raise ExpressionError.at(tree, "HS116", message, hint)
    operator = tree.operators[0]
    if operator in ("==", "!="):
        message = f"`{key}` takes an inequality, not `{operator}`"
        left, right = (_said(side, text) for side in tree.operands)
        hint = f"write {left} >= {right} or {left} <= {right}, whichever is true where the mode "
        hint += "ends" if key == "when" else "may be"
        raise ExpressionError.at(tree, "HS107", message, hint)
    return tree


def _apart(tree: Tree, key: str, text: str) -> str:
    """The hint for several inequalities in one."""
    if key != "when":
        return "write each inequality as an item of its own"
    event = f"write event: {_said(tree, text)}, which is made where that turns true"
    if not (isinstance(tree, Logic) and all(isinstance(operand, Comparison) for operand in tree.operands)):
        return event
    if tree.operator == "or":
        return "write a transition for each: " + "; ".join(f"when: {_said(o, text)}" for o in tree.operands)
    first, *others = (_said(operand, text) for operand in tree.operands)
    return f"{event}; `when: {first}` with `if: {' and '.join(others)}` reads the `if` only where the first is crossed"


def _said(tree: Tree, text: str) -> str:
    return shown(text[tree.start : tree.end], 40)
