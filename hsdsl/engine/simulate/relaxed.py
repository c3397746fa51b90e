"""The relaxed scheme: discrete approximation of a relaxed execution (Burden et al. 2013, Fig. 12, Sec. IV-C).

Each guard carries a strip of depth epsilon. A step may end in the domain or in a strip; otherwise it is halved. In the
strip the state waits at the point q where the step crossed the guard, until epsilon has passed, and is reset. No event
is located on the flow, only on the step's own interpolant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.radau import NoConvergence
from hsdsl.engine.integrators.stepper import Stages, State, Stepper
from hsdsl.engine.simulate.cascade import takes_back
from hsdsl.engine.simulate.chatter import Chatter
from hsdsl.engine.simulate.contact import holds_next
from hsdsl.engine.simulate.diagnostics import slides
from hsdsl.engine.simulate.entry import enter
from hsdsl.engine.simulate.run import ModeState, Run, choose, reset
from hsdsl.engine.simulate.scales import error_ratio
from hsdsl.engine.simulate.stall_detection import Patience, pace
from hsdsl.engine.simulate.standstill import standstill
from hsdsl.engine.simulate.stops import reached, reached_in_strip
from hsdsl.engine.simulate.surfaces import Arrival, Crossing, StepFailure, Trial, joined
from hsdsl.engine.simulate.zeno import unresolved

ALMOST = 1 - 2.0**-30  # a step this close to a boundary ends on it
NOT_FINITE, TOO_WRONG, UNSOLVED = StepFailure("not finite"), StepFailure("error"), StepFailure("unsolved")


@dataclass(frozen=True)
class Event:
    """A step that ended in a strip at t1: where it left the domain, and the sizes of the numbers behind that.

    The guards of edges ``held`` held the state until then.
    """

    crossing: Crossing
    alternatives: tuple[str, ...]
    t1: Number
    scale: State
    held: tuple[int, ...] = ()


Found = Sequence[Crossing] | StepFailure  # no crossing: the step ended inside the domain
Attempted = tuple[Found, State, Stages, State | None]
Attempt = Callable[[Number, Number, Number, State, State], Attempted]


def relaxed(run: Run, here: ModeState | Stop) -> Stop:
    """Follow the relaxed execution from ``here`` until it stops."""
    while not isinstance(here, Stop):
        outcome = flow(run, here)
        if isinstance(outcome, Event):
            here = through_strip(run, here, outcome)
        elif isinstance(outcome, ModeState):
            here = at_boundary(run, outcome)
        else:
            here = outcome
    return here


def flow(run: Run, here: ModeState) -> Event | ModeState | Stop:
    """Step in the domain until a step ends in a strip, at the segment's end, or nowhere (Fig. 12, lines 3 to 9)."""
    control, method, arc = run.control, run.stepper(here), here.arc
    attempt = attempts(run, here, method)
    estimate, curved = method.error if control.tolerance is not None else None, run.recorder.degree > 0
    most_halvings = run.arithmetic.most_halvings
    t, x, limit, patience, chatter = here.t, here.x, here.segment.end, Patience(run.arithmetic.unit), Chatter()
    active, emerging, steady = here.surfaces.active, here.surfaces.emerging, pace(run, t)
    try:
        slope = here.kernel.flow(t, *x)
    except DOMAIN_ERRORS:
        return standstill(run, here).not_finite([(t, x)])
    control.begin(arc.scales, slope)
    while t < limit and not steady.is_slow(t):
        h, halvings, ratio, failure = control.h, 0, None, TOO_WRONG
        while True:
            h, t1 = (h, t + h) if h < (limit - t) * ALMOST else (limit - t, limit)
            found, z, stages, end = attempt(t, h, t1, x, slope)
            if estimate and end is not None and not isinstance(found, StepFailure):
                ratio = error_ratio(run, here, method, estimate(h, stages, end), t, h, x, z)
                trial = Trial(t, h, t1, x, slope, z, stages, here.kernel.flow, method)
                found = assess(here, found, ratio, trial, run.settings.relaxation)
            if not isinstance(found, StepFailure):
                break
            failure = found
            too_long = found is TOO_WRONG or (found is UNSOLVED and estimate is not None)
            if too_long and halvings == 0:
                control.reject(h, None if found is UNSOLVED else ratio)
                h = control.h
            else:
                h, halvings = h / 2, halvings + 1
            if halvings > most_halvings or (too_long and (control.struggles or not t + h > t)):
                return stuck(run, here.moved(t, x), found, slope)
        if ratio is not None and halvings == 0:
            control.accept(h, ratio)
        if found or end is None:
            crossing, alternatives = choose(here, found, run)
            last = z if crossing.theta > 0 else x
            return Event(crossing, alternatives, t1, sizes(x, last, here, crossing.edge in active))
        if (halvings or not t1 > t) and (given_up := patience.ends(here, halvings, control.h, failure, t, x, t1, z)):
            return stuck(run, here.moved(t, x), given_up, slope)
        if estimate and chatter.across(here.kernel.flow, t, x, slope, t1, z, end):
            return stuck(run, here.moved(t, x), StepFailure("jump"), slope)
        if active or emerging:
            here.surfaces.leave(t1, z)
        pieces = [method.piece(here.kernel.flow, t, h, x, z, stages, slope, end)] if curved else []
        z = run.moved_along(here, t1, z, h)
        arc.times.append(t1)
        arc.values.append(z)
        arc.notice(z)
        arc.pieces.extend(pieces)
        t, x, slope = t1, z, end
    return stuck(run, here.moved(t, x), StepFailure("slow"), slope) if t < limit else here.moved(t, x)


