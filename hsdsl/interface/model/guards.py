# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Guards that are levels of one state (``x >= x_max``): where a plot draws a dotted line."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import reduce
from typing import Any

import numpy as np
import sympy as sp

from hsdsl.analysis.plot import GuardLine
from hsdsl.base.functions import FUNCTIONS
from hsdsl.base.names import without_memory
from hsdsl.engine.execution import Array
from hsdsl.engine.preparation.values import Values
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import TIME

_OWN: dict[str, Callable[..., Any]] = {  # functions of the language that SymPy's printer for NumPy does not know
    "abs": np.abs,
    "sign": np.sign,
    "floor": np.floor,
    "min": lambda *values: reduce(np.minimum, values),
    "max": lambda *values: reduce(np.maximum, values),
    "select": lambda number, bound, a, b: np.where(np.asarray(number) < bound, a, b),
}
NUMPY = {str(getattr(FUNCTIONS[name][0], "__name__", name)): function for name, function in _OWN.items()}


def guard_lines(values: Values) -> list[GuardLine]:
    """Return the level of every guard and wall that compares one state with parameters, and with time."""
    system = values.system
    parameters = set(system.parameter_symbols)
    lines: list[tuple[str, str, sp.Expr, str]] = []
    for mode in system.modes:
        states = {symbol(name): name for name in without_memory(mode.states)}
        labelled = [(edge.surface, (*edge.of_event, edge.name)[0]) for edge in mode.edges]
        labelled += [(wall, wall.text) for wall in mode.walls]
        for surface, label in labelled:
            for side, level in ((surface.left, surface.right), (surface.right, surface.left)):
                if isinstance(side, sp.Symbol) and side in states and level.free_symbols <= parameters | {TIME}:
                    lines.append((mode.name, states[side], level, label))
    lines = list(dict.fromkeys(lines))  # an event has several edges at one level
    fixed = [line for line in lines if TIME not in line[2].free_symbols]
    levels = values.evaluate({f"level_{k}": level for k, (_, _, level, _) in enumerate(fixed)}) if fixed else {}
    found = [
        GuardLine(mode, state, float(level), label)
        for (mode, state, _, label), level in zip(fixed, levels.values(), strict=True)
    ]
    moving = (line for line in lines if TIME in line[2].free_symbols)
    return found + [GuardLine(m, s, math.nan, label, _over_time(level, values)) for m, s, level, label in moving]


def _over_time(level: sp.Expr, values: Values) -> Callable[[Array], Array]:
    """The values of a level at times; not-a-number where it has none."""
    names = [*map(symbol, values.program.parameters), TIME]
    function = sp.lambdify(names, level, modules=[NUMPY, "numpy"], dummify=True)
    numbers = [float(number) for number in values.parameters]

    def at(times: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(function(*numbers, times), float), times.shape)

    return at
