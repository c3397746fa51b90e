# pyright: basic
"""Systems of linear equations: their solutions, as functions of all coefficients."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from hsdsl.base.functions import solution
from hsdsl.language.expression.scope import Value

_MOST_TRIES = 3  # points at which a matrix must be singular to count as singular everywhere


@dataclass(frozen=True)
class Solved:
    """The expression of each unknown, the states that the equations use, and how many nodes they have."""

    values: dict[Any, Any]
    uses: frozenset[str]
    size: int


def linear_solutions(
    sides: Sequence[tuple[Value, Value]], unknowns: Sequence[Any]
) -> Solved | tuple[int, str, str | None]:
    """The solutions of equations left == right; or which equation has a fault, what it is, and a hint."""
    rows, constants = [], []
    zero = dict.fromkeys(unknowns, sp.S.Zero)
    for place, (left, right) in enumerate(sides):
        residual = left.expr - right.expr
        row = [residual.diff(x) for x in unknowns]
        if any(entry.free_symbols & zero.keys() for entry in row):
            return place, "this equation is not linear in the unknowns", "products and functions of unknowns are not"
        if all(entry == 0 for entry in row):
            return place, "this equation has none of the unknowns", "an unknown of each equation must be in it"
        rows.append(row)
        constants.append(-residual.xreplace(zero))
    if _singular(rows):
        message = "these equations do not determine the unknowns: one of them follows from the others"
        return len(sides) - 1, message, "remove an unknown and an equation, or add what is missing"
    count = len(unknowns)
    entries = [entry for row in rows for entry in row]
    if count == 1:
        values = {unknowns[0]: constants[0] / entries[0]}
    else:
        values = {x: solution(sp.Integer(i), sp.Integer(count), *entries, *constants) for i, x in enumerate(unknowns)}
    parts = [value for pair in sides for value in pair]
    return Solved(values, frozenset().union(*(part.uses for part in parts)), sum(part.size for part in parts))


def _singular(rows: list[list[Any]]) -> bool:
    """Whether a matrix is singular at some random points."""
    numbers = random.Random(0)
    names = sorted({s for row in rows for entry in row for s in entry.free_symbols}, key=lambda s: s.name)
    for _ in range(_MOST_TRIES):
        point = {name: sp.Rational(numbers.randint(1, 9999), 997) for name in names}
        try:
            matrix: Any = sp.Matrix([[entry.xreplace(point).evalf(60) for entry in row] for row in rows])
            if not all(entry.is_real and entry.is_finite for entry in matrix):
                return False
            sizes = [max(abs(entry) for entry in matrix.row(i)) for i in range(len(rows))]
            scaled: Any = sp.Matrix([[entry / size for entry in matrix.row(i)] for i, size in enumerate(sizes)])
            if not abs(scaled.det()) < sp.Float("1e-40", 60):
                return False
        except (TypeError, ValueError, ZeroDivisionError):
            return False
    return True
