"""Geometry of a trial step against a mode's surfaces: round-off, depth, and where a surface was crossed.

The depth of a point beyond a surface is tau = r / |grad r| with the gradient in (t, x); the crossing is looked for on
the step's interpolant, never on the flow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from hsdsl.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.integrators.stepper import Polynomial, Stages, State, Stepper, hermite
from hsdsl.kernel import ModeKernel, Vector
from hsdsl.program import EdgeProgram

ROUNDOFF_UNITS = 32
TIE = 1e-12  # times closer than TIE max(1, |t|) are the same instant
SCAN = 8  # pieces in which a step's interpolant is searched for its last up-crossing
ROOT_ITERATIONS = 200
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
class Obstacle:
    """Why a trial step ends outside the relaxed domain."""

    kind: Literal["wall", "deep", "flat", "inward", "not finite", "error", "creeping"]
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
    def end(self) -> State | None:
        """The flow at the step's end; None where it has no finite value (beyond a guard it need not have one)."""
        try:
            end = self.flow(self.t1, *self.z)
        except DOMAIN_ERRORS:
            return None
        return end if sum(end) - sum(end) == 0 else None

    @cached_property
    def piece(self) -> Polynomial:
        """The step's interpolant."""
        if self.end is None:
            return (tuple(b - a for a, b in zip(self.x, self.z, strict=True)),)
        return self.stepper.piece(self.h, self.x, self.z, self.stages, self.slope, self.end)

    def cubic(self) -> Polynomial:
        """The cubic Hermite interpolant, whatever the method."""
        return self.piece if self.end is None else hermite(self.h, self.x, self.z, self.slope, self.end)


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


def roundoff(unit: Number, magnitude: Number, gradient: Vector, x: State, scale: State) -> Number:
    """Below this a surface value counts as zero: 32 u (|L| + |R| + sum |dr/dx_i| |x_i|).

    ``scale`` holds the sizes of the numbers a state was computed from (see `Here.scale`): a state that a reset or a
    cancellation made small carries the round-off of what made it.
    """
    total = magnitude
    for g, a, s in zip(gradient[1:], x, scale, strict=True):
        total = total + abs(g) * max(abs(a), s)
    return ROUNDOFF_UNITS * unit * total


@dataclass(frozen=True)
class Surfaces:
    """A mode's surfaces with what is needed to judge a point: routines, edges, entry scale, number type."""

    kernel: ModeKernel
    edges: tuple[EdgeProgram, ...]
    scale: State
    arithmetic: Arithmetic

    def noise(self, t: Number, x: State) -> list[Number]:
        """Round-off of every surface at a point."""
        magnitudes, gradients = self.kernel.magnitudes(t, *x), self.kernel.gradients(t, *x)
        unit = self.arithmetic.unit
        return [roundoff(unit, m, g, x, self.scale) for m, g in zip(magnitudes, gradients, strict=True)]

    def norm(self, t: Number, x: State, surface: int) -> Number:
        """|grad r| in (t, x)."""
        total = self.arithmetic.zero
        for g in self.kernel.gradients(t, *x)[surface]:
            total = total + g * g
        return self.arithmetic.sqrt(total)

    def judge(self, trial: Trial, values: Vector, epsilon: Number) -> list[Crossing] | Obstacle:
        """Say whether a trial's end is in the relaxed domain: inside (no crossing), in strips, or neither.

        Raises one of ``DOMAIN_ERRORS`` where a surface or condition has no finite value on the way.
        """
        noise = self.noise(trial.t1, trial.z)
        beyond = [k for k, r in enumerate(values) if not r <= noise[k]]
        for k in beyond:
            if k >= len(self.edges):
                return Obstacle("wall", k)
            if not self.edges[k].conditional and (obstacle := self._too_deep(trial, values, noise, k, epsilon)):
                return obstacle
        crossings: list[Crossing] = []
        for k in beyond:
            found = self._crossing(trial, values, noise, k, epsilon)
            if isinstance(found, Obstacle):
                return found
            if found is not None:
                crossings.append(found)
        return crossings

    def _too_deep(self, trial: Trial, values: Vector, noise: list[Number], k: int, epsilon: Number) -> Obstacle | None:
        norm = self.norm(trial.t1, trial.z, k)
        if not norm > 0:
            return Obstacle("flat", k)
        return None if values[k] <= epsilon * norm + noise[k] else Obstacle("deep", k)

    def _crossing(
        self, trial: Trial, values: Vector, noise: list[Number], k: int, epsilon: Number
    ) -> Crossing | Obstacle | None:
        """Find the last up-crossing of surface k on the interpolant; None where the surface is transparent there."""
        piece = trial.piece
        found = self._on(trial, piece, noise[k], k)
        if found is None:
            return None
        norm = self.norm(trial.t1, trial.z, k)
        inward = self._inward(trial, found, noise[k], k)
        if inward and inward <= epsilon * norm:
            piece = trial.cubic()
            found = self._on(trial, piece, noise[k], k) or found
            inward = self._inward(trial, found, noise[k], k)
        if inward:
            return Obstacle("inward", k)
        theta, time, q = found
        if not self.kernel.conditions(time, *q)[k]:
            return None
        if obstacle := self._too_deep(trial, values, noise, k, epsilon):
            return obstacle
        return Crossing(k, theta, time, q, min(epsilon, values[k] / norm), shortened(piece, theta))

    def _inward(self, trial: Trial, found: tuple[Number, Number, State], noise: Number, k: int) -> Number:
        """How far the flow at q would take r back inside over this step; 0 when not beyond round-off."""
        _, time, q = found
        back = -self.kernel.rates(time, *q)[k] * trial.h
        return back if back > noise else self.arithmetic.zero

    def _on(self, trial: Trial, piece: Polynomial, noise: Number, k: int) -> tuple[Number, Number, State] | None:
        """Return (theta, time, state) of the last up-crossing on ``piece``; None if r was beyond all along."""

        def value(theta: Number) -> Number:
            return self.kernel.surfaces(trial.t + theta * trial.h, *at(trial.x, piece, theta))[k]

        theta = last_up_crossing(value, noise * ROOT_SHARE, self.arithmetic)
        if theta is None:
            if self.edges[k].conditional and value(self.arithmetic.zero) > self.noise(trial.t, trial.x)[k]:
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
