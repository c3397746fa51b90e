# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""What is affine, recognised exactly: by constant derivatives at the parameter values."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from hsdsl import functions
from hsdsl.metrics.rational import Row, Vector

DIGITS = 60  # of a number that is not rational


@dataclass(frozen=True)
class Affine:
    """``gradient . x + constant``."""

    gradient: Vector
    constant: Fraction

    @property
    def row(self) -> Row:
        """The inequality that it is at most 0."""
        return self.gradient, -self.constant


def affine(expression: sp.Expr, symbols) -> Affine | None:
    """The expression as an affine function, None where it is none."""
    expression = sp.expand(expression)
    own = set(symbols)
    if any(f.free_symbols & own for f in expression.atoms(functions.sign, functions.floor, sp.sign, sp.floor)):
        return None
    gradient = [sp.expand(expression.diff(s)) for s in symbols]
    if any(g.free_symbols & own for g in gradient):
        return None
    constant = expression.xreplace(dict.fromkeys(symbols, sp.S.Zero))
    numbers = [_rational(v) for v in (*gradient, constant)]
    if any(v is None for v in numbers):
        return None
    return Affine(tuple(numbers[:-1]), numbers[-1])


def _rational(value: sp.Expr) -> Fraction | None:
    if not value.is_Rational:
        value = sp.N(value, DIGITS)
        if not (value.is_Float and value.is_finite):
            return None
        value = sp.Rational(value)
    return Fraction(int(value.p), int(value.q))
