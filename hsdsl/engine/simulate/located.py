"""The located scheme: the execution itself, its transitions at the crossings (Burden et al. 2013, Fig. 8, Sec. IV-A).

A step is as long as its error allows (`located_steps`). Every crossing of every surface inside it is isolated on the
surface's own polynomial (`crossings`); the earliest goes, at its own instant, and flow goes on from its reset
(`transitions`). What rises after it is not corrected on the surface. Guards may hold the state (`contact`), and a Zeno
tail is replaced by its limit (`zeno`). A cascade at one instant costs no time, unless more than `FREE` transitions fall
within the relaxation: then each of the others waits in a strip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.scheme.pace import count_step
from hsdsl.engine.simulate.contact import contact_at, held_exactly, in_touch, keeps, past_end
from hsdsl.engine.simulate.control import StepFailure
from hsdsl.engine.simulate.crossings import crossings_along, with_unseen
from hsdsl.engine.simulate.located_steps import SeriesSteps, Span, TableSteps
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.stops import FREE, LEAVES, left_domain, reached, reached_in_strip, slides
from hsdsl.engine.simulate.surfaces import NONE, Arrival, Crossing, joined
from hsdsl.engine.simulate.transitions import Event, choose, comes_back, enter, go_on, reset, sizes, standing_on
from hsdsl.engine.simulate.zeno import at_limit, close_tail, contraction, flown, of_contacts, unresolved


def located(run: Run, here: ModeState | Stop) -> Stop:
    """Follow the execution from ``here`` until it stops."""
    while not isinstance(here, Stop):
        outcome = flow(run, here) if here.t < here.segment.end else here
        if isinstance(outcome, Event):
            here = make_transition(run, here, outcome)
        elif isinstance(outcome, ModeState) and not outcome.t < outcome.segment.end:
            here = at_boundary(run, outcome)
        else:
            here = outcome
    return here


def flow(run: Run, here: ModeState) -> Event | ModeState | Stop:
    """Flow until a surface is crossed or to the segment's end; along a guard that holds the state until it lets go."""
    held = contact_at(run, here)
    if isinstance(held, Stop):
        return held
    if held is here:
        return leads_out(run, here) or follow(run, here, here.segment.end)
    outcome = along_guards(run, here, held)
    still = here.arc.values[-1] == here.x
    for k in in_touch(here, held):
        run.diagnostics.in_contact(here.mode.edges[k].name, here.t, here.arc.times[-1], still)
    return outcome


def leads_out(run: Run, here: ModeState) -> Event | None:
    """The transition where the flow leads out at once, through a guard that the state stands on, to round-off.

    It has stood there since the mode was entered, and reaches the guard at this instant: much round-off in the state is
    no reason to be on a guard. A step would find it at its start; a series takes long, and knows nothing of earlier
    steps.
    """
    method, surfaces, t, x, zero = run.settings.method, here.surfaces, here.t, here.x, run.arithmetic.zero
    if method is None or not method.is_series or not surfaces.active:
        return None
    others = set(range(len(here.mode.edges))) - surfaces.active
    for k in surfaces.standing(t, x, run.tie(t), known=others):
        r, rate = here.kernel.surfaces(t, *x)[k], here.kernel.rates[k](t, *x)[0]
        if abs(r) <= surfaces.roundoff_bound(k, t, x) and -r <= rate * run.tie(t):
            chosen, alternatives = choose(here, [Crossing(k, zero, t, x, zero)], run)
            return Event(chosen, alternatives, t, sizes(x, x, here, stands(here, chosen)))
    return None


def along_guards(run: Run, here: ModeState, held: ModeState) -> Event | ModeState | Stop:
    """Flow along guards until one lets go of the state."""
    while True:
        outcome = follow(run, held, here.segment.end)
        if isinstance(outcome, ModeState):
            return held_exactly(run, here, held, outcome.t, outcome.x)
        if isinstance(outcome, Stop):
            return outcome
        crossing, edges = outcome.crossing, here.mode.edges
        if not held.surfaces.releases(crossing.edge):
            ends = {held.mode.edges[k].name for k in range(len(held.mode.edges)) if held.surfaces.releases(k)}
            x = held_exactly(run, here, held, crossing.time, crossing.state, [crossing.edge]).x
            others = tuple(name for name in outcome.alternatives if name not in ends)
            held_by = tuple(in_touch(here, held))
            return replace(outcome, crossing=replace(crossing, state=x), alternatives=others, held=held_by)
        t, x, ends = crossing.time, crossing.state, True
        if not crossing.edge < len(edges):
            t, x, ends = past_end(run, here, held, crossing.edge, t, x)
        if t > crossing.time:
            here.arc.append(t, x, (tuple(b - a for a, b in zip(crossing.state, x, strict=True)),))
        held.surfaces.leave(t, x)
        if ends:
            after = held_exactly(run, here, held, t, x)
            if t == here.t and crossing.edge < len(edges):  # to round-off it neither holds the state nor lets go
                after.surfaces.active.discard(crossing.edge)
            return run.place(here.index, here.mode.states, t, after.x, outcome.scale, active=after.surfaces.active)
        held = held.moved(t, x)


