"""Notes and stops of the compiled loop, in the Python loop's own words.

Loaded when there is something to say: most runs end at `until` without any.
"""

from __future__ import annotations

from hsdsl.engine.execution import Stop
from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate import stops
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stalls import Standstill
from hsdsl.engine.simulate.stops import Diagnostics, slides
from hsdsl.engine.simulate.surfaces import StepFailure
from hsdsl.engine.simulate.workspace import Workspace
from hsdsl.mathematics.program import Program

Note = tuple[int, int, int, int, float, float]  # as in `hs_note`


def add_note(diagnostics: Diagnostics, program: Program, note: Note) -> Stop | None:
    """Add what the loop has noted; returns a stop where that ends the run."""
    notice, index, k, count, time, other = note
    mode, kind = program.modes[index], structures.NOTICES[notice]
    if kind == "unsettled":
        return diagnostics.unsettled(mode.name, k, time)
    if kind == "crowded":
        return diagnostics.crowded(time)
    if kind == "in contact":
        return diagnostics.in_contact(mode.edges[k].name, time, other, bool(count))
    if kind == "replaced":
        return diagnostics.replaced(mode.edges[k], count, time, other)
    if kind == "slides":
        return slides(program.modes[count].edges[k].name, program.modes[count], mode, time)
    if kind == "takes turn":
        return diagnostics.turns.append(mode.edges[k].name)
    if kind == "coupled":
        return diagnostics.coupled(mode.edges[k].name, time)
    return diagnostics.accumulates(mode.edges[k].name, time, other)


def stop(problem: Problem, workspace: Workspace, reason: str, diagnostics: Diagnostics) -> Stop:
    """Say why a run stopped."""
    found = workspace.task.stop
    number, t = int(found.mode), found.time
    mode, segment = problem.program.modes[number], problem.timeline.segments[int(found.segment)]
    if reason in ("until in strip", "until on guard"):
        return stops.reached_in_strip(t, mode.edges[int(found.edge)].name, reason == "until on guard")
    if reason == "reset not finite":
        return stops.reset_not_finite(mode.edges[int(found.edge)], t)
    if reason == "zeno":
        return stops.endless(mode.name, t)
    if reason == "waiting":
        return stops.too_many_wait(mode, mode.queues[int(found.edge)].name, t)
    if reason == "limit":
        return stops.limit(problem.settings.max_transitions, t)
    if reason in ("entered outside", "left"):
        return stops.left_domain(mode, found.surface, t, stops.LEFT if reason == "left" else stops.ENTERED)
    x, slope, scales = (column[: found.dimension].tolist() for column in workspace.stopped)
    if reason == "accumulated":
        return diagnostics.takes_turns(mode.states, tuple(x), t)
    here = Standstill(problem, number, segment, t, tuple(x), scales, found.h)
    if reason == "here not finite":
        return here.not_finite([(t, here.x)])
    if reason == "step not finite":
        return here.not_finite([(t, here.x), (found.h, tuple(slope))])
    assert reason == "stuck", reason
    surface = None if found.surface < 0 else int(found.surface)
    return here.stuck(StepFailure(structures.FAILURES[int(found.failure)], surface), tuple(slope))
