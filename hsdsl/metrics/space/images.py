# SymPy's types are wider than what it takes and returns.
# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false, reportOptionalMemberAccess=false
"""What holds on a guard's image: equations in the coordinates of the mode it leads into."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp


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