def attempts(run: Run, here: ModeState, method: Stepper) -> Attempt:
    """Make the function that tries one step from (t, x) and says where it ended.

    It returns what was found, the step's end z, the stages, and the flow at z if it has a value there.
    """
    flow, surfaces = here.kernel.flow, here.kernel.surfaces
    step, isfinite, epsilon = method.step, run.arithmetic.isfinite, run.settings.relaxation

    def attempt(t: Number, h: Number, t1: Number, x: State, slope: State) -> Attempted:
        try:
            z, stages = step(flow, t, h, x, slope)
            values = surfaces(t1, *z)
            if not values or max(values) <= 0:
                end = flow(t1, *z)
                return () if isfinite(sum(z) + sum(values) + sum(end)) else NOT_FINITE, z, stages, end
            if not isfinite(sum(z) + sum(values)):
                return NOT_FINITE, z, stages, None
            trial = Trial(t, h, t1, x, slope, z, stages, flow, method)
            found = here.surfaces.judge(trial, values, epsilon, partial(holds_next, run, here))
            if found or trial.end_slope is not None:  # beyond a guard the flow need not have a value, inside it must
                return found, z, stages, trial.end_slope
        except NoConvergence:
            return UNSOLVED, x, (), None
        except DOMAIN_ERRORS:
            pass
        return NOT_FINITE, x, (), None

    return attempt


def assess(here: ModeState, found: Found, ratio: Number, trial: Trial, epsilon: Number) -> Found:
    """Look again at an adaptive step that ended where it may: its error, and whether it left the domain on the way."""
    return TOO_WRONG if ratio > 1 else here.surfaces.excursion(trial, epsilon) or found


def through_strip(run: Run, here: ModeState, event: Event) -> ModeState | Stop:
    """Wait in the strip for what is left of epsilon, then reset (Fig. 12, lines 10 to 14)."""
    crossing, epsilon, until = event.crossing, run.settings.relaxation, run.settings.until
    t, q, depth = crossing.time, crossing.state, crossing.depth
    if crossing.theta > 0:
        here.arc.append(t, q, crossing.piece)
    if stop := run.limit_reached(t):
        return stop
    crossing = run.moved_crossing(here, crossing)
    q, outcome = crossing.state, reset(here, crossing, event.scale, run)
    resumed = event.t1 + (epsilon - depth)
    edge = here.mode.edges[crossing.edge]
    if resumed > until + run.tie(until):
        depth_at_end = depth + (until - event.t1)
        run.wait(here, [(t, depth * 0), (event.t1, depth), (until, depth_at_end)], q)
        run.record(here, crossing, None, None, event.alternatives)
        return reached_in_strip(until, edge.name)
    if isinstance(outcome, Stop):
        return outcome
    resumed = min(resumed, until)
    run.wait(here, [(t, depth * 0), (event.t1, depth), (resumed, epsilon)], q)
    after, scale = outcome
    flowed = run.has_flowed(t)
    after = run.record(here, crossing, resumed, after, event.alternatives)
    entered = enter(run, edge.target, edge.target_states, resumed, after, scale, here, Arrival(reset_at=t))
    if isinstance(entered, Stop):
        return entered
    if not run.cascade.returns(flowed, entered.index, entered.mode, entered.x):
        return (entered.mode is here.mode and unresolved(run, entered, crossing.edge)) or entered
    return slides(edge.name, here.mode, entered.mode, entered.t) if moves_on(here, crossing, entered) else entered


