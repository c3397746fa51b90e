# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportOptionalMemberAccess=false, reportReturnType=false
"""What orbits need of a system's mathematics: the period of its forcing, and a quantity that its motion keeps.

A quantity, such as an energy, has a level, on which an orbit is looked for; what of the return map is within it counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
import sympy as sp

from hsdsl.base.errors import UsageError
from hsdsl.base.functions import replaced
from hsdsl.base.names import did_you_mean, shown
from hsdsl.engine.execution import Array
from hsdsl.language.expression.conditions import without_roundoff
from hsdsl.language.expression.parse import ExpressionError
from hsdsl.language.expression.plain import value
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME, HybridSystem, Mode, Parameter

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


INVARIANT = 1e-6  # of its slopes: a quantity whose slopes a lap changes by more is not kept


class Level(NamedTuple):
    """A quantity of a section's states, held at its value at a point; ``at`` gives its value and slopes at others."""

    text: str
    value: float
    at: Callable[[Array], tuple[float, Array]]

    def row(self, point: Array, scale: Array) -> tuple[Array, float]:
        """Its slopes by states relative to ``scale``, of length one, and how far a point is off in them."""
        number, slopes = self.at(point)
        row = slopes * scale
        length = float(np.linalg.norm(row)) or 1.0
        return row / length, (number - self.value) / length


def quantity(system: HybridSystem, mode: Mode, states: tuple[str, ...], text: str) -> sp.Expr:
    """The expression of a text, or of an output with this name, in a mode with states.

    Raises UsageError: it is none, or not of the states and of parameters alone.
    """
    outputs = dict(zip(system.outputs, mode.outputs, strict=True))
    if text in outputs and outputs[text] is None:
        raise UsageError(f"--keep: output '{text}' has no value in mode {mode.name}", "choose another section")
    try:
        expr = outputs[text] if text in outputs else value(text)
    except ExpressionError as error:
        raise UsageError(f"--keep: '{shown(text)}' is no expression: {error}") from None
    known = [*states, *(parameter.name for parameter in system.parameters)]
    expr = expr.xreplace({symbol(name): of for name, of in outputs.items() if of is not None and name not in known})
    for name in sorted(str(each) for each in expr.free_symbols if str(each) not in known):
        hint = did_you_mean(name, known)
        raise UsageError(f"--keep: expected an expression of states and parameters, got '{name}' in it", hint)
    if not any(str(each) in states for each in expr.free_symbols):
        raise UsageError(f"--keep: '{shown(text)}' depends on no state of mode {mode.name}")
    return expr


def level_of(
    expr: sp.Expr, text: str, states: tuple[str, ...], evaluate: Callable[[dict[str, Any]], Any], point: Array
) -> Level:
    """The level through a point; ``evaluate`` makes numbers of expressions of parameters."""
    slopes = [sp.diff(expr, symbol(name)) for name in states]

    def at(point: Array) -> tuple[float, Array]:
        here = {symbol(name): sp.Rational(x) for name, x in zip(states, point.tolist(), strict=True)}
        found = evaluate({f"part_{k}": part.xreplace(here) for k, part in enumerate([expr, *slopes])})
        numbers = np.array([float(number) for number in found.values()])
        if not np.isfinite(numbers).all():
            raise UsageError(f"--keep: '{shown(text)}' has no value or no slopes at the section")
        return float(numbers[0]), numbers[1:]

    return Level(text, at(point)[0], at)


def within(row: Array, matrix: Array, text: str) -> Array:
    """A return map among the directions along which a quantity with these slopes stays, both relative to sizes.

    Raises UsageError: a lap changes the quantity.
    """
    off = float(np.max(np.abs(row @ matrix - row)))
    if off > INVARIANT * float(np.max(np.abs(row))):
        raise UsageError(
            f"--keep: '{shown(text)}' is not kept: a lap changes its slopes by {off:.2g} of their size",
            "leave --keep out, or give a quantity that flows and resets keep",
        )
    along = np.linalg.svd(row[None, :])[2][1:]
    return along @ matrix @ along.T
