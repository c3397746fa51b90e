"""The located scheme: the execution itself, its transitions at the crossings (Burden et al. 2013, Fig. 8, Sec. IV-A).

A step is as long as its error allows (`Steps`). Every crossing of every surface inside it is isolated on the
surface's own polynomial (`surfaces`); the earliest goes, at its own instant, and flow goes on from its reset
(`transitions`). What rises behind it is not corrected on the surface. Guards may hold the state, and a Zeno tail is
replaced by its limit (`contact`). A cascade at one instant costs no time, unless more than `FREE` transitions fall
within the relaxation: then each of the others waits in a strip.

A guard is only *reached* where the flow has no value beyond it, as that of an empty tank: h' = -sqrt(h) with h <= 0
(`reaches`). The execution comes to the surface tangentially, in finite time. A step's polynomial ends there, or turns
back there as the equation does not: at its end the flow still leads towards the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.roundoff import ROUNDOFF_UNITS
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.radau import NoConvergence
from hsdsl.engine.integrators.stepper import Polynomial, Stages, State
from hsdsl.engine.integrators.taylor import proposed_step
from hsdsl.engine.kernel import Series
from hsdsl.engine.scheme.control import accept, begin_steps, reject, struggles
from hsdsl.engine.scheme.pace import count_creeping, count_step
from hsdsl.engine.scheme.polynomials import slope_of, value_of
from hsdsl.engine.scheme.roots import stays_below
from hsdsl.engine.simulate.contact import (
    at_limit,
    behind_end,
    close_tail,
    contact_at,
    contraction,
    flown,
    held_exactly,
    holds_next,
    in_touch,
    keeps,
    of_contacts,
    unresolved,
)
from hsdsl.engine.simulate.control import error_ratio
from hsdsl.engine.simulate.relaxed import ALMOST, NOT_FINITE, TOO_WRONG, UNSOLVED, Event, go_on, sizes, standing_on
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.settings import UNKNOWN_TOLERANCE
from hsdsl.engine.simulate.stalls import across_jump, make_pace
from hsdsl.engine.simulate.stops import FREE, LEFT, left_domain, reached, reached_in_strip, slides
from hsdsl.engine.simulate.surfaces import (
    NONE,
    Arrival,
    Crossing,
    Curves,
    Piece,
    Rise,
    StepFailure,
    TooFast,
    at,
    close_bracket,
    curves_along,
    deflated,
    joined,
    rises_along,
    settles,
    shortened,
    total,
    without_zeros,
)
from hsdsl.engine.simulate.transitions import choose, comes_back, enter, reset

MOST_CORRECTIONS = 8


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
        return follow(run, here, here.segment.end)
    outcome = along_guards(run, here, held)
    still = here.arc.values[-1] == here.x
    for k in in_touch(here, held):
        run.diagnostics.in_contact(here.mode.edges[k].name, here.t, here.arc.times[-1], still)
    return outcome


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
            t, x, ends = behind_end(run, here, held, crossing.edge, t, x)
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
            return left_domain(here.mode, wall.edge, wall.time, LEFT)
        guards = [Crossing(k, wall.theta, wall.time, wall.state, wall.depth) for k in standing]
    if not guards:
        return None
    guards = with_unseen(run, here, span, guards)
    chosen, alternatives = choose(here, guards, run)
    write(here, span, chosen)
    return Event(chosen, alternatives, chosen.time, largest(here, before, span, chosen))


def largest(here: ModeState, before: Span | None, span: Span, crossing: Crossing) -> State:
    """The sizes of the numbers behind a crossing's state: the terms of its step and of the one before."""
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


