"""Geometry of a trial step against a mode's surfaces: round-off, depth, and where a surface was crossed.

The depth of a point beyond a surface is tau = r / |grad r| with the gradient in (t, x); the crossing is looked for on
the step's interpolant, never on the flow.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.integrators.stepper import Polynomial, Stages, State, Stepper, hermite
from hsdsl.engine.kernel import ModeKernel, Vector
from hsdsl.mathematics.program import EdgeProgram

ROUNDOFF_UNITS = 32
SCAN = 8  # pieces in which a step's interpolant is searched for its last up-crossing
ROOT_ITERATIONS = 200
Condition = Callable[[int, Number, State], bool]
NONE: Mapping[int, Number] = {}
ROOT_SHARE = 1 / 16  # of the round-off: how close to zero a crossing is solved


@dataclass(frozen=True)
class Crossing:
    """Where a trial step crossed a guard: share ``theta`` of the step, time and state there, and the depth reached.

    ``piece`` is the interpolant from the step's start to the crossing, empty where the crossing is the start.
    """

    edge: int
    theta: Number
    time: Number
    state: State
    depth: Number
    piece: Polynomial = ()


@dataclass(frozen=True)
class Arrival:
    """How a state has come to a mode, which decides what surfaces it is on.

    A surface that the flow passes within the time ``since`` is active: tied transitions share one point. A surface that
    moved past the state while it waited in a strip, since its reset at ``reset_at``, is active too. Edges in ``inside``
    were not reached before an input jumped: a state on such a surface counts as beyond it. Those that the state
    ``stood`` on, off them by numbers, it is still on if it is no further off.
    """

    since: Number = 0
    inside: frozenset[int] = frozenset()
    reset_at: Number = None
    stood: Mapping[int, Number] = field(default_factory=dict[int, Number])


ANY = Arrival()


@dataclass(frozen=True)
class StepFailure:
    """Why a trial step ends outside the relaxed domain."""

    kind: Literal["wall", "deep", "flat", "inward", "not finite", "error", "unsolved", "creeping", "jump", "slow"]
    surface: int | None = None


@dataclass(frozen=True)
class Trial:
    """One step as tried, from (t, x) to (t1, z)."""

    t: Number
    h: Number
    t1: Number
    x: State
    slope: State
    z: State
    stages: Stages
    flow: Callable[..., State]
    stepper: Stepper

    @cached_property
    def end_slope(self) -> State | None:
        """The flow at the step's end; None where it has no finite value (beyond a guard it need not have one)."""
        try:
            end = self.flow(self.t1, *self.z)
        except DOMAIN_ERRORS:
            return None
        return end if sum(end) - sum(end) == 0 else None

    @cached_property
    def piece(self) -> Polynomial:
        """The step's interpolant."""
        if self.end_slope is None:
            return (tuple(b - a for a, b in zip(self.x, self.z, strict=True)),)
        return self.stepper.piece(self.flow, self.t, self.h, self.x, self.z, self.stages, self.slope, self.end_slope)

    def cubic(self) -> Polynomial:
        """The cubic Hermite interpolant, for any method."""
        return self.piece if self.end_slope is None else hermite(self.h, self.x, self.z, self.slope, self.end_slope)


def at(x: State, piece: Polynomial, theta: Number) -> State:
    """Evaluate x + c_1 s + c_2 s**2 + ... at s = theta."""
    value = tuple(c * theta for c in piece[-1])
    for coefficients in reversed(piece[:-1]):
        value = tuple((c + v) * theta for c, v in zip(coefficients, value, strict=True))
    return tuple(a + v for a, v in zip(x, value, strict=True))


def shortened(piece: Polynomial, theta: Number) -> Polynomial:
    """Return the part of an interpolant before theta, over [0, 1] again."""
    power = theta
    parts: list[State] = []
    for c in piece:
        parts.append(tuple(a * power for a in c))
        power = power * theta
    return tuple(parts)