def follow(run: Run, here: ModeState, limit: Number) -> Event | ModeState | Stop:
    """Step until a surface is crossed, or to a time in the segment."""
    t, x, arc = here.t, here.x, here.arc
    method, before = run.settings.method, None
    steps = SeriesSteps(run, here) if method is not None and method.is_series else TableSteps(run, here)
    while t < limit and not count_step(steps.pace, t):
        span = steps.next(t, x, limit)
        if isinstance(span, StepFailure):
            return stuck(run, here.moved(t, x), span)
        try:
            if event := first_event(run, here, before, span):
                return event
        except DOMAIN_ERRORS:
            return run.standstill(here.moved(t, x)).not_finite([(t, x), (span.t1, span.z)])
        if here.surfaces.active:
            here.surfaces.leave(span.t1, span.z)
        t, x, before = span.t1, span.z, span
        x = run.moved_along(here, t, x, span.h)
        arc.append(t, x, span.piece)
    return stuck(run, here.moved(t, x), StepFailure("slow")) if t < limit else here.moved(t, x)


def first_event(run: Run, here: ModeState, before: Span | None, span: Span) -> Event | Stop | None:
    """Say what happens first along a step: a guard, a wall with no guard on it, or nothing."""
    edges = len(here.mode.edges)
    found = crossings_along(run, here, span)
    walls, guards = [c for c in found if c.edge >= edges], [c for c in found if c.edge < edges]
    wall = min(walls, key=lambda c: c.time, default=None)
    if wall and not any(c.time <= wall.time + run.tie(wall.time) for c in guards):
        standing = here.surfaces.standing(wall.time, wall.state, run.tie(wall.time))
        if not standing:
            write(here, span, wall)
            return left_domain(here.mode, wall.edge, wall.time, LEAVES)
        guards = [Crossing(k, wall.theta, wall.time, wall.state, wall.depth) for k in standing]
    if not guards:
        return None
    guards = with_unseen(run, here, span, guards)
    chosen, alternatives = choose(here, guards, run)
    write(here, span, chosen)
    return Event(chosen, alternatives, chosen.time, largest(here, before, span, chosen))


def largest(here: ModeState, before: Span | None, span: Span, crossing: Crossing) -> State:
    """The sizes of the numbers of a crossing's state: the terms of its step and of the one before."""
    stays = stands(here, crossing)  # off that surface by as much as the state was that it came from
    found = tuple(map(joined, sizes(span.x, crossing.state, here, stays), span.sizes(crossing.theta)))
    if before is not None:
        found = tuple(map(joined, found, before.sizes(before.h * 0 + 1)))
    if here.surfaces.touched:  # it is off the guards that hold it by as much as it has ever been computed from
        found = tuple(map(max, found, here.arc.scales))
    return found


def stands(here: ModeState, crossing: Crossing) -> bool:
    """Whether a crossing's state is on a surface that the state was on that it came from, or one holds it."""
    t, q, surfaces = crossing.time, crossing.state, here.surfaces
    if surfaces.touched or not surfaces.active:
        return bool(surfaces.touched)
    r = here.kernel.surfaces(t, *q)
    return any(k == crossing.edge or abs(r[k]) <= surfaces.roundoff_bound(k, t, q) for k in surfaces.active)


def write(here: ModeState, span: Span, crossing: Crossing) -> None:
    """Record the part of a step that leads to a crossing."""
    if crossing.theta > 0:
        here.arc.append(crossing.time, crossing.state, span.cut(crossing.theta))


