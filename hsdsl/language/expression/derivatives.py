# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportCallIssue=false, reportReturnType=false
"""Derivatives of expressions by symbols, almost everywhere."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import sympy as sp

from hsdsl.base.functions import below, floor, sign
from hsdsl.language.expression.scope import TIME


@lru_cache(maxsize=4096)  # memory of events has many conditions, which only jump
def moving(expr: sp.Basic) -> frozenset[Any]:
    """The symbols outside of what only jumps: by the others the derivative is zero."""
    if expr.is_Symbol:
        return frozenset((expr,))
    if isinstance(expr, (sign, floor)):
        return frozenset()
    parts = expr.args[2:] if isinstance(expr, below) else expr.args
    return frozenset().union(*map(moving, parts))


@lru_cache(maxsize=1 << 14)  # the modes of a large model have most of their derivatives in common
def derivative(expr: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """The derivative of an expression by a symbol: that of SymPy, which asks of every part of it whether it is zero."""
    if symbol not in moving(expr):
        return sp.S.Zero
    if expr.is_Symbol:
        return sp.S.One
    if isinstance(expr, below):
        return below(*expr.args[:2], *(derivative(choice, symbol) for choice in expr.args[2:]))
    ordinary = type(expr)._eval_derivative is sp.Function._eval_derivative  # by the chain rule
    if not (expr.is_Add or expr.is_Mul or ordinary or (expr.is_Pow and expr.exp.is_Number)):
        return expr.diff(symbol)
    slopes = [(i, slope) for i, part in enumerate(expr.args) if (slope := derivative(part, symbol)) != 0]
    if not slopes:
        return sp.S.Zero
    if expr.is_Pow:
        return expr * (slopes[0][1] * expr.exp / expr.base)
    if ordinary:
        return sp.Add(*(expr.fdiff(i + 1) * slope for i, slope in slopes))
    if expr.is_Mul:
        return sp.Add(*(sp.Mul(*expr.args[:i], slope, *expr.args[i + 1 :]) for i, slope in slopes))
    return sp.Add(*(slope for _, slope in slopes))


def lie_derivative(expr: sp.Expr, flow: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """The derivative of an expression of time and states along a flow, L_f."""
    rates = {TIME: sp.S.One, **flow}
    present = sorted(expr.free_symbols & rates.keys(), key=lambda s: s.name)
    return sp.Add(*(derivative(expr, s) * rates[s] for s in present))
