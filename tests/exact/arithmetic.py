"""Numbers of test data: arithmetic text such as ``1/3`` or ``2 + sqrt(eps)`` to forty digits."""

from __future__ import annotations

import ast
import operator
from collections.abc import Mapping
from typing import Any

import mpmath as mp

DIGITS = 45
OPERATORS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS = {"sqrt": mp.sqrt, "log": mp.log, "exp": mp.exp, "sin": mp.sin, "cos": mp.cos, "acos": mp.acos}
FUNCTIONS |= {"asin": mp.asin, "atan": mp.atan}


def evaluate(text: Any, names: Mapping[str, Any] | None = None) -> mp.mpf:
    """Evaluate arithmetic over numbers, ``pi``, ``nan``, a few functions and ``names``; decimals are taken exactly.

    Raises KeyError: a name or function that is not known.
    """
    known = {"pi": mp.pi, "nan": mp.nan, **(names or {})}
    source = str(text)

    def walk(node: ast.expr) -> Any:
        match node:
            case ast.Constant():
                return mp.mpf(ast.get_source_segment(source, node))
            case ast.Name(id=name):
                return mp.mpf(known[name])
            case ast.BinOp(left=left, op=op, right=right):
                return OPERATORS[type(op)](walk(left), walk(right))
            case ast.UnaryOp(op=op, operand=operand):
                return OPERATORS[type(op)](walk(operand))
            case ast.Call(func=ast.Name(id=name), args=arguments):
                return FUNCTIONS[name](*map(walk, arguments))
            case _:
                raise ValueError(f"not arithmetic: {source}")

    with mp.workdps(DIGITS):
        return +walk(ast.parse(source, mode="eval").body)
