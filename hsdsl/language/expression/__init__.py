"""Expressions: text to a small tree, and the tree to SymPy by whitelist. Nothing is ever evaluated as a program.

Read in this order: `parse` (text to a tree), `scope` (what names mean), `symbolic` (the tree as SymPy, measured by
`numeric` before SymPy works on it), `conditions` (inequalities, events). `algebra` has choices, derivatives and
solutions of equations, `plain` text and expressions without a scope, `timebox` the bounds on SymPy's time and stack.
"""

from hsdsl.language.expression.parse import Expected, ExpressionError, parse

__all__ = ["Expected", "ExpressionError", "parse"]