def moves_on(here: ModeState, crossing: Crossing, entered: ModeState) -> bool:
    """Whether flows of two modes that lead to and fro do more than undo each other: strips would freeze the rest."""
    if here.mode is entered.mode:
        return False
    try:
        one, other = here.kernel.flow(crossing.time, *crossing.state), entered.kernel.flow(entered.t, *entered.x)
    except DOMAIN_ERRORS:
        return True
    return len(one) != len(other) or not takes_back(one, other)


def at_boundary(run: Run, here: ModeState) -> ModeState | Stop:
    """Go on behind a sample of an input, or end: a jump at the end is made, and a guard reached there fires."""
    if run.timeline.goes_on(here.segment):
        return go_on(run, here)
    t, x = here.t, here.x
    standing = standing_on(run, here)
    if standing and (stop := run.limit_reached(t)):
        return stop
    if standing:
        chosen, alternatives = choose(here, standing, run)
        run.wait(here, [(t, run.arithmetic.zero)], x)
        run.record(here, chosen, None, None, alternatives)
        return reached_in_strip(t, here.mode.edges[chosen.edge].name, on_guard=True)
    return reached(t)


def go_on(run: Run, here: ModeState) -> ModeState | Stop:
    """Enter the next segment of the inputs: anew where one of them jumps."""
    t, x, mode, surfaces = here.t, here.x, here.index, here.surfaces
    if run.timeline.at(t).jump:
        try:
            inside = surfaces.inside(t, x)
            stood = surfaces.off(t, x, surfaces.active - surfaces.emerging)
        except DOMAIN_ERRORS:
            return standstill(run, here).not_finite([(t, x)])
        return enter(run, mode, here.mode.states, t, x, surfaces.scale, arrival=Arrival(inside=inside, stood=stood))
    after = run.place(mode, here.mode.states, t, x, surfaces.scale, active=surfaces.active)
    after.surfaces.emerging.update(surfaces.emerging)
    return after


def standing_on(run: Run, here: ModeState) -> list[Crossing]:
    """Guards that the state is on, to round-off or a tie."""
    t, x, zero = here.t, here.x, run.arithmetic.zero
    return [Crossing(k, zero, t, x, zero) for k in here.surfaces.standing(t, x, run.tie(t))]


def stuck(run: Run, here: ModeState, failure: StepFailure, slope: State) -> Event | Stop:
    """No step, however short, stays in the relaxed domain: take a guard reached together with a wall, or stop."""
    shrunk = failure.kind in ("wall", "deep", "flat", "inward", "not finite", "unsolved")
    if shrunk and (standing := standing_on(run, here)):
        chosen, alternatives = choose(here, standing, run)
        return Event(chosen, alternatives, here.t, sizes(here.x, here.x, here, chosen.edge in here.surfaces.active))
    return standstill(run, here).stuck(failure, slope)


def sizes(x: State, z: State, here: ModeState, stays: bool = False) -> State:
    """Return the sizes of the numbers that a point between x and z is computed from.

    A state that has not moved since the mode was entered still carries the sizes that it came in with. So does one that
    ``stays`` on a guard, which it has not left: it is off that by the round-off of these.
    """
    entered = zip(here.arc.values[0], here.surfaces.scale, strict=True)
    kept = (s if stays or b == first else b * 0 for b, (first, s) in zip(z, entered, strict=True))
    return tuple(joined(s, max(abs(a), abs(b))) for s, a, b in zip(kept, x, z, strict=True))
