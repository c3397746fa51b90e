# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""Conditions of edges as inequalities."""

from __future__ import annotations

import sympy as sp

from hsdsl.errors import UsageError


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
