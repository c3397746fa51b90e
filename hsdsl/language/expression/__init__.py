"""Expressions: text to a small tree, and the tree to SymPy by whitelist. Nothing is ever evaluated as a program."""

from hsdsl.language.expression.parse import parse
from hsdsl.language.expression.syntax import Expected, ExpressionError

__all__ = ["Expected", "ExpressionError", "parse"]
