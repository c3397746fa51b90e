# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportReturnType=false
"""First derivatives of expressions as expressions, by the chain rule over shared parts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import sympy as sp

from hsdsl.base.functions import replaced
from hsdsl.mathematics.lower.straight import Gradient

Slopes = dict[sp.Symbol, sp.Expr]


def slopes(expressions: Iterable[sp.Expr], arguments: Sequence[sp.Symbol]) -> list[Slopes]:
    """The derivatives of each expression by those arguments where they are not zero."""
    found = Gradient([sp.sympify(e) for e in expressions], arguments, letter="slope ", whole=True)
    meaning: dict[sp.Basic, sp.Basic] = {}
    done: dict[sp.Basic, sp.Basic] = {}
    for name, expr in found.statements:
        meaning[name] = replaced(expr, meaning, done)
    return [{a: replaced(slope, meaning, done) for a, slope in row.items()} for row in found.sparse]
