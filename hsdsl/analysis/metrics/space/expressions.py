# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""SymPy expressions of a mode's coordinates as geometry: affine functions, inequalities, compiled formulas, images."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import sympy as sp

from hsdsl.analysis.metrics.formulas import Formula, compiled
from hsdsl.analysis.metrics.rational import Exact
from hsdsl.base import functions
from hsdsl.base.errors import UsageError
from hsdsl.mathematics.lower.straight import Definition, Gradient, print_routines

DIGITS = 60  # of a number that is not rational


def affine(expression: sp.Expr, symbols) -> Exact | None:
    """The expression as an affine function (its constant, then its slopes), None where it is none."""
    expression = sp.expand(expression)
    own = set(symbols)
    if any(f.free_symbols & own for f in expression.atoms(functions.sign, functions.floor, sp.sign, sp.floor)):
        return None
    gradient = [sp.expand(expression.diff(s)) for s in symbols]
    if any(g.free_symbols & own for g in gradient):
        return None
    constant = expression.xreplace(dict.fromkeys(symbols, sp.S.Zero))
    numbers = [_rational(v) for v in (constant, *gradient)]
    return None if None in numbers else np.array(numbers, dtype=object)


def _rational(value: sp.Expr) -> Fraction | None:
    if not value.is_Rational:
        value = sp.N(value, DIGITS)
        if not (value.is_Float and value.is_finite):
            return None
        value = sp.Rational(value)
    return Fraction(int(value.p), int(value.q))


def clauses(condition) -> list[list[sp.Expr]]:
    """A condition as alternatives, each a list of expressions that are at most 0 (closed: strict counts as not)."""
    if condition is None:
        return [[]]
    normal = sp.to_dnf(condition, simplify=False)
    if normal == sp.true:
        return [[]]
    if normal == sp.false:
        return []
    return [
        [e for literal in sp.And.make_args(clause) for e in _literal(literal)] for clause in sp.Or.make_args(normal)
    ]


def _literal(literal) -> list[sp.Expr]:
    if isinstance(literal, sp.Not):
        literal = literal.args[0].negated
    if literal == sp.true or isinstance(literal, sp.Ne):
        return []
    if isinstance(literal, (sp.Ge, sp.Gt)):
        return [literal.rhs - literal.lhs]
    if isinstance(literal, (sp.Le, sp.Lt)):
        return [literal.lhs - literal.rhs]
    if isinstance(literal, sp.Eq):
        return [literal.lhs - literal.rhs, literal.rhs - literal.lhs]
    raise UsageError(f"distances: the condition {literal} is no comparison of numbers")


def formula(expressions, coordinates) -> Formula:
    """Compile expressions of some coordinates, with their derivatives."""
    numbered = [sp.Symbol(f"x{i}", real=True) for i in range(len(coordinates))]
    mapping = dict(zip(coordinates, numbered, strict=True))
    results = tuple(sp.sympify(e).xreplace(mapping) for e in expressions)
    slopes = Gradient(results, numbered)
    rows = tuple(entry for row in slopes.rows for entry in row)
    definitions = [
        Definition("value", tuple(numbered), results),
        Definition("jacobian", tuple(numbered), rows, slopes.statements),
    ]
    jumps = any(
        f.free_symbols & set(numbered)
        for e in results
        for f in e.atoms(functions.sign, functions.floor, sp.sign, sp.floor)
    )
    return compiled(print_routines(definitions, ()), (len(results), len(numbered)), jumps)


def equations(surface: sp.Expr, reset: Sequence[sp.Expr], own: Sequence[sp.Symbol], image: Sequence[sp.Symbol]):
    """Expressions of the image's coordinates that are 0 on it; none where the reset hides too much.

    A coordinate that the reset hands on, scaled or shifted, is known from the image; so is what is made of such ones.
    """
    known: dict[sp.Symbol, sp.Expr] = {}
    used: set[sp.Symbol] = set()
    for target, value in zip(image, reset, strict=True):
        symbols = value.free_symbols & set(own)
        if len(symbols) != 1:
            continue
        (source,) = symbols
        slope = sp.expand(value).diff(source)
        if source not in known and slope.is_number and slope != 0:
            known[source] = (_fresh(target) - value.xreplace({source: sp.S.Zero})) / slope
            used.add(target)
    vanishing = [(surface, surface.free_symbols)]
    vanishing += [
        (_fresh(target) - value, value.free_symbols)
        for target, value in zip(image, reset, strict=True)
        if target not in used
    ]
    back = {_fresh(target): target for target in image}
    given = set(known)
    return [
        sp.sympify(expression).xreplace(known).xreplace(back)
        for expression, symbols in vanishing
        if symbols & set(own) <= given
    ]


def _fresh(symbol: sp.Symbol) -> sp.Symbol:
    """The image's coordinate of a name, which the guard's mode may have as well."""
    return sp.Symbol(f"{symbol.name}'", real=True)