def crossings_along(run: Run, here: ModeState, span: Span) -> list[Crossing]:
    """The first crossing of each surface of a step, in their order.

    Surfaces that rise behind the first of all are left out. There they are inside, beyond round-off and by more than
    they rise while crossings are tied. Not those of an implicit method: to a point of its step it iterates from the
    one before.
    """
    found: dict[int, Crossing] = {}
    waiting: dict[int, tuple[Rise, Iterator[Rise]]] = {}

    def keep(crossing: Crossing | None) -> None:
        strict = crossing and crossing.edge < len(here.mode.edges)
        if crossing and not (strict and here.surfaces.too_late(crossing.edge, crossing.time, run.tie(crossing.time))):
            found[crossing.edge] = crossing

    for k in range(len(span.curves)):
        rises = rises_of(run, here, span, k)
        rise = next(rises, None)
        if rise is None:
            keep(reaches(run, here, span, k, pieces_of(here, span, k)))
        elif run.control.implicit:
            keep(first_crossing(run, here, span, k, rise, rises))
        else:
            waiting[k] = rise, rises
    while waiting and not found:
        k = min(waiting, key=lambda k: waiting[k][0][0])
        keep(first_crossing(run, here, span, k, *waiting.pop(k)))
    first = min(found.values(), key=lambda c: c.time, default=None)
    behind = {k for k, (rise, _) in waiting.items() if first and is_behind(run, here, first, k, rise)}
    for k in waiting:
        if k not in behind:
            keep(first_crossing(run, here, span, k, *waiting[k]))
    return [found[k] for k in sorted(found)]


def is_behind(run: Run, here: ModeState, first: Crossing, k: int, rise: Rise) -> bool:
    """Whether surface k rises behind the first crossing of a step."""
    share, _, certain = rise
    if not certain or not share > first.theta:
        return False
    t, x = first.time, first.state
    value, noise = here.kernel.surfaces(t, *x)[k], here.surfaces.roundoff_bound(k, t, x)
    try:
        return value < -max(noise, abs(here.kernel.rates[k](t, *x)[0]) * run.tie(t))
    except DOMAIN_ERRORS:
        return False


def pieces_of(here: ModeState, span: Span, k: int) -> list[Piece]:
    """The polynomials of surface k."""
    return deflated(span.curves[k]) if k in here.surfaces.active else span.curves[k]


def rises_of(run: Run, here: ModeState, span: Span, k: int) -> Iterator[Rise]:
    """Where surface k rises along a step, on its polynomials."""
    surfaces, pieces = here.surfaces, pieces_of(here, span, k)
    polynomials = ((piece.coefficients, len(piece.coefficients) - 1, piece.off) for piece in pieces)
    if span.ends[k] <= 0 and all(stays_below(run.roots, *each) for each in polynomials):
        return
    first, last = surfaces.roundoff_bound(k, span.t, span.x), surfaces.roundoff_bound(k, span.t1, span.z)
    beyond = pieces[0].coefficients[0] > first
    yield from rises_along(run.roots, pieces, max(first, last), beyond, span.ends[k] > last)


def first_crossing(
    run: Run, here: ModeState, span: Span, k: int, rise: Rise, further: Iterator[Rise]
) -> Crossing | None:
    """Find the first point of a step, from its first rise on, where surface k is crossed and its condition holds."""
    for share, slope, certain in chain([rise], further):
        theta, time, q = settled(here, span, k, share, slope)
        holds = k >= len(here.mode.edges) or here.kernel.conditions[k](time, *q)[0]
        if holds or (k in here.surfaces.active and holds_next(run, here, k, time, q)):
            if not certain:
                run.diagnostics.unsettled(here.mode.name, k, time)
            return Crossing(k, theta, time, q, run.arithmetic.zero)
    return reaches(run, here, span, k, pieces_of(here, span, k))


def with_unseen(run: Run, here: ModeState, span: Span, guards: list[Crossing]) -> list[Crossing]:
    """Crossings, with those before the first one that rise by less than a step's polynomials are off by.

    A surface may be beyond its guard so and be crossed again behind the first one.
    """
    t, x, first, found = span.t, span.x, min(guards, key=lambda c: c.time), {c.edge: c for c in guards}
    start, end = here.kernel.surfaces(t, *x), here.kernel.surfaces(first.time, *first.state)
    tied = {c.edge for c in guards if c.time - first.time <= run.tie(first.time)}
    for k in range(len(here.mode.edges)):
        if k in tied or here.surfaces.releases(k) or not first.theta > 0:
            continue
        bound = here.surfaces.roundoff_bound
        if not end[k] > 0 or not end[k] > bound(k, first.time, first.state) or start[k] > bound(k, t, x):
            continue

        def residual(s: Number, k: int = k) -> Number:
            time, q = span.point(s)
            return here.kernel.surfaces(time, *q)[k]

        s = first.theta * 0
        if not start[k] > 0:
            s = close_bracket(residual, (s, start[k]), (first.theta, end[k]), s, run.arithmetic.unit * first.theta)
        time, q = span.point(s)
        if here.kernel.conditions[k](time, *q)[0] or (k in here.surfaces.active and holds_next(run, here, k, time, q)):
            found[k] = Crossing(k, s, time, q, run.arithmetic.zero)
    return list(found.values())


