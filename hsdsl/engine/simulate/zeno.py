"""Zeno tails, which their limit replaces or at which a run stops (M10, M11).

A *tail* is transitions that follow each other ever faster. Flights T_n of one edge that leads back to its own mode
shrink by the ratio q at least; what is left is then at most T_n q/(1 - q). Once that is below the relaxation the state
is taken to the limit, where it rests. Edges may take turns, as those of a body that bounces on one that bounces. The
state is taken to the limit of all of them once as many transitions as cost no time have fallen within the relaxation,
if pushes take back within that what is left. Where the state would meet another guard until a tail ends, it is taken to
the limit at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.execution import Stop, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.contact import (
    contact_at,
    fixed_point,
    in_contact,
    in_touch,
    in_turn,
    is_possible,
    keeping,
    keeps,
    limit,
    onto_guard,
    pressing,
    reset_but_counts,
)
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.stops import FREE
from hsdsl.engine.simulate.surfaces import Surfaces

LEAST_FLIGHTS = 3
LAST_TIES = 4  # what is tied with the flight of an event that is as short may keep it from being armed again
Stage = tuple[ModeState, int]


def contraction(made: Sequence[Transition], of_flow: bool = False) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of two in a row, of rounds or of one edge, if they shrink."""
    return shrinking(round_flights(made) or last_flights(made, of_flow))


