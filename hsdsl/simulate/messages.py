"""What the compiled loop says of a run, in the Python loop's own words: its notes, and why it stopped.

Loaded when there is something to say: most runs end at `until` without any.
"""

from __future__ import annotations

from hsdsl.execution import Stop
from hsdsl.runtime import structures
from hsdsl.simulate import diagnostics, stops
from hsdsl.simulate.diagnosis import not_finite
from hsdsl.simulate.entry import LEFT, left_domain
from hsdsl.simulate.located import FREE
from hsdsl.simulate.recorder import OpenArc
from hsdsl.simulate.relaxed import no_way_on
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.surfaces import StepFailure, Surfaces
from hsdsl.simulate.workspace import Workspace


def told(run: Run, number: int, index: int, k: int, count: int, time: float, other: float) -> Stop | None:
    """Say what the loop has noted; returns a stop where that ends the run."""
    recorder, mode, kind = run.recorder, run.program.modes[index], structures.NOTICES[number]
    if kind == "unsettled":
        diagnostics.unsettled(recorder, mode.name, k, time)
    elif kind == "crowded":
        diagnostics.crowded(recorder, FREE, time)
    elif kind == "at rest":
        diagnostics.at_rest(recorder, mode.edges[k].name, time, other)
    elif kind == "replaced":
        diagnostics.replaced(recorder, mode.edges[k].name, count, time, other)
    elif kind == "slides":
        source = run.program.modes[count]
        return diagnostics.slides(source.edges[k].name, source.name, mode.name, time)
    else:
        return diagnostics.accumulates(recorder, mode.edges[k].name, time, other)
    return None


def stop(run: Run, workspace: Workspace, reason: str, made: int) -> Stop:
    """Say why a run stopped, after so many transitions."""
    found = workspace.task.stop
    t, mode = found.time, run.program.modes[int(found.mode)]
    if reason in ("until in strip", "until on guard"):
        return stops.reached_in_strip(t, mode.edges[int(found.edge)].name, reason == "until on guard")
    if reason == "reset not finite":
        return stops.reset_not_finite(mode.edges[int(found.edge)], t)
    if reason == "zeno":
        return stops.endless(mode.name, t)
    if reason == "limit":
        return stops.limit(run.settings.max_transitions, t)
    here = _here(run, workspace, made)
    if reason == "here not finite":
        return not_finite(run, here, t, [(t, here.x)])
    if reason == "entered outside":
        return left_domain(here, found.surface, t, "was entered outside it")
    if reason == "left":
        return left_domain(here, found.surface, t, LEFT)
    slope = workspace.slope(found.dimension)
    if reason == "step not finite":
        return not_finite(run, here, t, [(t, here.x), (found.h, slope)])
    assert reason == "stuck", reason
    run.control.h = found.h
    surface = None if found.surface < 0 else found.surface
    return no_way_on(run, here, StepFailure(structures.FAILURES[int(found.failure)], surface), slope)


def _here(run: Run, workspace: Workspace, made: int) -> ModeState:
    """Where the run stopped, as the Python loop would have it."""
    found = workspace.task.stop
    mode, segment = run.program.modes[int(found.mode)], run.timeline.segments[int(found.segment)]
    x, t = workspace.x(found.dimension), found.time
    kernel = run.kernel.bind(found.mode, segment.data)
    surfaces = Surfaces(kernel, mode.edges, tuple(0.0 for _ in x), run.arithmetic)
    arc = OpenArc(mode.name, mode.states, "flow", made, None, [t], [x], [], scales=workspace.scales(len(x)))
    return ModeState(mode, kernel, surfaces, segment, arc, t, x)