def settled(here: ModeState, span: Span, k: int, s: Number, slope: Number) -> tuple[Number, Number, State]:
    """Correct a crossing on the surface itself to round-off: by Newton's method, else in a bracket."""
    stands, best = k in here.surfaces.active, None

    def residual(s: Number) -> Number:
        time, q = span.point(s)
        return here.kernel.surfaces(time, *q)[k]

    for _ in range(MOST_CORRECTIONS):
        time, q = span.point(s)
        r = here.kernel.surfaces(time, *q)[k]
        if best is not None and not abs(r) < best[0]:
            break
        best = (abs(r), s)
        if slope == 0 or abs(r) <= here.surfaces.roundoff_bound(k, time, q, entry=stands):
            return s, time, q
        s = min(s * 0 + 1, max(s * 0, s - r / slope))
    assert best is not None
    s = bracketed(residual, best[1], here)
    return s, *span.point(s)


def bracketed(residual: Callable[[Number], Number], s: Number, here: ModeState) -> Number:
    """Close in on a rise near s where Newton's method fails (a root of higher order), if one is bracketed there."""
    unit = here.surfaces.arithmetic.unit
    width, one = 8 * unit * max(s, unit), s * 0 + 1
    while width < 1:
        low, high = max(s * 0, s - width), min(one, s + width)
        below, above = residual(low), residual(high)
        if below < 0 and above == 0:
            return high
        if below <= 0 < above:
            return close_bracket(residual, (low, below), (high, above), s * 0, unit * s)
        width = width * 16
    return s


def make_transition(run: Run, here: ModeState, event: Event) -> ModeState | Stop:
    """Make a transition, at its own instant or behind a strip, and look whether it belongs to a Zeno tail."""
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
    """Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires."""
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


TOO_FAST = StepFailure("not finite")  # a surface, for one step
BLUR = 2  # estimates of a step's error that an implicit method's polynomial may be off inside it
LAST_TERM, TERM_BEFORE = 4, 32  # tolerances that the last terms of a surface's series may have, relative to the largest


@dataclass(frozen=True)
class Span:
    """A step from (t, x) to (t1, z).

    ``curves`` has the pieces of each surface and ``ends`` its value at z. ``point(s)`` is the time and state at the
    share s of the step, ``cut(s)`` the interpolant of the states up to there, over [0, 1], and ``sizes(s)`` the sums of
    the absolute terms that the state there is computed from.
    """

    t: Number
    h: Number
    t1: Number
    x: State
    z: State
    piece: Polynomial
    curves: Curves
    ends: State
    point: Callable[[Number], tuple[Number, State]]
    cut: Callable[[Number], Polynomial]
    sizes: Callable[[Number], State]


class Steps:
    """Makes steps in one mode, on one segment of the inputs, that the error allows and that do not pass a limit."""

    def __init__(self, run: Run, here: ModeState) -> None:
        self.run, self.here, self.method, self.pace = run, here, run.stepper(here), make_pace(run, here.t)


