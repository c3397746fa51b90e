# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""One mass against one stop: recognised in a model, with its numbers, for the scheme paoli-schatzman."""

from __future__ import annotations

import sympy as sp

from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted
from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.preparation.values import Values
from hsdsl.engine.simulate.settings import OneStop
from hsdsl.engine.simulate.stops import show
from hsdsl.language.expression.scope import symbol
from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.system import Edge, HybridSystem, Mode

HINT = "use scheme 'relaxed'"


def one_stop(values: Values, x: tuple[Number, ...]) -> OneStop:
    """Recognise x' = v, v' = f(t) - 2 a v - k x with one stop on x and v -> -c v there; a run starts from ``x``.

    Raises UsageError: the model is not of that form, or starts beyond its stop; the message says why.
    """
    with deep_stack():
        position, expressions = _structure(values.system)
    numbers = values.evaluate(expressions)
    for name, number in numbers.items():
        if not values.kernel.arithmetic.isfinite(number):
            raise _refusal(f"its {name} has no finite value")
    slope, offset = numbers["slope"], numbers["offset"]
    if slope == 0:
        raise _refusal("its surface does not depend on the position with these parameters")
    level, restitution = -offset / slope, numbers["restitution"]
    if not 0 <= restitution <= 1:
        raise _refusal(f"its restitution is {show(restitution)}, not between 0 and 1")
    if (x[position] - level) * slope > 0:
        raise _refusal(f"it starts at {show(x[position])}, beyond its stop at {show(level)}")
    return OneStop(position, slope > 0, level, restitution, numbers["drag"] / 2, numbers["stiffness"])


def _refusal(reason: str) -> UsageError:
    return UsageError(f"scheme paoli-schatzman is for one mass and one stop, but in this model {reason}", HINT)


def _structure(system: HybridSystem) -> tuple[int, dict[str, sp.Expr]]:
    """The index of the position among the two states, and the numbers as expressions of parameters."""
    mode, edge = _only(system)
    symbols = [symbol(name) for name in mode.states]
    known = set(system.parameter_symbols)
    position = _position(edge, symbols, known)
    x, v = symbols[position], symbols[1 - position]
    if mode.flow[position] != v:
        raise _refusal(f"the derivative of {x} is not {v}")
    residual, acceleration = edge.surface.residual, mode.flow[1 - position]
    expressions = {
        "slope": residual.diff(x),
        "offset": residual.subs({x: 0}),
        "stiffness": sp.expand(-acceleration.diff(x)),
        "drag": sp.expand(-acceleration.diff(v)),
        "restitution": -edge.reset[1 - position].diff(v),
    }
    for name, what in (("stiffness", x), ("drag", v)):
        if not expressions[name].free_symbols <= known:
            raise _refusal(f"the acceleration does not have a constant coefficient of {what}")
    if edge.reset[position] != x:
        raise _refusal(f"the reset changes {x}")
    remainder = sp.expand(edge.reset[1 - position] + expressions["restitution"] * v)
    if remainder != 0 or not expressions["restitution"].free_symbols <= known:
        raise _refusal(f"the reset of {v} is not a constant times {v}")
    return position, expressions


def _only(system: HybridSystem) -> tuple[Mode, Edge]:
    """The one mode and its one transition."""
    mode, *others = system.modes
    edges = mode.edges
    for wrong, reason in (
        (others, f"there are {len(system.modes)} modes"),
        (
            len(mode.states) != 2,
            f"mode {mode.name} has {counted(len(mode.states), 'state')}, not a position and its velocity",
        ),
        (mode.walls, f"mode {mode.name} has a wall, {', '.join(wall.text for wall in mode.walls[:1])}"),
        (len(edges) != 1, f"mode {mode.name} has {counted(len(edges), 'transition')}"),
        (any(e.condition is not None for e in edges), f"transition {', '.join(e.name for e in edges)} has an `if`"),
    ):
        if wrong:
            raise _refusal(reason)
    return mode, edges[0]


def _position(edge: Edge, symbols: list[sp.Symbol], known: set[sp.Symbol]) -> int:
    """The index of the state that the guard is a level of."""
    residual = edge.surface.residual
    for k, x in enumerate(symbols):
        slope = residual.diff(x)
        if slope != 0 and slope.free_symbols <= known and residual.subs({x: 0}).free_symbols <= known:
            return k
    raise _refusal(f"the guard {edge.surface.text} is not a constant level of one state")
