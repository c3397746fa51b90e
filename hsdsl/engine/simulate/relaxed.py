"""The relaxed scheme: discrete approximation of a relaxed execution (Burden et al. 2013, Fig. 12, Sec. IV-C).

Each guard carries a strip of depth epsilon. A step may end in the domain or in a strip; otherwise it is halved. In the
strip the state waits at the point q where the step crossed the guard, until epsilon has passed, and is reset. No event
is located on the flow, only on the step's own interpolant (`Trial`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.radau import NoConvergence
from hsdsl.engine.integrators.stepper import Polynomial, Stages, State, Stepper, hermite
from hsdsl.engine.kernel import Vector
from hsdsl.engine.scheme.control import accept, begin_steps, reject, struggles
from hsdsl.engine.scheme.pace import count_step, takes_back
from hsdsl.engine.simulate.contact import holds_next
from hsdsl.engine.simulate.control import NOT_FINITE, TOO_WRONG, UNSOLVED, StepFailure, end_of_step, error_ratio
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.stalls import across_jump, make_pace, stall_ends
from hsdsl.engine.simulate.stops import reached, reached_in_strip, slides
from hsdsl.engine.simulate.surfaces import Arrival, Crossing, at, close_bracket, shortened
from hsdsl.engine.simulate.transitions import Event, choose, comes_back, enter, go_on, reset, sizes, standing_on
from hsdsl.engine.simulate.zeno import unresolved

SCAN = 8  # pieces in which a step's interpolant is searched for its last up-crossing
ROOT_SHARE = 1 / 16  # of the round-off: how close to zero a crossing is solved


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
    estimate, curved = method.error if control.tolerance > 0 else None, run.recorder.degree > 0
    most_halvings = run.arithmetic.most_halvings
    t, x, limit, pace = here.t, here.x, here.segment.end, make_pace(run, here.t)
    active, emerging = here.surfaces.active, here.surfaces.emerging
    try:
        slope = here.kernel.flow(t, *x)
    except DOMAIN_ERRORS:
        return run.standstill(here).not_finite([(t, x)])
    begin_steps(control, arc.scales, slope, len(x))
    while t < limit and not count_step(pace, t):
        h, halvings, ratio, failure = control.h, 0, None, TOO_WRONG
        while True:
            h, t1 = end_of_step(t, h, limit)
            found, z, stages, end = attempt(t, h, t1, x, slope)
            if estimate and end is not None and not isinstance(found, StepFailure):
                ratio = error_ratio(run, here, method, estimate(h, stages, end), t, h, x, z)
                trial = Trial(run, here, t, h, t1, x, slope, z, stages, method)
                found = TOO_WRONG if ratio > 1 else trial.excursion() or found
            if not isinstance(found, StepFailure):
                break
            failure = found
            too_long = found is TOO_WRONG or (found is UNSOLVED and estimate is not None)
            if too_long and halvings == 0:
                reject(control, h, ratio, found is not UNSOLVED)
                h = control.h
            else:
                h, halvings = h / 2, halvings + 1
            if halvings > most_halvings or (too_long and (struggles(control) or not t + h > t)):
                return stuck(run, here.moved(t, x), found, slope)
        if ratio is not None and halvings == 0:
            accept(control, h, ratio)
        if found or end is None:
            crossing, alternatives = choose(here, found, run)
            last = z if crossing.theta > 0 else x
            return Event(crossing, alternatives, t1, sizes(x, last, here, crossing.edge in active))
        if (halvings or not t1 > t) and (given_up := stall_ends(pace, here, halvings, control.h, failure, t, x, t1, z)):
            return stuck(run, here.moved(t, x), given_up, slope)
        if estimate and across_jump(pace, here, t, x, slope, t1, z, end):
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
    step, isfinite = method.step, run.arithmetic.isfinite

    def attempt(t: Number, h: Number, t1: Number, x: State, slope: State) -> Attempted:
        try:
            z, stages = step(flow, t, h, x, slope)
            values = surfaces(t1, *z)
            if not values or max(values) <= 0:
                end = flow(t1, *z)
                return () if isfinite(sum(z) + sum(values) + sum(end)) else NOT_FINITE, z, stages, end
            if not isfinite(sum(z) + sum(values)):
                return NOT_FINITE, z, stages, None
            trial = Trial(run, here, t, h, t1, x, slope, z, stages, method)
            found = trial.judge(values)
            if found or trial.end_slope is not None:  # beyond a guard the flow need not have a value, inside it must
                return found, z, stages, trial.end_slope
        except NoConvergence:
            return UNSOLVED, x, (), None
        except DOMAIN_ERRORS:
            pass
        return NOT_FINITE, x, (), None

    return attempt


@dataclass(frozen=True)
class Trial:
    """One step as tried, from (t, x) to (t1, z), against the surfaces of its mode.

    The depth of a point beyond a surface is tau = r / |grad r| with the gradient in (t, x); a crossing is looked for on
    the step's interpolant, never on the flow.
    """

    run: Run
    here: ModeState
    t: Number
    h: Number
    t1: Number
    x: State
    slope: State
    z: State
    stages: Stages
    stepper: Stepper

    @cached_property
    def end_slope(self) -> State | None:
        """The flow at the step's end; None where it has no finite value (beyond a guard it need not have one)."""
        try:
            end = self.here.kernel.flow(self.t1, *self.z)
        except DOMAIN_ERRORS:
            return None
        return end if sum(end) - sum(end) == 0 else None

    @cached_property
    def piece(self) -> Polynomial:
        """The step's interpolant."""
        if self.end_slope is None:
            return (tuple(b - a for a, b in zip(self.x, self.z, strict=True)),)
        flow, slope, end = self.here.kernel.flow, self.slope, self.end_slope
        return self.stepper.piece(flow, self.t, self.h, self.x, self.z, self.stages, slope, end)

    def excursion(self) -> StepFailure | None:
        """Look for a surface that the step went beyond and came back from, on its interpolant.

        Only where the step starts on it, or the flow points out of it there and back in at its end; for adaptive
        steps, whose length nobody chose.
        """
        if self.end_slope is None:
            return None
        for k, gradient in enumerate(self.here.kernel.gradients):
            try:
                out = _rate(gradient(self.t, *self.x), self.slope)
                back = _rate(gradient(self.t1, *self.z), self.end_slope)
                if (k in self.here.surfaces.active or out > 0 >= back) and self._beyond_within(k):
                    return StepFailure("deep", k)
            except DOMAIN_ERRORS:
                continue
        return None

    def judge(self, values: Vector) -> list[Crossing] | StepFailure:
        """Say whether the step's end is in the relaxed domain: inside (no crossing), in strips, or neither.

        ``values`` are those of the surfaces there. Raises one of ``DOMAIN_ERRORS`` where a surface or condition has no
        finite value on the way.
        """
        surfaces, edges = self.here.surfaces, len(self.here.mode.edges)
        noise = {k: surfaces.roundoff_bound(k, self.t1, self.z) for k, r in enumerate(values) if not r <= 0}
        beyond = [k for k in noise if not values[k] <= noise[k]]
        for k in beyond:
            if k >= edges and k not in surfaces.emerging:
                return StepFailure("wall", k)
            if not self._may_be_beyond(k) and (failure := self._too_deep(values[k], noise[k], k)):
                return failure
        found = list[Crossing]()
        for k in beyond:
            crossing = self._crossing(values[k], noise[k], k) if k < edges else None
            if isinstance(crossing, StepFailure):
                return crossing
            if crossing is not None:
                found.append(crossing)
        return found

    def _crossing(self, end: Number, noise: Number, k: int) -> Crossing | StepFailure | None:
        """Find the last up-crossing of surface k, which ends at ``end``; None where it is transparent there."""
        piece, epsilon = self.piece, self.run.settings.relaxation
        found = self._on(piece, k)
        if found is None:
            return None
        norm, back = self._norm(k), self._back(k, found)
        if noise < back <= epsilon * norm:  # round-off of the interpolant may put it where the flow leads back inside
            if self.end_slope is not None:
                piece = hermite(self.h, self.x, self.z, self.slope, self.end_slope)
            found = self._on(piece, k) or found
            back = self._back(k, found)
        if back > noise:
            return StepFailure("inward", k)
        theta, time, q = found
        if not self.here.kernel.conditions[k](time, *q)[0]:
            if not (theta == 0 or k in self.here.surfaces.active):
                return None
            if back > 0:  # where the flow comes back to the surface after a hop that round-off hides
                s = theta + (1 - theta) * (back / (back + end))
                time, q = self.t + s * self.h, at(self.x, piece, s)
            if not holds_next(self.run, self.here, k, time, q):
                return None
            theta, time, q = found
        if failure := self._too_deep(end, noise, k):
            return failure
        for i in range(1, SCAN):  # further beyond on the way than at the end: that is on another flank
            if self._value(piece, k, theta + (1 - theta) * i / SCAN) > end + noise:
                return StepFailure("deep", k)
        return Crossing(k, theta, time, q, min(epsilon, end / norm), shortened(piece, theta))

    def _too_deep(self, end: Number, noise: Number, k: int) -> StepFailure | None:
        norm = self._norm(k)
        if not norm > 0:
            return StepFailure("flat", k)
        return None if end <= self.run.settings.relaxation * norm + noise else StepFailure("deep", k)

    def _norm(self, k: int) -> Number:
        """|grad r| in (t, x) at the step's end."""
        total = self.run.arithmetic.zero
        for g in self.here.kernel.gradients[k](self.t1, *self.z):
            total = total + g * g
        return self.run.arithmetic.sqrt(total)

    def _back(self, k: int, found: tuple[Number, Number, State]) -> Number:
        """How far the flow at a point would take surface k back inside over this step."""
        _, time, q = found
        return -self.here.kernel.rates[k](time, *q)[0] * self.h

    def _may_be_beyond(self, k: int) -> bool:
        """Whether a state may be beyond surface k without having crossed it."""
        edges = self.here.mode.edges
        return k in self.here.surfaces.emerging or k >= len(edges) or edges[k].conditional

    def _value(self, piece: Polynomial, k: int, s: Number) -> Number:
        """Surface k at the share s of the step."""
        return self.here.kernel.surfaces(self.t + s * self.h, *at(self.x, piece, s))[k]

    def _on(self, piece: Polynomial, k: int) -> tuple[Number, Number, State] | None:
        """Return (theta, time, state) of the last up-crossing on ``piece``; None if r was beyond all along."""
        bound, value = self.here.surfaces.roundoff_bound, partial(self._value, piece, k)
        # it can be located to round-off of the numbers of this step, no older ones
        sizes = tuple(max(abs(a), abs(b)) for a, b in zip(self.x, self.z, strict=True))
        theta = last_up_crossing(value, bound(k, self.t1, sizes) * ROOT_SHARE, self.run.arithmetic)
        if theta is None:
            if self._may_be_beyond(k) and value(self.run.arithmetic.zero) > bound(k, self.t, self.x):
                return None
            theta = self.run.arithmetic.zero  # on the surface to round-off: it is crossed as the step begins
        if theta == 0:
            return theta, self.t, self.x
        return theta, self.t + theta * self.h, at(self.x, piece, theta)

    def _beyond_within(self, k: int) -> bool:
        """Whether the step is beyond surface k on the way: at its eighths, then ever nearer around the highest point.

        That ends where a concave surface could not reach zero, or a visit would not last as long as epsilon. Whether an
        `if` holds where it begins is seen by a step that ends in it.
        """
        values, bound, zero = self.here.kernel.surfaces, self.here.surfaces.roundoff_bound, self.run.arithmetic.zero
        top, end = values(self.t, *self.x)[k], values(self.t1, *self.z)[k]
        if top > bound(k, self.t, self.x) or end > bound(k, self.t1, self.z):
            return False  # transparent, and beyond already, or crossed
        place, width, middles = zero, (zero + 1) / SCAN, [(zero + i) / SCAN for i in range(1, SCAN)]
        while middles:
            crest, least = top, top
            for s in middles:
                t, x = self.t + s * self.h, at(self.x, self.piece, s)
                r = values(t, *x)[k]
                if r > 0 and r > bound(k, t, x):
                    return True
                place, top, least = (s, r, least) if r > top else (place, top, min(least, r))
            within = len(middles) == 2 and top == crest
            if not width * self.h > self.run.settings.relaxation or (within and top + (top - least) <= 0):
                break
            width = width / 2
            middles = [s for s in (place - width, place + width) if 0 < s < 1]
        return False


