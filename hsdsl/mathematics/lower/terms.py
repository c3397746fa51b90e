# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false, reportCallIssue=false
"""Bounds on the terms that expressions are computed from: so many units of round-off are in their values.

This is running error analysis (N. J. Higham, Accuracy and Stability of Numerical Algorithms, SIAM 2002, 3.3), to first
order. It sees what derivatives do not: terms that cancel, as in sin(x)**2 + cos(x)**2. A value that jumps counts with
the branch that it is on.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import sympy as sp

from hsdsl.base.functions import absolute, below, floor, maximum, minimum, rebuilt, sign
from hsdsl.mathematics.lower.sharing import Statement, shared
from hsdsl.mathematics.lower.straight import Cut

_CONSTANT, _SEEN, _HIDDEN = range(3)


def may_hide(expressions: Iterable[sp.Expr], moving: Collection[sp.Symbol]) -> bool:
    """Whether terms of a sum may cancel, unseen by what the last digits of states and time change in it.

    These change a product of states by as much as its last digits are. They do not change a constant, and hardly the
    cosine of a small angle. One such term of a sum is no harm: what cancels it is as large, and seen.
    """
    kinds: dict[sp.Basic, int] = {}

    def kind(expr: sp.Basic) -> int:
        if expr not in kinds:
            parts = [kind(part) for part in expr.args]
            kinds[expr] = _kind(expr, parts) if any(parts) else _SEEN if expr in moving else _CONSTANT
        return kinds[expr]

    def _kind(expr: sp.Basic, parts: list[int]) -> int:
        if expr.is_Add and len(parts) - parts.count(_SEEN) > 1:
            raise _Hides
        if expr.is_Mul:
            return _SEEN if _SEEN in parts else _HIDDEN
        alone = isinstance(expr, (absolute, sp.sin, sp.sinh)) or (expr.is_Pow and expr.exp.is_Number)
        return _SEEN if parts[0] == _SEEN and (alone or (expr.is_Add and set(parts) == {_SEEN})) else _HIDDEN

    try:
        for expr in expressions:
            kind(expr)
    except _Hides:
        return True
    return False


class _Hides(Exception):
    """A sum has two terms whose last digits are not seen."""


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