class TableSteps(Steps):
    """Steps of a Runge-Kutta method; surfaces are interpolated on its dense output.

    A crossing's state is that of a step of the method that ends there, which is as accurate as any of its steps.
    """

    slope: State | None = None  # the flow at the end of the last step, which was tried
    at_time: Number = None
    _ratio: Number = 1

    def next(self, t: Number, x: State, limit: Number) -> Span | StepFailure:
        """Make one step: rejected by the error estimate, halved where something has no value."""
        control, flow, halvings = self.run.control, self.here.kernel.flow, 0
        try:
            slope = self.slope if self.slope is not None and self.at_time == t else flow(t, *x)
        except DOMAIN_ERRORS:
            return NOT_FINITE
        if self.slope is None:
            begin_steps(control, self.here.arc.scales, slope, len(x))
        mode = self.here.mode.name
        h = control.within_reach(mode, control.h)
        while True:
            h, t1 = (h, t + h) if h < (limit - t) * ALMOST else (limit - t, limit)
            tried = self._try(t, h, t1, x, slope) if t1 > t else TOO_WRONG
            if isinstance(tried, Span):
                assert self.slope is not None
                if control.tolerance > 0 and across_jump(self.pace, self.here, t, x, slope, t1, tried.z, self.slope):
                    return StepFailure("jump")
                if control.tolerance > 0 and halvings == 0:
                    accept(control, h, self._ratio)
                control.slow_enough(mode, h)
                return StepFailure("creeping") if count_creeping(self.pace, halvings) else tried
            if halvings == 0 and (tried is TOO_WRONG or (tried is UNSOLVED and control.tolerance > 0)):
                reject(control, h, self._ratio, tried is not UNSOLVED)
                h = control.within_reach(mode, control.h)
            else:
                if tried is TOO_FAST:
                    control.too_fast(mode, h)
                h, halvings = h / 2, halvings + 1
            if halvings > self.run.arithmetic.most_halvings or not t + h > t or struggles(control):
                return tried

    def _try(self, t: Number, h: Number, t1: Number, x: State, slope: State) -> Span | StepFailure:
        flow, method, control = self.here.kernel.flow, self.method, self.run.control
        try:
            z, stages = method.step(flow, t, h, x, slope)
            end = flow(t1, *z)
            if not self.run.arithmetic.isfinite(sum(z) + sum(end)):
                return NOT_FINITE
            if control.tolerance > 0 and method.error is not None:
                self._ratio = error_ratio(self.run, self.here, method, method.error(h, stages, end), t, h, x, z)
                if not self._ratio <= 1:
                    return TOO_WRONG
            piece = method.piece(flow, t, h, x, z, stages, slope, end)
            if not all(self.run.arithmetic.isfinite(c) for power in piece for c in power):
                return NOT_FINITE  # it may overflow where its end does not
            curves = curves_along(self.run, self.here, t, h, x, z, piece)
            ends = self.here.kernel.surfaces(t1, *z)
            if method.landing is not None and control.tolerance > 0 and method.error is not None:
                curves = self._blurred(curves, t1, z, method.error(h, stages, end), ends)
        except NoConvergence:
            return UNSOLVED
        except TooFast:
            return TOO_FAST
        except DOMAIN_ERRORS:
            return NOT_FINITE
        self.slope, self.at_time = end, t1

        part = method.landing or method.step

        def point(s: Number) -> tuple[Number, State]:
            return (t1, z) if s == 1 else (t + s * h, part(flow, t, s * h, x, slope)[0] if s > 0 else x)

        def cut(s: Number) -> Polynomial:
            try:
                q, shorter = part(flow, t, s * h, x, slope)
                return method.piece(flow, t, s * h, x, q, shorter, slope, flow(t + s * h, *q))
            except DOMAIN_ERRORS:
                return shortened(piece, s)

        def sizes(s: Number) -> State:
            if method.landing is not None:
                return sizes_along(x, piece, s)
            largest = [max(abs(k) for k in column) for column in zip(*stages, strict=True)]
            return tuple(abs(a) + s * h * self.method.gain * k for a, k in zip(x, largest, strict=True))

        return Span(t, h, t1, x, z, piece, curves, ends, point, cut, sizes)

    def _blurred(self, curves: Curves, t1: Number, z: State, error: State, ends: State) -> Curves:
        """Let no rise count that is lower than what the step's error moves a surface by.

        A collocation polynomial is off inside the step as it is at its end, its first terms too: where a mode is
        entered on a surface that the flow leaves slowly, it may rise where the solution falls.
        """
        moved = self.here.kernel.surfaces(t1, *(a + BLUR * e for a, e in zip(z, error, strict=True)))
        off = [abs(a - b) for a, b in zip(moved, ends, strict=True)]
        return [[replace(piece, off=piece.off + more) for piece in row] for row, more in zip(curves, off, strict=True)]


