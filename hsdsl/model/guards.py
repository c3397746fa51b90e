# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Guards that are levels of one state (``x >= x_max``): where a plot draws a dotted line."""

from __future__ import annotations

import sympy as sp

from hsdsl.expression.scope import symbol
from hsdsl.model.values import Values
from hsdsl.names import without_memory
from hsdsl.plot import GuardLine


def guard_lines(values: Values) -> list[GuardLine]:
    """Return the level of every guard and wall that compares one state with parameters."""
    system = values.system
    parameters = set(system.parameter_symbols)
    lines: list[tuple[str, str, sp.Expr, str]] = []
    for mode in system.modes:
        states = {symbol(name): name for name in without_memory(mode.states)}
        labelled = [(edge.surface, (*edge.of_event, edge.name)[0]) for edge in mode.edges]
        labelled += [(wall, wall.text) for wall in mode.walls]
        for surface, label in labelled:
            for side, level in ((surface.left, surface.right), (surface.right, surface.left)):
                if isinstance(side, sp.Symbol) and side in states and level.free_symbols <= parameters:
                    lines.append((mode.name, states[side], level, label))
    lines = list(dict.fromkeys(lines))  # an event has several edges at one level
    levels = values.evaluate({f"level_{k}": level for k, (_, _, level, _) in enumerate(lines)}) if lines else {}
    return [
        GuardLine(mode, state, float(level), label)
        for (mode, state, _, label), level in zip(lines, levels.values(), strict=True)
    ]
