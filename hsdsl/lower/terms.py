# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false, reportCallIssue=false
"""Bounds on the terms that expressions are computed from: so many units of round-off are in their values.

This is running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, SIAM 2002, 3.3), to first
order. It sees what derivatives do not: terms that cancel, as in sin(x)**2 + cos(x)**2. A value that jumps counts with
the branch that it is on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from hsdsl.functions import absolute, below, floor, maximum, minimum, rebuilt, sign
from hsdsl.lower.sharing import Statement, shared
from hsdsl.lower.straight import Cut


class Terms:
    """The terms of expressions: ``bounds`` has a bound for each, ``statements`` are the names in them, in order.

    ``sizes`` are those of the symbols that have one; of another it is its value.
    """

    def __init__(self, expressions: Sequence[sp.Expr], sizes: Mapping[sp.Symbol, sp.Expr]) -> None:
        common, small = shared(expressions, "e_")
        self._cut, self._sizes = Cut("e"), dict(sizes)
        self._known: dict[sp.Basic, sp.Expr] = {}
        for name, expr in common:
            self._cut.define(name, expr)
        small = [self._cut.down(expr) for expr in small]
        for name, expr in tuple(self._cut.statements):
            self._sizes[name] = self._bound(expr)
        self.bounds = tuple(map(self._bound, small))
        self.statements: Sequence[Statement] = self._cut.statements

    def _bound(self, expr: sp.Expr) -> sp.Expr:
        if expr not in self._known:
            self._known[expr] = self._cut.name(self._of(expr))
        return self._known[expr]

    def _of(self, expr: sp.Expr) -> sp.Expr:
        if expr.is_Symbol or not expr.args:
            return self._sizes.get(expr, absolute(expr))
        if isinstance(expr, (sign, floor)):
            return absolute(expr)
        if isinstance(expr, below):
            return below(*expr.args[:2], *map(self._bound, expr.args[2:]))
        parts = list(map(self._bound, expr.args))
        if isinstance(expr, (minimum, maximum)):
            return maximum(*parts)
        if expr.is_Add or isinstance(expr, absolute):
            return sp.Add(*parts)
        return sp.Add(absolute(expr), *(absolute(s) * part for s, part in zip(self._slopes(expr), parts, strict=True)))

    def _slopes(self, expr: sp.Expr) -> list[sp.Expr]:
        """The derivatives of an operation by its operands."""
        if expr.is_Mul:
            return [sp.Mul(*expr.args[:i], *expr.args[i + 1 :]) for i in range(len(expr.args))]
        operands = [sp.Dummy(real=True) for _ in expr.args]
        known = dict(zip(operands, expr.args, strict=True))
        if expr.is_Pow and expr.exp.is_Number:
            return [expr.exp * rebuilt(expr, (expr.base, expr.exp - 1)), sp.S.Zero]
        whole = rebuilt(expr, operands)
        return [whole.diff(operand).xreplace(known) for operand in operands]
