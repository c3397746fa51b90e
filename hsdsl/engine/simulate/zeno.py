"""Zeno tails: impacts that follow each other ever faster towards rest on guards are replaced by their limit (M11).

Flights T_n of one edge that leads back to its own mode shrink by the ratio q at least; what is left is then at most
T_n q/(1 - q). Once that is below the relaxation the state is taken to the limit, where it rests. Edges may take turns,
as those of a body that bounces on one that bounces. The state is taken to the limit of all of them once as many
transitions as cost no time have fallen within the relaxation, if pushes take back within that what is left. Where the
state would meet another guard until a tail ends, it is taken to the limit at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import pairwise

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, NOTHING, Number
from hsdsl.engine.execution import Stop, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.contact import (
    after_contact,
    contact_at,
    in_contact,
    in_touch,
    is_possible,
    keeping,
    keeps,
    pressing,
    reset_but_counts,
)
from hsdsl.engine.simulate.diagnostics import FREE
from hsdsl.engine.simulate.root_isolation import total
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surfaces import joined

LEAST_FLIGHTS = 3
LAST_TIES = 4  # what is tied with the flight of an event that is as short may keep it from being armed again
MOST_CORRECTIONS_TO_GUARD = 4  # of a point towards a guard
MOST_ROUNDS = 60  # of acceleration towards a fixed point
MOST_LEAP = 16  # times a step


def contraction(made: Sequence[Transition], of_flow: bool = False) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of the last few of the last edge, if they shrink; else None."""
    flights = last_flights(made, of_flow)
    if not flights or not min(flights) > 0:
        return None
    ratio = max(b / a for a, b in pairwise(flights))
    return (flights[-1], ratio) if ratio < 1 else None


def last_flights(made: Sequence[Transition], of_flow: bool = False) -> list[Number]:
    """The last few flights between transitions of the last edge, in order; none where they are not as many.

    Other edges that lead back to the same mode may fire meanwhile, also as entries; :data:`FREE` transitions are looked
    at. Where they are ``of_flow`` time in strips does not count.
    """
    times: list[Number] = []
    waited = made[-1].time * 0
    for one in reversed(made[-FREE:]):
        if one.source != made[-1].source or one.source != one.target or (one.entry and one.edge == made[-1].edge):
            break
        if of_flow and times and one.resumed is not None:
            waited = waited + (one.resumed - one.time)
        if one.edge == made[-1].edge:
            times.append(one.time + waited)
        if len(times) > LEAST_FLIGHTS:
            break
    return [a - b for a, b in pairwise(times)][::-1] if len(times) > LEAST_FLIGHTS else []


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


def flown(made: Sequence[Transition], t: Number) -> Number:
    """The time of flow since the first of some transitions, without that in strips."""
    found = t - made[0].time
    for one in made:
        found = found - (one.resumed - one.time if one.resumed is not None else 0)
    return found


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
    """Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on."""
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
        if edge.contact is None or run.settings.completion == "none":
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


def held_exactly(
    run: Run, here: ModeState, held: ModeState, t: Number, x: State, reached: Sequence[int] = ()
) -> ModeState:
    """The mode itself again, the state without what steps along its guards were off by: they may hold it again.

    It stays on those that it has ``reached``. It is off them by the round-off of what it has ever been computed from.
    """
    touched, after = in_touch(here, held), after_contact(here, held, t, x)
    scale = tuple(map(joined, after.surfaces.scale, here.arc.scales))
    after = replace(after, surfaces=replace(after.surfaces, scale=scale))
    try:
        q = in_turn(partial(onto_guard, after), sorted({*touched, *reached}), t, x)
        q = in_turn(partial(fixed_point, run, after), touched, t, q)
        return after.moved(t, q) if all(keeps(run, after.moved(t, q), k) for k in touched) else after
    except DOMAIN_ERRORS:
        return after


def in_turn(taken: Callable[[int, Number, State], State], edges: list[int], t: Number, x: State) -> State:
    """The point that a state runs to which several edges, in turn, take to what one of them keeps."""
    if len(edges) == 1:
        return taken(edges[0], t, x)
    return limit(lambda x: reduce(lambda q, k: taken(k, t, q), edges, x), x)


def onto_guard(here: ModeState, k: int, t: Number, x: State) -> State:
    """A point near a guard taken to it, as near as numbers are, each state in proportion to its scale."""
    r = here.kernel.surfaces(t, *x)[k]
    for _ in range(MOST_CORRECTIONS_TO_GUARD):
        gradient = here.kernel.gradients[k](t, *x)[1:]
        weights = [g * s * s for g, s in zip(gradient, here.sizes, strict=True)]
        across = total((g * w for g, w in zip(gradient, weights, strict=True)), r * 0)
        if not across > 0:
            break
        nearer = tuple(a - r / across * w for a, w in zip(x, weights, strict=True))
        left = here.kernel.surfaces(t, *nearer)[k]
        if not abs(left) < abs(r):
            break
        x, r = nearer, left
    return x


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


def fixed_point(run: Run, here: ModeState, k: int, t: Number, x: State) -> State:
    """The point that repeated resets run to."""
    return limit(lambda x: reset_but_counts(run, here, k, t, x), x)


def limit(step: Callable[[State], State], x: State) -> State:
    """The point that repeated steps run to: by Aitken's acceleration of each state, if the step after it is shorter."""
    for _ in range(MOST_ROUNDS):
        one = step(x)
        if one == x:
            break
        two = step(one)
        leap = tuple(map(_accelerated, x, one, two))
        after = step(leap)
        x = after if all(map(_shorter, leap, after, one, two)) else two
        x = tuple(a if abs(a) > NOTHING else a - a for a in x)
    return x


def _accelerated(a: Number, b: Number, c: Number) -> Number:
    bend = c - 2 * b + a
    slow = bend != 0 and abs(c - b) <= abs(b - a) and abs(c - b) <= MOST_LEAP * abs(bend)
    return a - (b - a) / bend * (b - a) if slow else c


def _shorter(a: Number, b: Number, c: Number, d: Number) -> bool:
    return abs(b - a) <= abs(d - c)
