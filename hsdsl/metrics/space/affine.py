# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""What is affine, recognised exactly: by constant derivatives at the parameter values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy as sp

from hsdsl import functions


@dataclass(frozen=True)
class Affine:
    """``gradient @ x + constant``."""

    gradient: np.ndarray
    constant: float


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
    numbers = np.array([float(sp.N(v, 20)) for v in (*gradient, constant)])
    return Affine(numbers[:-1], float(numbers[-1])) if np.all(np.isfinite(numbers)) else None


def stack(rows: list[Affine], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows as inequalities: normals and levels."""
    normals = np.array([r.gradient for r in rows]).reshape(len(rows), size)
    return normals, np.array([-r.constant for r in rows])
