# pyright: basic
"""Expressions and inequalities as text of the language, exact: the same mathematics is read back."""

from __future__ import annotations

from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from hsdsl.base.functions import FUNCTIONS
from hsdsl.language.expression.algebra import positive
from hsdsl.language.expression.parse import LARGEST_INTEGER
from hsdsl.language.system import Surface

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


def inequality(surface: Surface) -> str:
    """The text of a guard."""
    return _between(surface, ">=", "<=")


def wall(surface: Surface) -> str:
    """The text of a wall, whose surface is negative where the inequality holds."""
    return _between(surface, "<=", ">=")


def _between(surface: Surface, of_difference: str, otherwise: str) -> str:
    """The sides of a surface, with the sign for a residual that is their difference or with the other one."""
    sign = of_difference if surface.residual == surface.left - surface.right else otherwise
    return f"{text_of(surface.left)} {sign} {text_of(surface.right)}"