def shrinking(flights: Sequence[Number]) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of some in a row, if they shrink; else None."""
    if not flights or not min(flights) > 0:
        return None
    ratio = max(b / a for a, b in pairwise(flights))
    return (flights[-1], ratio) if ratio < 1 else None


def period(made: Sequence[Transition]) -> int:
    """After how many transitions those of the last few rounds repeat; 0 where they do not, on entry or in strips."""
    for n in range(1, (FREE - 1) // LEAST_FLIGHTS + 1):
        last = made[-LEAST_FLIGHTS * n - 1 :]
        if len(last) <= LEAST_FLIGHTS * n:
            return 0
        if all(a.edge == b.edge and a.source == b.source for a, b in zip(last, last[n:], strict=False)):
            return 0 if any(one.entry or one.resumed != one.time for one in last) else n
    return 0


def round_flights(made: Sequence[Transition]) -> list[Number]:
    """How long the last few rounds lasted, in order; none where there is no :func:`period`."""
    n = period(made)
    times = [one.time for one in made[-LEAST_FLIGHTS * n - 1 :: n]] if n else []
    return [b - a for a, b in pairwise(times)]


def last_flights(made: Sequence[Transition], of_flow: bool = False) -> list[Number]:
    """The last few flights between transitions of the last edge, in order; none where they are not as many.

    That is the last one that was reached: what it set off is no edge of a tail. Other edges that lead back to the same
    mode may fire meanwhile, also as entries; :data:`FREE` transitions are looked at. Where they are ``of_flow`` time in
    strips does not count.
    """
    times: list[Number] = []
    waited = made[-1].time * 0
    last = next((one for one in reversed(made[-FREE:]) if not one.entry), made[-1])
    for one in reversed(made[-FREE:]):
        if one.source != last.source or one.source != one.target or (one.entry and one.edge == last.edge):
            break
        if of_flow and times and one.resumed is not None:
            waited = waited + (one.resumed - one.time)
        if one.edge == last.edge:
            times.append(one.time + waited)
        if len(times) > LEAST_FLIGHTS:
            break
    return [a - b for a, b in pairwise(times)][::-1] if len(times) > LEAST_FLIGHTS else []


def flown(made: Sequence[Transition], t: Number) -> Number:
    """The time of flow since the first of some transitions, without that in strips."""
    found = t - made[0].time
    for one in made:
        found = found - (one.resumed - one.time if one.resumed is not None else 0)
    return found


def unresolved(run: Run, here: ModeState, k: int) -> Stop | None:
    """Stop at the end of a tail of edge k without a limit, where what is left of it is shorter than time can tell.

    Events might not be armed again there: they stop before. The relaxed scheme goes on with all others.
    """
    edge, t = here.mode.edges[k], here.t
    if empties(here, k):
        return None
    if run.settings.scheme == "located":
        follows = edge.contact is not None and run.settings.completion != "none"
        found = None if follows else contraction(run.recorder.transitions)
        ends = found is not None and found[0] * found[1] <= run.tie(t) * (1 - found[1])
        if edge.of_event and not ends and t == run.recorder.transitions[-1].resumed:
            found = contraction(run.recorder.transitions, of_flow=True)
            ends = found is not None and found[0] * found[1] <= LAST_TIES * run.tie(t)
    else:
        flights = last_flights(run.recorder.transitions, of_flow=True) if edge.of_event else []
        ends = bool(flights) and max(flights) <= run.tie(t)
    return run.diagnostics.accumulates(edge.name, t, t) if ends else None


def empties(here: ModeState, k: int) -> bool:
    """Whether edge k makes executions that wait: they end, however close together they are."""
    changes = here.mode.edges[k].changes
    return any(queue.waiting in changes and queue.values[0] not in changes for queue in here.mode.queues)


def nearly_over(run: Run, here: ModeState, k: int) -> tuple[list[int], Number] | None:
    """Return the edges of a tail that ends within the relaxation, and a bound of what is left of it; else None."""
    made = run.recorder.transitions[-FREE:]
    relaxation = run.settings.relaxation
    if found := contraction(made):
        flight, ratio = found
        left = flight * ratio / (1 - ratio)
        return ([k], left) if left <= relaxation else None
    left = flown(made, here.t)
    if len(made) < FREE or left > relaxation:
        return None
    edges = of_contacts(run, here, made)
    return (edges, left) if len(edges) > 1 else None


def of_contacts(run: Run, here: ModeState, made: Sequence[Transition]) -> list[int]:
    """The edges of some transitions, where each leads back to the present mode and its guard can hold a state."""
    own = {edge.name: j for j, edge in enumerate(here.mode.edges) if edge.contact is not None}
    mode = here.mode.name
    if run.settings.completion == "none":
        return []
    if not all(one.source == one.target == mode and one.edge in own and not one.entry for one in made):
        return []
    return sorted({own[one.edge] for one in made})


def close_tail(run: Run, here: ModeState, k: int) -> ModeState | Stop:
    """Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on.

    What its last transition set off has no limit.
    """
    made = run.recorder.transitions
    found = nearly_over(run, here, k)
    if found is None or empties(here, k) or here.mode.states != here.arc.states:
        return here
    edges, left = found
    end = min(here.t + left, here.segment.end)
    instant = len(edges) > 1 and end == here.t
    if not (end > here.t or instant):
        return here
    edge = here.mode.edges[k]
    try:
        held = contact_at(run, here)
        if isinstance(held, Stop):
            return held
        touched = in_touch(here, held)
        if all(j in touched for j in edges):
            return here
        q = limit_of(run, here, touched, edges, end)
        if q is not None and meets_another(here, here.moved(end, q), edges):
            end, q = here.t, limit_of(run, here, touched, edges, here.t)
        if q is None or not all(keeps(run, there := here.moved(end, q), j) for j in edges):
            return here
        if edge.contact is None or run.settings.completion == "none" or made[-1].entry:
            possible = is_possible(run, here, k, end, q, touched)
            return run.diagnostics.accumulates(edge.name, end, here.t) if possible else here
        if keeping(run, there, edges) != edges:
            return here
        if not instant and not {*edges} & {*(pressing(run, there, sorted({*touched, *edges})) or ())}:
            return here
        if meets_another(here, there, edges):
            return here
    except DOMAIN_ERRORS:
        return here
    for j in edges:
        run.diagnostics.replaced(here.mode.edges[j], len(made) - 1, end, left)
    if end > here.t:
        here.arc.append(end, q, (tuple(b - a for a, b in zip(here.x, q, strict=True)),))
    rest = run.place(here.index, here.mode.states, end, q, here.surfaces.scale)
    rest.surfaces.enter(end, q, rest.kernel.surfaces(end, *q))
    rest.surfaces.active.update(edges)
    return rest


def at_limit(run: Run, here: ModeState) -> Stop | None:
    """Stop at the limit of a tail of edges that take turns, which is nearly over: no motion is known to go on there.

    A round leads through all of them, through other modes with the same states, too: the limit is on all their guards.
    """
    made = run.recorder.transitions
    found, turns = contraction(made), period(made)
    if found is None or turns < 2:
        return None
    left = found[0] * found[1] / (1 - found[1])
    end = here.t + left
    if not left <= run.settings.relaxation or not end < here.segment.end:
        return None
    stages = stages_of(run, here, made[-turns:])
    if stages is None:
        return None
    try:
        q = end_of_rounds(run, here, stages, made, left / found[0], end)
    except DOMAIN_ERRORS:
        return None
    if q is None:
        return None
    if end > here.t:
        here.arc.append(end, q, (tuple(b - a for a, b in zip(here.x, q, strict=True)),))
    run.diagnostics.turns.extend(one.edge for one in made[-len(stages) :])
    return run.diagnostics.takes_turns(here.mode.states, q, end)


def stages_of(run: Run, here: ModeState, made: Sequence[Transition]) -> list[Stage] | None:
    """The modes of a round, as places of the run, with their edges.

    None where states differ, for an event, and where a guard can hold the state.
    """
    numbers = {mode.name: i for i, mode in enumerate(run.program.modes)}
    stages, follows = list[Stage](), run.settings.completion != "none"
    for one in made:
        number = numbers[one.source]
        mode, kernel = run.program.modes[number], run.kernel.bind(number, here.segment.data)
        surfaces = Surfaces(kernel, mode.edges, here.surfaces.scale, run.arithmetic)
        stage = replace(here, index=number, flow=number, mode=mode, kernel=kernel, surfaces=surfaces)
        k = next(j for j, edge in enumerate(mode.edges) if edge.name == one.edge)
        if mode.states != here.arc.states or mode.edges[k].of_event:
            return None
        if mode.edges[k].contact is not None and follows:
            return None
        stages.append((stage, k))
    return stages


def end_of_rounds(
    run: Run, here: ModeState, stages: list[Stage], made: Sequence[Transition], share: Number, end: Number
) -> State | None:
    """The point that rounds run to: on all guards, and no further than the flow leads within the relaxation.

    What is left of the tail has this ``share`` of each flight of the last round.
    """

    def around(t: Number, x: State) -> State:
        for stage, k in stages:
            x = reset_but_counts(run, stage, k, t, onto_guard(stage, k, t, x))
        return x

    point = q = limit(partial(around, here.t), here.x)
    far: State = tuple(map(abs, here.kernel.flow(here.t, *here.x)))
    for i, (stage, k) in enumerate(stages, -len(stages)):
        slope, h = stage.kernel.flow(here.t, *point), share * (made[i].time - made[i - 1].time)
        far = tuple(max(a, abs(f)) for a, f in zip(far, slope, strict=True))
        q = reset_but_counts(run, stage, k, here.t, tuple(a + h * f for a, f in zip(q, slope, strict=True)))
        point = reset_but_counts(run, stage, k, here.t, point)
    q = point = limit(partial(around, end), q)
    for stage, k in stages:
        if not abs(stage.kernel.surfaces(end, *point)[k]) <= stage.surfaces.roundoff_bound(k, end, point, entry=True):
            return None
        point = reset_but_counts(run, stage, k, end, point)
    noise = ROUNDOFF_UNITS * run.arithmetic.unit
    reach = (run.settings.relaxation * f + noise * s for f, s in zip(far, here.sizes, strict=True))
    return q if all(abs(a - b) <= most for a, b, most in zip(q, here.x, reach, strict=True)) else None


def limit_of(run: Run, here: ModeState, touched: list[int], edges: list[int], end: Number) -> State | None:
    """The point that a tail runs to: kept by resets, moved along the guards to its end, and kept by resets there."""
    kept, along = partial(fixed_point, run, here), here.mode.edges[edges[0]].contact is not None
    if along and not is_near(run, here, edges):
        return None
    q = in_turn(kept, edges, here.t, here.x)
    if along:
        flow, h = in_contact(run, here, sorted({*touched, *edges})).kernel.flow, end - here.t
        slope = flow(here.t, *q)
        turned = flow(end, *(a + h * f for a, f in zip(q, slope, strict=True)))
        q = tuple(a + h * (f + g) / 2 for a, f, g in zip(q, slope, turned, strict=True))
        q = in_turn(partial(onto_guard, here), edges, end, q)
    q = in_turn(kept, edges, end, q)
    bound = here.surfaces.roundoff_bound
    on = all(abs(here.kernel.surfaces(end, *q)[k]) <= bound(k, end, q, entry=True) for k in edges)
    return q if on else None


def is_near(run: Run, here: ModeState, edges: list[int]) -> bool:
    """Whether what edges take back, each of its guard or of the rate of that, is no more than pushes make in a while.

    The while is the relaxation: so near is the limit.
    """
    t, x = here.t, here.x
    values, sizes = here.kernel.surfaces(t, *x), in_contact(run, here, (), edges).kernel.magnitudes(t, *x)
    last = {k: values[k] if here.mode.edges[k].push_order == 1 else here.kernel.rates[k](t, *x)[0] for k in edges}
    return all(abs(last[k]) <= run.settings.relaxation * sizes[k] for k in edges)


def meets_another(here: ModeState, there: ModeState, edges: list[int]) -> bool:
    """Whether a surface other than those of edges is passed on the way to a limit."""
    surfaces = here.surfaces
    before, after = here.kernel.surfaces(here.t, *here.x), here.kernel.surfaces(there.t, *there.x)
    for j, (one, two) in enumerate(zip(before, after, strict=True)):
        rises = two > surfaces.roundoff_bound(j, there.t, there.x) and not one > surfaces.roundoff_bound(
            j, here.t, here.x
        )
        if j not in edges and rises:
            return True
    return False
