# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
"""Time in a system: whether it depends on it, with which period, and the same system begun at another phase."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce

import sympy as sp

from hsdsl.base.errors import UsageError
from hsdsl.base.functions import replaced
from hsdsl.language.expression.conditions import without_roundoff
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, HybridSystem, Parameter

PHASE = "phase of the start"  # a parameter of a system that can begin at any phase
PERIODIC = {sp.sin: 2, sp.cos: 2, sp.tan: 1}  # periods in multiples of pi
HINT = "give the period of the forcing as an expression: --period 2*pi/omega"


def forced(system: HybridSystem) -> bool:
    """Whether anything but outputs depends on time."""
    if system.inputs:
        names = ", ".join(i.name for i in system.inputs)
        raise UsageError(f"samples of inputs do not repeat, so no execution does: {names}", "write expressions of t")
    return any(TIME in e.free_symbols for e in _expressions(system))


def forcing_period(system: HybridSystem) -> sp.Expr:
    """The period of the forcing as an expression of parameters: that of every sine, cosine and tangent of time.

    Raises UsageError: time is elsewhere, or the periods have no common multiple that can be seen.
    """
    constants = set(system.parameter_symbols)
    periods = [period for expression in _expressions(system) for period in _periods(expression, constants)]
    return reduce(_common, dict.fromkeys(periods))


def _periods(expression: sp.Basic, constants: set[sp.Symbol]) -> Iterator[sp.Expr]:
    if TIME not in expression.free_symbols:
        return
    if type(expression) in PERIODIC:
        frequency = sp.diff(expression.args[0], TIME)
        if frequency == 0 or not frequency.free_symbols <= constants:
            raise UsageError(f"{expression} does not have a constant period", HINT)
        yield PERIODIC[type(expression)] * sp.pi / frequency
    elif not expression.args:
        raise UsageError("the model depends on time outside of sines, cosines and tangents", HINT)
    else:
        for part in expression.args:
            yield from _periods(part, constants)


def _common(one: sp.Expr, other: sp.Expr) -> sp.Expr:
    """The shortest multiple of two periods."""
    ratio = sp.simplify(one / other)
    if not ratio.is_Rational:
        raise UsageError(f"the forcing has the periods {one} and {other}, without a common multiple", HINT)
    return one * ratio.q


def shifted(system: HybridSystem) -> HybridSystem:
    """The system with its time begun at the phase that the parameter :data:`PHASE` is."""
    at = {TIME: TIME + symbol(PHASE)}
    done: dict[sp.Basic, sp.Basic] = {}

    return replace(
        system,
        parameters=(*system.parameters, Parameter(PHASE, sp.S.Zero, "0")),
        modes=tuple(replace(mode.mapped(lambda expr: replaced(expr, at, done)), scene=()) for mode in system.modes),
        reference=(),
        scene=(),
    )


def _expressions(system: HybridSystem) -> Iterator[sp.Basic]:
    for mode in system.modes:
        yield from mode.flow
        yield from (surface.residual for surface in mode.surfaces)
        for edge in mode.edges:
            yield from (without_roundoff(value) for value in edge.reset)
            if edge.condition is not None:
                yield without_roundoff(edge.condition)
