# pyright: basic, reportArgumentType=false, reportAttributeAccessIssue=false, reportOperatorIssue=false, reportAssignmentType=false, reportIncompatibleMethodOverride=false, reportCallIssue=false
"""HybridSystem -> Program: every expression becomes a straight-line routine over numbered states, parameters and time.

The pipeline is in :func:`lower`. `program.ModeProgram` lists the routines. `switches` takes out what jumps with time,
`constants` has numbered names and the routines of parameters alone, `mode` those of a mode with bounds on round-off and
an order of elimination for implicit steps, `slopes` those that only exports need. `straight` writes each by `printer`,
in steps that are small, and `tape` the operations for Taylor coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from hsdsl.base import limits
from hsdsl.base.errors import TOO_LONG, Diagnostic, ModelError
from hsdsl.language.expression.scope import slope_symbol
from hsdsl.language.expression.timebox import OutOfTime, deep_stack, timebox
from hsdsl.language.system import HybridSystem, SampledInput
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
from hsdsl.mathematics.lower.straight import print_routines
from hsdsl.mathematics.lower.switches import switch_programs, switch_routines, with_switches

__all__ = ["in_turn", "lower", "lower_constants", "lower_expressions"]

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