def roundoff(unit: Number, magnitude: Number, gradient: Vector, t: Number, x: State, scale: State) -> Number:
    """Below this a surface value counts as zero: 32 u (|L| + |R| + |dr/dt| |t| + sum |dr/dx_i| |x_i|).

    ``scale`` holds the sizes of the numbers a state was computed from (see `Surfaces`): a state that a reset
    or a cancellation made small carries the round-off of what made it.
    """
    total = magnitude + abs(gradient[0]) * abs(t)
    for g, a, s in zip(gradient[1:], x, scale, strict=True):
        total = total + abs(g) * max(abs(a), abs(s))
    return ROUNDOFF_UNITS * unit * total


def joined(scale: Number, size: Number) -> Number:
    """The size of numbers of two sizes, of which the first may have a sign (see `Surfaces`)."""
    return -max(-scale, size) if scale < 0 else max(scale, size)


def larger(sizes: Sequence[Number], scale: State) -> State:
    """The larger of each two sizes; of ``scale`` the signs do not count (see `Surfaces`)."""
    return tuple(max(a, abs(s)) for a, s in zip(sizes, scale, strict=True))


@dataclass(frozen=True)
class Surfaces:
    """A mode's surfaces with what is needed to judge a point.

    ``scale`` holds the sizes of the numbers that the state was computed from on entry: of the flow, or of the terms of
    the last reset; then they are negative, and the next reset reads no more than the value: no size multiplies. They
    count for the surfaces in ``active``, on which the state stood then, until it has left them. ``emerging`` are those
    that moved past the state while it waited in a strip, and that the flow leads back through. ``touched`` are the
    contacts that hold it. The surfaces of ``pushes``, these and other contacts, are the pushes on their guards: motion
    along guards is off them by the sizes that states have ``had``.
    """

    kernel: ModeKernel
    edges: tuple[EdgeProgram, ...]
    scale: State
    arithmetic: Arithmetic
    active: set[int] = field(default_factory=set[int])
    emerging: set[int] = field(default_factory=set[int])
    touched: frozenset[int] = frozenset()
    pushes: frozenset[int] = frozenset()
    had: Sequence[Number] = ()

    def releases(self, k: int) -> bool:
        """Whether surface k ends a contact that holds the state."""
        return k < len(self.edges) and self.edges[k].releases in self.touched

    def roundoff_bound(self, k: int, t: Number, x: State, entry: bool = False) -> Number:
        """Round-off of surface k at a point; where its gradient has no value only the sides count."""
        magnitude, unit = self.kernel.magnitudes(t, *x)[k], self.arithmetic.unit
        try:
            gradient = self.kernel.gradients[k](t, *x)
            if not self.arithmetic.isfinite(sum(gradient)):
                raise ValueError("a surface as steep as a wall")
        except DOMAIN_ERRORS:
            return ROUNDOFF_UNITS * unit * magnitude
        scale = self.scale if entry or k in self.active else tuple(self.arithmetic.zero for _ in x)
        if k < len(self.edges) and self.edges[k].releases in self.pushes:
            scale = larger(self.had, self.scale)
        return roundoff(unit, magnitude, gradient, t, x, scale)

    def enter(self, t: Number, x: State, values: Vector, arrival: Arrival = ANY) -> list[int]:
        """Look at the surfaces on entry: return those the state is beyond, and note those it is on."""
        beyond: list[int] = []
        then = values if arrival.reset_at is None else self.kernel.surfaces(arrival.reset_at, *x)
        for k, r in enumerate(values):
            noise = max(self.roundoff_bound(k, t, x, entry=True), abs(arrival.stood.get(k, self.arithmetic.zero)))
            if arrival.since and abs(r) > noise:
                noise = max(noise, abs(self.kernel.rates[k](t, *x)[0]) * arrival.since)
            if r > noise and not then[k] > noise:
                self.active.add(k)
                if self.kernel.rates[k](t, *x)[0] < 0:
                    self.emerging.add(k)
            elif r > noise or (k in arrival.inside and r >= -noise):
                beyond.append(k)
            elif r >= -noise:
                self.active.add(k)
        return beyond

    def inside(self, t: Number, x: State) -> frozenset[int]:
        """Edges without an `if` whose surfaces the state has not reached, to the round-off that counts on entry."""
        values, plain = self.kernel.surfaces(t, *x), [k for k, edge in enumerate(self.edges) if not edge.conditional]
        return frozenset(k for k in plain if values[k] < -self.roundoff_bound(k, t, x, entry=True))

    def off(self, t: Number, x: State, surfaces: Collection[int]) -> dict[int, Number]:
        """How far off some surfaces a state is."""
        values = self.kernel.surfaces(t, *x) if surfaces else ()
        return {k: values[k] for k in surfaces}

    def leave(self, t: Number, x: State) -> None:
        """Forget the surfaces that the state stood on and has left: inwards, or outwards where `if` was false."""
        values = self.kernel.surfaces(t, *x)
        self.active.difference_update([k for k in self.active if abs(values[k]) > self.roundoff_bound(k, t, x)])
        if self.emerging:
            inside = [k for k in self.emerging if values[k] <= 0 or not self._falls(k, t, x)]
            self.emerging.difference_update(inside)

    def _falls(self, k: int, t: Number, x: State) -> bool:
        """Whether the flow leads back through surface k, as far as is known."""
        try:
            return self.kernel.rates[k](t, *x)[0] < 0
        except DOMAIN_ERRORS:
            return True

    def norm(self, t: Number, x: State, surface: int) -> Number:
        """|grad r| in (t, x)."""
        total = self.arithmetic.zero
        for g in self.kernel.gradients[surface](t, *x):
            total = total + g * g
        return self.arithmetic.sqrt(total)

    def standing(self, t: Number, x: State, since: Number) -> list[int]:
        """Edges on whose guards the state is, with the flow pointing out and `if` true, which are not only touched.

        On the guard means to round-off, or within the time ``since``: sums of steps are no more exact than that.
        """
        found: list[int] = []
        for k in range(len(self.edges)):
            if self.releases(k):
                continue
            try:
                r, rate = self.kernel.surfaces(t, *x)[k], self.kernel.rates[k](t, *x)[0]
                noise = self.roundoff_bound(k, t, x)
                near = abs(r) <= max(noise, rate * since)
                if not (near and self._points_out(k, t, x, rate)) or self._turns_back(k, t, x, since, noise - r):
                    continue
                if self.kernel.conditions[k](t, *x)[0]:
                    found.append(k)
            except DOMAIN_ERRORS:
                continue
        return found

    def _turns_back(self, k: int, t: Number, x: State, since: Number, room: Number) -> bool:
        """Whether surface k, bending as it does in the time ``since``, falls again before it has risen by ``room``."""
        if not since > 0:
            return False
        rate, flow = self.kernel.rates[k](t, *x)[0], self.kernel.flow(t, *x)
        try:
            later = self.kernel.rates[k](t + since, *(a + since * f for a, f in zip(x, flow, strict=True)))[0]
        except DOMAIN_ERRORS:
            return False
        bend = (rate - later) / since
        return bend > 0 and rate * rate <= 2 * bend * room

    def _points_out(self, k: int, t: Number, x: State, rate: Number) -> bool:
        """Whether the flow points out of surface k, beyond the round-off of its rate."""
        if not rate > 0:
            return False
        first, *gradient = self.kernel.gradients[k](t, *x)
        size = abs(first)
        for g, f in zip(gradient, self.kernel.flow(t, *x), strict=True):
            size = size + abs(g) * abs(f)
        return rate > ROUNDOFF_UNITS * self.arithmetic.unit * size

    def excursion(self, trial: Trial, epsilon: Number) -> StepFailure | None:
        """Look for a surface that a step went beyond and came back from, on its interpolant.

        Only where the step starts on it, or the flow points out of it there and back in at its end; for adaptive
        steps, whose length nobody chose.
        """
        if trial.end_slope is None:
            return None
        for k, gradient in enumerate(self.kernel.gradients):
            try:
                out = self._rate(gradient(trial.t, *trial.x), trial.slope)
                back = self._rate(gradient(trial.t1, *trial.z), trial.end_slope)
                if (k in self.active or out > 0 >= back) and self._beyond_within(trial, k, epsilon):
                    return StepFailure("deep", k)
            except DOMAIN_ERRORS:
                continue
        return None

    def _rate(self, gradient: Vector, flow: State) -> Number:
        total = gradient[0]
        for g, f in zip(gradient[1:], flow, strict=True):
            total = total + g * f
        return total

    def _beyond_within(self, trial: Trial, k: int, epsilon: Number) -> bool:
        """Whether a step is beyond surface k on the way: at its eighths, and then ever nearer around the highest point.

        That ends where a concave surface could not reach zero, or a visit would not last as long as epsilon. Whether an
        `if` holds where it begins is seen by a step that ends in it.
        """
        zero, top = self.arithmetic.zero, self.kernel.surfaces(trial.t, *trial.x)[k]
        end = self.kernel.surfaces(trial.t1, *trial.z)[k]
        if top > self.roundoff_bound(k, trial.t, trial.x) or end > self.roundoff_bound(k, trial.t1, trial.z):
            return False  # transparent, and beyond already, or crossed
        place, width, middles = zero, (zero + 1) / SCAN, [(zero + i) / SCAN for i in range(1, SCAN)]
        while middles:
            crest, least = top, top
            for s in middles:
                t, x = trial.t + s * trial.h, at(trial.x, trial.piece, s)
                r = self.kernel.surfaces(t, *x)[k]
                if r > 0 and r > self.roundoff_bound(k, t, x):
                    return True
                place, top, least = (s, r, least) if r > top else (place, top, min(least, r))
            within = len(middles) == 2 and top == crest
            if not width * trial.h > epsilon or (within and top + (top - least) <= 0):
                break
            width = width / 2
            middles = [s for s in (place - width, place + width) if 0 < s < 1]
        return False

    def judge(self, trial: Trial, values: Vector, epsilon: Number, next_: Condition) -> list[Crossing] | StepFailure:
        """Say whether a trial's end is in the relaxed domain: inside (no crossing), in strips, or neither.

        ``next_`` says of an edge whether its `if` holds next along the flow, where it does not hold at a point.
        Raises one of ``DOMAIN_ERRORS`` where a surface or condition has no finite value on the way.
        """
        noise = {k: self.roundoff_bound(k, trial.t1, trial.z) for k, r in enumerate(values) if not r <= 0}
        beyond = [k for k in noise if not values[k] <= noise[k]]
        for k in beyond:
            if k >= len(self.edges) and k not in self.emerging:
                return StepFailure("wall", k)
            if not self._may_be_beyond(k) and (failure := self._too_deep(trial, values, noise, k, epsilon)):
                return failure
        crossings: list[Crossing] = []
        for k in beyond:
            if k >= len(self.edges):
                continue
            found = self._crossing(trial, values, noise, k, epsilon, next_)
            if isinstance(found, StepFailure):
                return found
            if found is not None:
                crossings.append(found)
        return crossings

    def _too_deep(
        self, trial: Trial, values: Vector, noise: dict[int, Number], k: int, epsilon: Number
    ) -> StepFailure | None:
        norm = self.norm(trial.t1, trial.z, k)
        if not norm > 0:
            return StepFailure("flat", k)
        return None if values[k] <= epsilon * norm + noise[k] else StepFailure("deep", k)

    def _crossing(
        self, trial: Trial, values: Vector, noise: dict[int, Number], k: int, epsilon: Number, next_: Condition
    ) -> Crossing | StepFailure | None:
        """Find the last up-crossing of surface k on the interpolant; None where the surface is transparent there."""
        piece = trial.piece
        found = self._on(trial, piece, k)
        if found is None:
            return None
        norm = self.norm(trial.t1, trial.z, k)
        inward = self._inward(trial, found, noise[k], k)
        if inward and inward <= epsilon * norm:
            piece = trial.cubic()
            found = self._on(trial, piece, k) or found
            inward = self._inward(trial, found, noise[k], k)
        if inward:
            return StepFailure("inward", k)
        theta, time, q = found
        if not self.kernel.conditions[k](time, *q)[0]:
            on = theta == 0 or k in self.active
            if not (on and next_(k, *self._after_hop(trial, piece, found, k, values[k]))):
                return None
        if failure := self._too_deep(trial, values, noise, k, epsilon):
            return failure
        if self._deeper_before(trial, piece, theta, k, values[k] + noise[k]):
            return StepFailure("deep", k)
        return Crossing(k, theta, time, q, min(epsilon, values[k] / norm), shortened(piece, theta))

    def _may_be_beyond(self, k: int) -> bool:
        """Whether a state may be beyond surface k without having crossed it."""
        return k in self.emerging or k >= len(self.edges) or self.edges[k].conditional

    def _deeper_before(self, trial: Trial, piece: Polynomial, theta: Number, k: int, end: Number) -> bool:
        """Whether a step was further beyond surface k between the crossing and its end: the end is on another flank."""
        for i in range(1, SCAN):
            s = theta + (1 - theta) * i / SCAN
            if self.kernel.surfaces(trial.t + s * trial.h, *at(trial.x, piece, s))[k] > end:
                return True
        return False

    def _inward(self, trial: Trial, found: tuple[Number, Number, State], noise: Number, k: int) -> Number:
        """How far the flow at q would take r back inside over this step; 0 when not beyond round-off."""
        _, time, q = found
        back = -self.kernel.rates[k](time, *q)[0] * trial.h
        return back if back > noise else self.arithmetic.zero

    def _after_hop(
        self, trial: Trial, piece: Polynomial, found: tuple[Number, Number, State], k: int, end: Number
    ) -> tuple[Number, State]:
        """Where the flow comes back to surface k, which it is on, after a hop that round-off hides; r ends at that."""
        theta, time, q = found
        back = -self.kernel.rates[k](time, *q)[0] * trial.h
        if not back > 0:
            return time, q
        s = theta + (1 - theta) * (back / (back + end))
        return trial.t + s * trial.h, at(trial.x, piece, s)

    def _smallest(self, trial: Trial, k: int) -> Number:
        """How close to zero a crossing of this step can be located: round-off of its own numbers, no older ones."""
        sizes = tuple(max(abs(a), abs(b)) for a, b in zip(trial.x, trial.z, strict=True))
        return self.roundoff_bound(k, trial.t1, sizes) * ROOT_SHARE

    def _on(self, trial: Trial, piece: Polynomial, k: int) -> tuple[Number, Number, State] | None:
        """Return (theta, time, state) of the last up-crossing on ``piece``; None if r was beyond all along."""

        def value(theta: Number) -> Number:
            return self.kernel.surfaces(trial.t + theta * trial.h, *at(trial.x, piece, theta))[k]

        theta = last_up_crossing(value, self._smallest(trial, k), self.arithmetic)
        if theta is None:
            if self._may_be_beyond(k) and value(self.arithmetic.zero) > self.roundoff_bound(k, trial.t, trial.x):
                return None
            theta = self.arithmetic.zero  # on the surface to round-off: it is crossed as the step begins
        if theta == 0:
            return theta, trial.t, trial.x
        return theta, trial.t + theta * trial.h, at(trial.x, piece, theta)


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


def close_bracket(
    value: Callable[[Number], Number],
    low: tuple[Number, Number],
    high: tuple[Number, Number],
    small: Number,
    unit: Number,
) -> Number:
    """Close a bracket value(low) <= 0 < value(high) (Illinois; Dowell and Jarratt 1971, doi:10.1007/BF01934364)."""
    (a, fa), (b, fb) = low, high
    weight_a, weight_b, side = fa, fb, 0
    for _ in range(ROOT_ITERATIONS):
        if -fa <= small or b - a <= 4 * unit:
            return a
        if fb <= small:
            return b
        s = a - weight_a * (b - a) / (weight_b - weight_a)
        s = s if a < s < b else (a + b) / 2
        f = value(s)
        if f <= 0:
            weight_b = weight_b / 2 if side < 0 else weight_b
            a, fa, weight_a, side = s, f, f, -1
        else:
            weight_a = weight_a / 2 if side > 0 else weight_a
            b, fb, weight_b, side = s, f, f, 1
    return a
