"""Guards that a transition leads onto: executions from nearby that begin beyond one part from the run.

To first order a surface is moved by its derivative through states, time and parameters. Where that is not zero, the
executions on one side begin beyond the guard: no derivative exists from there on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Transition
from hsdsl.simulate.input_segments import make_timeline
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.place import Place
from hsdsl.simulate.verdict.run_view import RunView

Row = Mapping[str, Any]  # a derivative by each target


def parted(
    run: RunView, made: Transition, time: Row, state: Mapping[str, Row], parameters: Mapping[str, Sequence[Number]]
) -> Iterator[tuple[Number, str]]:
    """The time and the reason where the landing of a transition parts nearby executions.

    ``run`` may have further states than its modes. ``time`` and ``state`` are the derivatives of the landing's time and
    states, ``parameters`` those of all parameters by each target.
    """
    state_there = made.after or made.before
    mode = run.problem.program.modes[run.index(made.target)]
    place = run.place(made.target, made.time, tuple(state_there[x] for x in mode.states))
    for k in range(len(place.mode.edges) + len(place.mode.walls)):
        try:
            if _begins_on(place, k):
                moved = (by for by, slopes in parameters.items() if _moves(run, place, k, time[by], state, by, slopes))
                for by in moved:
                    where = f"at t = {show(place.t)} {made.edge} leads onto the surface of {place.name(k)}"
                    yield place.t, f"{where}, and from nearby, moved by {by}, beyond it or not"
                    return
        except DOMAIN_ERRORS:
            continue


def _begins_on(place: Place, k: int) -> bool:
    """Whether a state is on a surface that it does not cross at once."""
    if abs(place.value(k)) > place.roundoff_bound(k) or place.rate(k) > place.rate_roundoff(k):
        return False
    return k >= len(place.mode.edges) or bool(place.kernel.conditions[k](place.t, *place.x)[0])


def _moves(
    run: RunView, place: Place, k: int, time: Number, state: Mapping[str, Row], by: str, slopes: Sequence[Number]
) -> bool:
    """Whether a surface has a derivative by a target that is not round-off of differences."""
    columns: list[Number] = [time, *(state[x][by] for x in place.mode.states)]
    values: list[Number] = [place.t, *place.x, *run.problem.timeline.at(place.t).data[: len(slopes)]]
    largest: Number = max(abs(v) for v in (*columns, *slopes))
    if not largest > 0:
        return False
    step = run.arithmetic.sqrt(run.arithmetic.unit) * (max(abs(v) for v in values) or largest) / largest
    ends: list[Number] = []
    for way in (step, -step):
        moved = [a + way * s for a, s in zip(values, (*columns, *slopes), strict=True)]
        t, x, data = moved[0], moved[1 : len(columns)], _data(run, moved[len(columns) :], moved[0])
        ends.append(run.problem.kernel.bind(run.index(place.mode.name), data).surfaces(t, *x)[k])
    slope = (ends[0] - ends[1]) / (2 * step)
    gradient, flow = place.kernel.gradients[k](place.t, *place.x), (0, *place.kernel.flow(place.t, *place.x))
    terms = [abs(g) * (abs(s) + abs(f * time)) for g, s, f in zip(gradient, columns, flow, strict=True)]
    through = abs(slope - sum(g * s for g, s in zip(gradient, columns, strict=True)))
    least = run.arithmetic.sqrt(run.arithmetic.sqrt(run.arithmetic.unit)) * max(*terms, through)
    return abs(slope) > least and abs(slope) * step > place.roundoff_bound(k)


def _data(run: RunView, parameters: Sequence[Number], t: Number) -> Sequence[Number]:
    """Other parameters, with the inputs that follow from them."""
    program, timeline = run.problem.program, run.problem.timeline
    if any(given.times is None for given in program.inputs):
        timeline = make_timeline(program, run.problem.kernel, parameters, run.problem.settings.until)
    return (*parameters, *timeline.at(t).data[len(parameters) :])