def make_transition(run: Run, here: ModeState, event: Event) -> ModeState | Stop:
    """Make a transition, at its own instant or after a strip, and look whether it belongs to a Zeno tail."""
    crossing, until = run.moved_crossing(here, event.crossing), run.settings.until
    t, q, edge = crossing.time, crossing.state, here.mode.edges[crossing.edge]
    if stop := run.limit_reached(t):
        return stop
    outcome, resumed = reset(here, crossing, event.scale, run), t
    if crowded(run, here, crossing):
        run.diagnostics.crowded(t)
        resumed = t + run.settings.relaxation
        if resumed > until + run.tie(until):
            run.wait(here, [(t, run.arithmetic.zero), (until, until - t)], q)
            run.record(here, crossing, None, None, event.alternatives)
            return reached_in_strip(until, edge.name)
        resumed = min(resumed, until)
    if isinstance(outcome, Stop):
        return outcome
    if resumed > t:
        run.wait(here, [(t, run.arithmetic.zero), (resumed, run.settings.relaxation)], q)
    after, scale = outcome
    last = run.recorder.transitions[-1].resumed if run.recorder.transitions else None
    tied = bool(event.alternatives) or (last is not None and t - last <= run.tie(t))
    since = run.tie(t) if tied else run.arithmetic.zero
    flowed = run.has_flowed(t)
    after = run.record(here, crossing, resumed, after, event.alternatives)
    stood = still_on(here, event) if edge.target == here.index else NONE
    arrival = Arrival(since, reset_at=t if resumed > t else None, stood=stood)
    target = edge.target, edge.target_states
    entered = enter(run, *target, resumed, after, scale, here, arrival)
    if isinstance(entered, Stop):
        return entered
    if comes_back(run, flowed, entered):
        return slides(edge.name, here.mode, entered.mode, entered.t)
    if entered.mode is not here.mode:
        return at_limit(run, entered) or entered
    closed = close_tail(run, entered, crossing.edge)
    if isinstance(closed, Stop):
        return closed
    return at_limit(run, closed) or unresolved(run, closed, crossing.edge) or closed


def still_on(here: ModeState, event: Event) -> Mapping[int, Number]:
    """How far off surfaces a transition's state is, of those that hold it or that it was on with no flow since."""
    crossing = event.crossing
    on = here.surfaces.active if crossing.theta == 0 else event.held
    try:
        return here.surfaces.off(crossing.time, crossing.state, on)
    except DOMAIN_ERRORS:
        return NONE


def crowded(run: Run, here: ModeState, crossing: Crossing) -> bool:
    """Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit.

    Those of one instant count only where the edge is one of theirs. Those of contacts that move the state run to one.
    """
    t, edge = crossing.time, here.mode.edges[crossing.edge]
    last = run.recorder.transitions[-FREE:]
    if len(last) < FREE or contraction(last) is not None or flown(last, t) > run.settings.relaxation:
        return False
    again = any(made.edge == edge.name and made.source == here.mode.name for made in last)
    if not again and t - last[0].time <= run.tie(t):
        return False
    return not (of_contacts(run, here, last) and edge.contact is not None and moves(run, here, crossing))


def moves(run: Run, here: ModeState, crossing: Crossing) -> bool:
    """Whether a transition moves the state, beyond round-off."""
    try:
        return not keeps(run, here.moved(crossing.time, crossing.state), crossing.edge)
    except DOMAIN_ERRORS:
        return False


def at_boundary(run: Run, here: ModeState) -> ModeState | Stop:
    """Go on after a sample of an input, or end: a jump at the end is made, and a guard reached there fires."""
    if run.timeline.goes_on(here.segment):
        return go_on(run, here)
    held = contact_at(run, here)
    if isinstance(held, Stop) or not (standing := standing_on(run, held)):
        return reached(here.t)
    chosen, alternatives = choose(held, standing, run)
    return make_transition(run, here, Event(chosen, alternatives, here.t, sizes(here.x, here.x, here)))


def stuck(run: Run, here: ModeState, failure: StepFailure) -> Event | Stop:
    """No step is short enough: take a guard that the state is on, or stop with the reason."""
    if failure.kind in ("not finite", "unsolved") and (standing := standing_on(run, here)):
        chosen, alternatives = choose(here, standing, run)
        return Event(chosen, alternatives, here.t, sizes(here.x, here.x, here))
    try:
        slope = here.kernel.flow(here.t, *here.x)
    except DOMAIN_ERRORS:
        return run.standstill(here).not_finite([(here.t, here.x)])
    return run.standstill(here).stuck(failure, slope)
