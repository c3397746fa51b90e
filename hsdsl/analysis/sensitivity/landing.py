"""Guards that a start or a transition leads onto: executions from nearby that begin beyond one part from the run.

To first order a surface is moved by its derivative through states, time and parameters. Where that is not zero, the
executions on one side begin beyond the guard: no derivative exists from there on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Transition
from hsdsl.engine.simulate.input_segments import make_timeline
from hsdsl.engine.simulate.surfaces import ROUNDOFF_UNITS
from hsdsl.engine.simulate.verdict.run_view import Place, RunView

Row = Mapping[str, Any]  # a derivative by each target


def landing(run: RunView, made: Transition) -> Place:
    """Where a transition leads, of a run that may have further states than its modes."""
    state = made.after or made.before
    mode = run.problem.program.modes[run.index(made.target)]
    return run.place(made.target, made.time, tuple(state[x] for x in mode.states))


def parted(
    run: RunView,
    place: Place,
    time: Row,
    state: Mapping[str, Row],
    parameters: Mapping[str, Sequence[Number]],
    sizes: Mapping[str, Row] | None = None,
    crossing: bool = False,
) -> Iterator[str]:
    """The surfaces that part executions near a place where a run begins or goes on, and what moves them there.

    ``time`` and ``state`` are the derivatives of the place's time and states, ``parameters`` those of all parameters by
    each target, ``sizes`` the largest that those of the states have been. With ``crossing`` a surface that is crossed
    at once counts too.
    """
    for k in place.mode.surfaces:
        try:
            if _begins_on(place, k, crossing):
                for by, slopes in parameters.items():
                    had = [sizes[x][by] if sizes else 0.0 for x in place.mode.states]
                    if not _moves(run, place, k, time[by], [state[x][by] for x in place.mode.states], had, slopes):
                        continue
                    yield f"the surface of {place.name(k)}, and from nearby, moved by {by}, beyond it or not"
                    return
        except DOMAIN_ERRORS:
            continue


def _begins_on(place: Place, k: int, crossing: bool) -> bool:
    """Whether a state is on a surface, one that it does not cross at once unless ``crossing``."""
    if abs(place.value(k)) > place.roundoff_bound(k):
        return False
    if not crossing and place.rate(k) > place.rate_roundoff(k):
        return False
    return k >= len(place.mode.edges) or bool(place.kernel.conditions[k](place.t, *place.x)[0])


def _moves(
    run: RunView,
    place: Place,
    k: int,
    time: Number,
    state: Sequence[Number],
    had: Sequence[Number],
    slopes: Sequence[Number],
) -> bool:
    """Whether a surface has a derivative by a target that is not round-off, of differences or of the derivatives."""
    columns: list[Number] = [time, *state]
    values: list[Number] = [place.t, *place.x, *run.problem.timeline.at(place.t).data[: len(slopes)]]
    largest: Number = max(abs(v) for v in (*columns, *slopes))
    if not largest > 0:
        return False
    step = run.arithmetic.sqrt(run.arithmetic.unit) * (max(abs(v) for v in values) or largest) / largest
    ends: list[Number] = []
    for way in (step, -step):
        moved = [a + way * s for a, s in zip(values, (*columns, *slopes), strict=True)]
        t, x, data = moved[0], moved[1 : len(columns)], data_at(run, moved[len(columns) :], moved[0])
        ends.append(run.problem.kernel.bind(run.index(place.mode.name), data).surfaces(t, *x)[k])
    slope = (ends[0] - ends[1]) / (2 * step)
    gradient, flow = place.kernel.gradients[k](place.t, *place.x), (0, *place.kernel.flow(place.t, *place.x))
    terms = [abs(g) * (abs(s) + abs(f * time)) for g, s, f in zip(gradient, columns, flow, strict=True)]
    through = abs(slope - sum(g * s for g, s in zip(gradient, columns, strict=True)))
    noise = [
        ROUNDOFF_UNITS * run.arithmetic.unit * size + f * abs(time)
        for size, f in zip(had, place.flow_roundoff(), strict=True)
    ]
    least = run.arithmetic.sqrt(run.arithmetic.sqrt(run.arithmetic.unit)) * max(*terms, through)
    least = max(least, sum(abs(g) * n for g, n in zip(gradient[1:], noise, strict=True)))
    return abs(slope) > least and abs(slope) * step > place.roundoff_bound(k)


def data_at(run: RunView, parameters: Sequence[Number], t: Number) -> Sequence[Number]:
    """Other parameters at a time, with the inputs that follow from them."""
    program, timeline = run.problem.program, run.problem.timeline
    if any(given.times is None for given in program.inputs):
        timeline = make_timeline(program, run.problem.kernel, parameters, run.problem.settings.until)
    return (*parameters, *timeline.at(t).data[len(parameters) :])
