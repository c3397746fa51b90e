"""A state at rest over time (M11): how long its guard holds it, and the steps of that time.

The state does not move, but time and inputs go on, so that other surfaces may be crossed: they are followed along steps
as they are along those of a flow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.integrators.stepper import State
from hsdsl.simulate.control import LARGEST_SHARE
from hsdsl.simulate.curves import curves_along
from hsdsl.simulate.dense_steps import Span, sizes_along
from hsdsl.simulate.interpolation import OVER_TIME
from hsdsl.simulate.relaxed import ALMOST, NOT_FINITE
from hsdsl.simulate.rest import moves_alone, push, push_order, stays
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.surface_polynomials import interpolated, rises_along
from hsdsl.simulate.surfaces import StepFailure

CORRECTIONS = 8  # of the root of a push
LOOKS = 8  # in a step, at what may end a rest between one moment and the next


def release(run: Run, here: ModeState, k: int) -> Number | None:
    """Return until when the guard of edge k holds the state, at most to the end of the inputs' segment.

    None where it is not held for any time, or something has no value later on: then transitions go on as they can.
    """
    t, end = here.t, here.segment.end
    try:
        order = push_order(run, here, k)
        assert order is not None
        while t < end:
            t1 = min(t + longest(run), end)
            released = pushed_until(run, here, k, order, t, t1)
            if (kept := kept_until(run, here, k, t, released)) < t1:
                return kept if kept > here.t else None
            t = t1
    except DOMAIN_ERRORS:
        return None
    return end


def longest(run: Run) -> Number:
    """The longest step over a state at rest."""
    return run.settings.until * LARGEST_SHARE


def pushed_until(run: Run, here: ModeState, k: int, order: int, start: Number, end: Number) -> Number:
    """When the push falls through zero: isolated on an interpolant over time, then solved on the push itself."""
    width = end - start

    def inward(s: Number) -> State:
        return (-push(run, here, k, order, start + s * width),)

    degree, share = OVER_TIME
    pieces = interpolated(inward, 1, degree, lambda _: run.arithmetic.zero, share, run.arithmetic, far=False)[0]
    rise = next(rises_along(pieces, run.arithmetic.zero, False, False, run.arithmetic.unit), None)
    if rise is None:
        return end
    s = rise.share
    for _ in range(CORRECTIONS):
        s = min(s * 0 + 1, max(s * 0, s - inward(s)[0] / rise.slope)) if rise.slope != 0 else s
    return start + s * width


def kept_until(run: Run, here: ModeState, k: int, start: Number, end: Number) -> Number:
    """When the edge or its reset no longer keeps the state in place, as where its `if` ends: by looks, then halving."""

    def keeps(t: Number) -> bool:
        later = here.moved(t, here.x)
        return stays(run, later, k) and moves_alone(run, later, k)

    last = start
    for i in range(1, LOOKS + 1):
        t = start + (end - start) * i / LOOKS
        if not keeps(t):
            return _change(keeps, last, t)
        last = t
    return end


def _change(keeps: Callable[[Number], bool], last: Number, t: Number) -> Number:
    """Close in on the first time from which a state is no longer kept."""
    while last < (middle := (last + t) / 2) < t:
        last, t = (middle, t) if keeps(middle) else (last, middle)
    return t


@dataclass(frozen=True)
class RestSteps:
    """Steps over a state at rest."""

    run: Run
    here: ModeState

    def next(self, t: Number, x: State, limit: Number) -> Span | StepFailure:
        """Make one step, shorter where surfaces vary too fast for one."""
        run, zero = self.run, self.run.arithmetic.zero
        piece, h = (tuple(zero for _ in x),), longest(run)
        while True:
            h, t1 = (h, t + h) if h < (limit - t) * ALMOST else (limit - t, limit)
            if not t1 > t:
                return NOT_FINITE
            try:
                curves = curves_along(run, self.here, t, h, x, x, piece)
                ends = self.here.kernel.surfaces(t1, *x)
                break
            except DOMAIN_ERRORS:
                h = h / 2

        def point(s: Number) -> tuple[Number, State]:
            return t1 if s == 1 else t + s * h, x

        def sizes(s: Number) -> State:
            return sizes_along(x, piece, s)

        return Span(t, h, t1, x, x, piece, curves, ends, point, lambda _: piece, sizes)
