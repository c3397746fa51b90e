# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""SymPy expressions as formulas over a mode's coordinates."""

from __future__ import annotations

import sympy as sp

from hsdsl import functions
from hsdsl.lower.routines import Definition, print_routines
from hsdsl.lower.straight import Gradient
from hsdsl.metrics.formulas import Formula, compiled


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