def _rate(gradient: Vector, flow: State) -> Number:
    total = gradient[0]
    for g, f in zip(gradient[1:], flow, strict=True):
        total = total + g * f
    return total


def last_up_crossing(value: Callable[[Number], Number], small: Number, arithmetic: Arithmetic) -> Number | None:
    """Find the last s in [0, 1] where ``value`` rises through zero, knowing value(1) > 0; None if it never does.

    The interval is scanned backwards in `SCAN` pieces, then the bracket is closed by the Illinois variant of regula
    falsi until |value| <= ``small`` or the bracket is a few units wide.
    """
    one = arithmetic.zero + 1
    b, fb = one, value(one)
    for i in range(SCAN - 1, -1, -1):
        a = one * i / SCAN
        fa = value(a)
        if fa <= 0:
            return close_bracket(value, (a, fa), (b, fb), small, arithmetic.unit)
        b, fb = a, fa
    return None


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
    if not comes_back(run, flowed, entered):
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
    return len(one) != len(other) or not takes_back(one, other, len(one))


def at_boundary(run: Run, here: ModeState) -> ModeState | Stop:
    """Go on after a sample of an input, or end: a jump at the end is made, and a guard reached there fires."""
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


def stuck(run: Run, here: ModeState, failure: StepFailure, slope: State) -> Event | Stop:
    """No step, however short, stays in the relaxed domain: take a guard reached together with a wall, or stop."""
    shrunk = failure.kind in ("wall", "deep", "flat", "inward", "not finite", "unsolved")
    if shrunk and (standing := standing_on(run, here)):
        chosen, alternatives = choose(here, standing, run)
        return Event(chosen, alternatives, here.t, sizes(here.x, here.x, here, chosen.edge in here.surfaces.active))
    return run.standstill(here).stuck(failure, slope)