class SeriesSteps(Steps):
    """Steps of Taylor's method; smooth surfaces have series of their own."""

    def __init__(self, run: Run, here: ModeState) -> None:
        super().__init__(run, here)
        method, series = run.settings.method, run.kernel.taylor(here.flow, here.segment.data)
        assert method is not None and series is not None
        self.order, self.series = method.order, series

    def next(self, t: Number, x: State, limit: Number) -> Span | StepFailure:
        """Make one step, as long as the terms left out allow; halved where its end does not solve the equation."""
        run, order, mode = self.run, self.order, self.here.mode.name
        try:
            lines = self.series.flow(order, t, x)
        except DOMAIN_ERRORS:
            return NOT_FINITE
        stages = tuple(tuple(line[m] for line in lines[1 : len(x) + 1]) for m in range(1, order + 2))
        h = run.control.within_reach(mode, self._longest(stages))
        for _ in range(run.arithmetic.most_halvings):
            h, t1 = (h, t + h) if h < (limit - t) * ALMOST else (limit - t, limit)
            if not t1 > t:
                break
            tried = self._try(t, h, t1, x, stages, lines)
            if isinstance(tried, Span):
                run.control.slow_enough(mode, h)
                return tried
            if tried is TOO_FAST:
                run.control.too_fast(mode, h)
            h = h / 2
        return NOT_FINITE

    def _longest(self, stages: Stages) -> Number:
        control = self.run.control
        if not control.tolerance > 0:
            return control.h
        tolerance = max(control.tolerance, self.run.arithmetic.unit)
        proposed = proposed_step(stages, self.here.arc.scales, tolerance, self.run.arithmetic)
        return control.largest if proposed is None else min(control.largest, proposed)

    def _try(
        self, t: Number, h: Number, t1: Number, x: State, stages: Stages, lines: tuple[Series, ...]
    ) -> Span | StepFailure:
        run, here, power, parts = self.run, self.here, self.run.arithmetic.zero + 1, list[State]()
        for c in stages[:-1]:
            power = power * h
            parts.append(tuple(a * power for a in c))
        piece = tuple(parts)
        z = at(x, piece, run.arithmetic.zero + 1)
        try:
            end = here.kernel.flow(t1, *z)
            if not run.arithmetic.isfinite(sum(z) + sum(end)):
                return NOT_FINITE
            tolerance, error = run.control.tolerance, self.method.error
            if tolerance > 0 and error is not None:
                ratio = error_ratio(run, here, self.method, error(h, stages, end), t, h, x, z)
                if ratio > max(1, 64 * run.arithmetic.unit / tolerance):
                    return TOO_WRONG
            ends = here.kernel.surfaces(t1, *z)
            curves = self._curves(t, h, t1, x, z, piece, lines, ends)
        except TooFast:
            return TOO_FAST
        except DOMAIN_ERRORS:
            return NOT_FINITE

        def point(s: Number) -> tuple[Number, State]:
            return (t1, z) if s == 1 else (t + s * h, at(x, piece, s) if s > 0 else x)

        def sizes(s: Number) -> State:
            return sizes_along(x, piece, s)

        return Span(t, h, t1, x, z, piece, curves, ends, point, lambda s: shortened(piece, s), sizes)

    def _curves(
        self,
        t: Number,
        h: Number,
        t1: Number,
        x: State,
        z: State,
        piece: Polynomial,
        lines: tuple[Series, ...],
        ends: State,
    ) -> Curves:
        """The surfaces' series where they meet the surfaces at the step's end, interpolation for the others."""
        run, here = self.run, self.here
        starts, zero = here.kernel.surfaces(t, *x), run.arithmetic.zero
        if not ends:
            return []
        try:
            found = self.series.surfaces(self.order, lines)
        except DOMAIN_ERRORS:
            found = tuple(None for _ in ends)
        curves: Curves = []
        half = (zero + 1) / 2

        @cache
        def middle() -> State:
            return here.kernel.surfaces(t + half * h, *at(x, piece, half))

        for k, (row, end) in enumerate(zip(found, ends, strict=True)):
            scaled, power = list[Number](), zero + 1
            for c in row or ():
                scaled.append(c * power)
                power = power * h
            if not scaled or not self._converges(
                scaled, end, lambda k: 4 * here.surfaces.roundoff_bound(k, t1, z), k, middle
            ):
                return curves_along(run, here, t, h, x, z, piece)
            curves.append([Piece(zero, zero + 1, without_zeros([starts[k], *scaled[1:]]))])
        return curves

    def _converges(
        self, c: list[Number], end: Number, noise: Callable[[int], Number], k: int, middle: Callable[[], State]
    ) -> bool:
        """Whether a surface's series has run out by its last terms, and gives the surface at the end of the step.

        That of a surface linear in the states need not run out: it converges if it gives the surface to round-off.
        """
        given, largest = self.run.control.tolerance, max(abs(a) for a in c)
        tolerance = max(given, self.run.arithmetic.unit) if given > 0 else UNKNOWN_TOLERANCE
        tail = abs(c[-1]) <= LAST_TERM * tolerance * largest and abs(c[-2]) <= TERM_BEFORE * tolerance * largest
        one = end * 0 + 1
        off = abs(value_of(c, len(c) - 1, one) - end)
        if tail:
            return settles(off, tolerance * largest, noise, k)
        return off <= noise(k) and abs(value_of(c, len(c) - 1, one / 2) - middle()[k]) <= noise(k)


