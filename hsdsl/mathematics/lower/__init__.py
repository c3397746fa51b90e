# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""HybridSystem -> Program: every expression becomes a straight-line routine over numbered states, parameters and time.

The pipeline is in :func:`lower`. `program.ModeProgram` lists the routines. `switches` takes out what jumps with time,
`constants` has numbered names and the routines of parameters alone, `mode` those of a mode with bounds on round-off and
an order of elimination for implicit steps. `straight` writes each by `printer`, in steps that are small, and `tape` the
operations for Taylor coefficients. Only exports need :func:`lower_slopes` and :func:`lower_given`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import sympy as sp

from hsdsl.base import limits
from hsdsl.base.errors import TOO_LONG, Diagnostic, ModelError
from hsdsl.language.expression.scope import slope_symbol
from hsdsl.language.expression.timebox import OutOfTime, deep_stack, timebox
from hsdsl.language.system import TIME, HybridSystem, SampledInput
from hsdsl.mathematics import program as lowered
from hsdsl.mathematics.completion import ConstrainedMode, constrained_modes
from hsdsl.mathematics.completion.nearby import slopes_of_inputs
from hsdsl.mathematics.lower.constants import (
    Names,
    constants,
    initial_order,
    initial_values,
    lower_constants,
    lower_expressions,
    number,
    ranges_of,
)
from hsdsl.mathematics.lower.mode import LoweredMode, idle_states, lowered_constrained
from hsdsl.mathematics.lower.straight import Definition, Gradient, print_routines
from hsdsl.mathematics.lower.switches import switch_programs, switch_routines, with_switches

__all__ = ["Slopes", "in_turn", "lower", "lower_constants", "lower_expressions", "lower_given", "lower_slopes"]

Both = Callable[[Callable[[], Any], Callable[[], Any]], tuple[Any, Any]]


def in_turn(first: Callable[[], Any], second: Callable[[], Any]) -> tuple[Any, Any]:
    """Do one thing, then the other."""
    return first(), second()


def lower(system: HybridSystem, both: Both = in_turn) -> lowered.Program:
    """Lower a system; the result needs no SymPy to run. Both halves of the work are done by ``both``.

    Raises ModelError: the symbolic work takes longer than the limits allow.
    """
    try:
        with deep_stack(), timebox(limits.current().seconds):
            return _lower(system, both)
    except OutOfTime:
        message = "deriving and writing out the expressions of this model takes too long"
        hint = "make parts of its expressions states, or allow more time with --limit seconds=600"
        raise ModelError([Diagnostic(TOO_LONG, message, None, hint)]) from None


def _lower(system: HybridSystem, both: Both) -> lowered.Program:
    system, switches = with_switches(system)
    names = number(system, switches.symbols)
    experiment = system.experiment
    indices = {mode.name: i for i, mode in enumerate(system.modes)}
    found = constrained_modes(system)
    modes, contacts = _modes(system, found, names, indices, both)
    completed = [mode for mode in system.modes if mode.slides] + [each.mode for each in found if each]
    followed = [e for mode in completed for e in (*mode.flow, *(s.residual for s in mode.surfaces))]
    sloped = set[sp.Basic]().union(*(e.free_symbols for e in followed)) if slopes_of_inputs(system) else set[sp.Basic]()
    return lowered.Program(
        path=system.path,
        digest=system.digest,
        title=system.title,
        parameters=tuple(p.name for p in system.parameters),
        inputs=tuple(_sampled(i, slope_symbol(i.name) in sloped) for i in system.inputs),
        modes=modes,
        contacts=contacts,
        parts=system.parts,
        outputs=system.outputs,
        units=system.units,
        initial_mode=indices[system.initial.mode],
        initial_states=tuple(name for name, _ in system.initial.values),
        scheme=experiment.scheme,
        method=experiment.method,
        completion=experiment.completion,
        constants=print_routines(constants(system, names), ()),
        switches=switch_programs(switches),
        switching=print_routines(switch_routines(switches, names.shared), names.data),
        scaled_states=tuple(name for name, _ in experiment.scale),
        initial_order=initial_order(system),
        initial_values=print_routines(initial_values(system, names), ()),
        assumptions=system.assumptions,
        ranges=tuple(name for name, _, _ in ranges_of(system)),
    )


def _modes(
    system: HybridSystem, found: Sequence[ConstrainedMode | None], names: Names, indices: dict[str, int], both: Both
):
    """The modes, and those with motion along their guards."""
    modes = [LoweredMode(mode, names) for mode in system.modes]
    every = [*modes, *(lowered_constrained(each, names) for each in found if each)]
    routines, others = both(lambda: [each.routines() for each in every], lambda: [each.others() for each in every])
    programs = [each.program(indices, *pair) for each, *pair in zip(every, routines, others, strict=True)]
    for i, idle in enumerate(idle_states(system)):
        programs[i] = replace(programs[i], idle=idle)
    last = len(modes)
    for i, motion in enumerate(found):
        if motion:
            edges = list(programs[i].edges)
            for k, contact in enumerate(motion.contacts):  # what a run knows of motion along their guards
                branched = contact.near.impact is not None
                known = {"contact": k, "push_order": contact.order, "counts": contact.counts, "branched": branched}
                edges[contact.edge] = replace(edges[contact.edge], **known)
            programs[i] = replace(programs[i], held=last, edges=tuple(edges))
            pairs = zip(programs[last].edges, motion.releases, strict=True)
            edges = tuple(replace(edge, releases=number) for edge, number in pairs)
            programs[last] = replace(programs[last], edges=edges)
            last += 1
    return tuple(programs[: len(modes)]), tuple(programs[len(modes) :])


def _sampled(given: SampledInput, sloped: bool) -> lowered.SampledInput:
    exact = not any(isinstance(v, sp.Basic) for v in given.times + given.values)
    times, values = (given.times, given.values) if exact else (None, None)
    return lowered.SampledInput(given.name, given.hold, times, values, sloped)


class Slopes(NamedTuple):
    """Derivatives of the flow and outputs of a mode by states and inputs: the routine ``slopes`` has those not 0.

    ``places`` has for each its row and column: rows are the flow of each state, then the outputs, columns the states,
    then the sampled inputs. ``uses`` has for each row, and for each surface after them, the columns that it depends
    on; after those of slopes are time and the parameters.
    """

    routines: lowered.Routines
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


def lower_given(system: HybridSystem) -> lowered.Routines:
    """Routines ``given_i`` of time: the expression of input i, where it may be driven from outside."""
    with deep_stack():
        whole, switches = with_switches(system)
        names = number(whole, switches.symbols)
        placed = ((i, given.given) for i, given in enumerate(whole.inputs) if given.given is not None)
        definitions = [Definition(f"given_{i}", (TIME,), (expr.xreplace(names.shared),)) for i, expr in placed]
        return print_routines(definitions, names.data)


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
