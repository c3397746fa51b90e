# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
"""Linear equations solved by statements: orthogonal columns, which need no choice of pivots.

The modified Gram-Schmidt process on the matrix with the right side as a further column is backward stable in
any order of the equations, and the same for any unit of an unknown (A. Bjorck, *Solving linear least squares problems
by Gram-Schmidt orthogonalization*, BIT 7, 1967, doi:10.1007/BF01934122). Rows are divided by their norms before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import sympy as sp

from hsdsl.base.functions import below

# a column counts as one of the space of those before it where no more than this share of it is left: round-off of
# 64-bit floats, with room for the sums of a few hundred terms
_LEFT = sp.Rational(1, 2**44)
Named = Callable[[sp.Basic], sp.Basic]


def solved(rows: Sequence[Sequence[sp.Basic]], constants: Sequence[sp.Basic], name: Named) -> list[sp.Basic]:
    """The unknowns x of A x = b; where A is singular they have no finite value.

    ``name`` gives an expression a name; where it is one, statements stay small.
    """
    n = len(rows)
    sizes = [name(sp.sqrt(_squares(row))) for row in rows]
    columns = [[name(rows[r][c] / sizes[r]) for r in range(n)] for c in range(n)]
    right = [name(constants[r] / sizes[r]) for r in range(n)]
    whole = [name(_squares(column)) for column in columns]
    pivots: list[sp.Basic] = []
    factors: list[list[sp.Basic]] = []
    for k in range(n):
        left = name(_squares(columns[k]))
        pivots.append(name(below(name(left - _LEFT**2 * whole[k]), sp.S.Zero, sp.S.Zero, name(sp.sqrt(left)))))
        direction = [name(entry / pivots[k]) for entry in columns[k]]
        row: list[sp.Basic] = []
        for column in (*columns[k + 1 :], right):
            share = name(sp.Add(*(q * entry for q, entry in zip(direction, column, strict=True))))
            row.append(share)
            column[:] = [name(entry - share * q) for q, entry in zip(direction, column, strict=True)]
        factors.append(row)
    unknowns: list[sp.Basic] = []
    for k in reversed(range(n)):
        *others, value = factors[k]
        known = sp.Add(*(factor * x for factor, x in zip(others, unknowns, strict=True)))
        unknowns.insert(0, name((value - known) / pivots[k]))
    return unknowns


def _squares(entries: Sequence[sp.Basic]) -> sp.Basic:
    return sp.Add(*(entry**2 for entry in entries))