def sizes_along(x: State, piece: Polynomial, s: Number) -> State:
    """The sums of the absolute terms of an interpolant."""
    return at(tuple(map(abs, x)), tuple(tuple(map(abs, c)) for c in piece), s)


TURNINGS = 60  # halvings of a step


def reaches(run: Run, here: ModeState, span: Span, k: int, pieces: list[Piece]) -> Crossing | None:
    """Return where in a step surface k is reached so and its condition holds, on the step's own polynomial."""
    c, one = pieces[0].coefficients, run.arithmetic.zero + 1
    if not c[1] > 0 or len(pieces) > 1 or not run.control.tolerance > 0:
        return None
    share, time, q, slope = one, span.t1, span.z, slope_of(c, len(c) - 1, one)
    if slope > ROUNDOFF_UNITS * run.arithmetic.unit * c[1]:
        return None
    if here.kernel.rates[k](span.t1, *span.z)[0] > 0:
        if not slope < 0:
            return None
        share = turning(c, one)
        time, q = span.t + share * span.h, at(span.x, span.piece, share)
    elif not abs(span.ends[k]) <= here.surfaces.roundoff_bound(k, span.t, span.x):
        return None
    if not ends_at(run, here, k, time, q):
        return None
    holds = k >= len(here.mode.edges) or here.kernel.conditions[k](time, *q)[0]
    return Crossing(k, share, time, q, run.arithmetic.zero) if holds else None


def turning(c: Sequence[Number], one: Number) -> Number:
    """Where in [0, 1] a polynomial turns that rises at 0 and falls at 1."""
    low, high = one * 0, one
    for _ in range(TURNINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if slope_of(c, len(c) - 1, middle) > 0 else (low, middle)
    return low


def ends_at(run: Run, here: ModeState, k: int, time: Number, q: State) -> bool:
    """Whether a state is on surface k, within the error of a step, and the flow has no value beyond."""
    zero, tolerance = run.arithmetic.zero, run.control.tolerance
    gradient = here.kernel.gradients[k](time, *q)[1:]
    sizes = zip(gradient, q, here.arc.scales, strict=True)
    off = total((abs(g) * (tolerance * max(size, abs(a))) for g, a, size in sizes), zero)
    norm = total((g * g for g in gradient), zero)
    if not norm > 0 or here.kernel.surfaces(time, *q)[k] < -off:
        return False
    beyond = tuple(a + 2 * off / norm * g for a, g in zip(q, gradient, strict=True))
    try:
        end = here.kernel.flow(time, *beyond)
    except DOMAIN_ERRORS:
        return True
    return not run.arithmetic.isfinite(total(end, zero))
