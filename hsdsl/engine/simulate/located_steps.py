"""Steps of the located scheme, as long as their error allows, each with the polynomials of its surfaces.

They are made by a Runge-Kutta or implicit method (`TableSteps`), or by Taylor's (`SeriesSteps`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.integrators.radau import NoConvergence
from hsdsl.engine.integrators.stepper import Polynomial, Stages, State
from hsdsl.engine.integrators.taylor import proposed_step
from hsdsl.engine.kernel import Series
from hsdsl.engine.scheme.control import accept, begin_steps, reject, struggles
from hsdsl.engine.scheme.pace import count_creeping
from hsdsl.engine.scheme.polynomials import value_of
from hsdsl.engine.simulate.control import (
    NOT_FINITE,
    TOO_FAST,
    TOO_WRONG,
    UNSOLVED,
    StepFailure,
    end_of_step,
    error_ratio,
)
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.settings import UNKNOWN_TOLERANCE
from hsdsl.engine.simulate.stalls import across_jump, make_pace
from hsdsl.engine.simulate.surfaces import Curves, Piece, TooFast, at, curves_along, settles, shortened, without_zeros

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
            h, t1 = end_of_step(t, h, limit)
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
            h, t1 = end_of_step(t, h, limit)
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
