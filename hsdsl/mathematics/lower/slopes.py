# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""Derivatives of flows and outputs by states and inputs, which exports offer and no simulation needs."""

from __future__ import annotations

from typing import NamedTuple

import sympy as sp

from hsdsl.language.expression.timebox import deep_stack
from hsdsl.language.system import TIME, HybridSystem
from hsdsl.mathematics.completion import constrained_modes
from hsdsl.mathematics.lower.constants import number
from hsdsl.mathematics.lower.mode import LoweredMode, lowered_constrained
from hsdsl.mathematics.lower.straight import Definition, Gradient, print_routines
from hsdsl.mathematics.lower.switches import with_switches
from hsdsl.mathematics.program import Routines


class Slopes(NamedTuple):
    """The slopes of a mode that are not zero everywhere, of the routine ``slopes``.

    ``places`` has for each its row and column: rows are the flow of each state, then the outputs, columns the states,
    then the sampled inputs. ``uses`` has for each row, and for each surface behind them, the columns that it depends
    on; behind those of slopes are time and the parameters.
    """

    routines: Routines
    places: tuple[tuple[int, int], ...]
    uses: tuple[frozenset[int], ...]


def lower_slopes(system: HybridSystem) -> tuple[Slopes, ...]:
    """The slopes of each mode, then of those with motion along guards: in the order of `Program.flows`."""
    with deep_stack():
        whole, switches = with_switches(system)
        names = number(whole, switches.symbols)
        held = (lowered_constrained(found, names) for found in constrained_modes(whole) if found)
        flows = (*(LoweredMode(mode, names) for mode in whole.modes), *held)
        return tuple(map(_slopes, flows))


def _slopes(mode: LoweredMode) -> Slopes:
    given = [k for k, output in enumerate(mode.mode.outputs) if output is not None]
    outputs = mode.place(mode.mode.outputs[k] for k in given)
    rows = [*range(len(mode.flow)), *(len(mode.flow) + k for k in given)]
    columns = (*mode.states, *mode.names.inputs)
    slopes = Gradient((*mode.flow, *outputs), columns)
    order = {symbol: i for i, symbol in enumerate(columns)}
    places = [(row, order[symbol]) for row, sparse in zip(rows, slopes.sparse, strict=True) for symbol in sparse]
    values = tuple(slope for sparse in slopes.sparse for slope in sparse.values())
    definition = Definition("slopes", (TIME, *mode.states), values, slopes.statements)
    routines = print_routines((definition,), mode.names.data)
    return Slopes(routines, tuple(places), _uses(mode, dict(zip(given, outputs, strict=True)), order))


def _uses(mode: LoweredMode, outputs: dict[int, sp.Basic], order: dict[sp.Symbol, int]) -> tuple[frozenset[int], ...]:
    """The columns that flows, outputs and surfaces depend on; an output that a mode does not have has none."""
    places = order | {name: k for k, name in enumerate((TIME, *mode.names.parameters), len(order))}
    every = (outputs.get(k, sp.S.Zero) for k in range(len(mode.mode.outputs)))
    return tuple(
        frozenset(places[name] for name in expr.free_symbols & places.keys())
        for expr in (*mode.flow, *every, *mode.residuals)
    )


def lower_given(system: HybridSystem) -> Routines:
    """Routines ``given_i`` of time: the expression of input i, where it may be driven from outside."""
    with deep_stack():
        whole, switches = with_switches(system)
        names = number(whole, switches.symbols)
        placed = ((i, given.given) for i, given in enumerate(whole.inputs) if given.given is not None)
        definitions = [Definition(f"given_{i}", (TIME,), (expr.xreplace(names.shared),)) for i, expr in placed]
        return print_routines(definitions, names.data)
