"""Rest on a guard: a state that its own reset keeps in place while the flow pushes it out (M11), and its steps.

At such a point q the reset is the identity, the target is the same mode, and the flow leaves the domain in the
direction that the reset takes back, and in no other. The execution stays there until the flow no longer pushes out.
Time and inputs go on, so that other surfaces may be crossed: they are followed along steps as along those of a flow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.integrators.stepper import State
from hsdsl.simulate.cascade import takes_back
from hsdsl.simulate.control import LARGEST_SHARE
from hsdsl.simulate.dense_steps import Span, sizes_along
from hsdsl.simulate.interpolation import OVER_TIME
from hsdsl.simulate.relaxed import ALMOST, NOT_FINITE
from hsdsl.simulate.root_isolation import total
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.scales import flow_sizes, instant
from hsdsl.simulate.surface_polynomials import curves_along, interpolated, rises_along
from hsdsl.simulate.surfaces import StepFailure

SAME_UNITS = 4  # of round-off, relative to its scale: how far a reset may move a state that rests
ZERO_UNITS = 16  # of round-off: a rate that counts as zero
CORRECTIONS = 8  # of the root of a push
LOOKS = 8  # in a step, at what may end a rest between one moment and the next


def rests(run: Run, here: ModeState) -> int | None:
    """Return the edge on whose guard the state rests; None where it moves."""
    if not here.surfaces.active or here.mode.states != here.arc.states:
        return None
    mode = here.index
    for k in sorted(here.surfaces.active):
        if k < len(here.mode.edges) and here.mode.edges[k].target == mode:
            try:
                if stays(run, here, k) and is_pushed(run, here, k) and moves_alone(run, here, k):
                    return k
            except DOMAIN_ERRORS:
                continue
    return None


def stays(run: Run, here: ModeState, k: int) -> bool:
    """Whether edge k is possible and its reset leaves the state where it is, on a surface that does not move."""
    t, x, kernel = here.t, here.x, here.kernel
    after = kernel.resets[k](t, *x)
    still = all(abs(a - b) <= noise for a, b, noise in zip(after, x, _noise(run, here), strict=True))
    return still and kernel.gradients[k](t, *x)[0] == 0 and bool(kernel.conditions[k](t, *x)[0])


def _noise(run: Run, here: ModeState) -> list[Number]:
    return [SAME_UNITS * run.arithmetic.unit * s for s in here.arc.scales]


def is_pushed(run: Run, here: ModeState, k: int) -> bool:
    """Whether the flow leaves the domain through surface k: by its rate, or where that is zero by the next one."""
    order = push_order(run, here, k)
    return order is not None and push(run, here, k, order, here.t) > 0


def push_order(run: Run, here: ModeState, k: int) -> int | None:
    """Which derivative of the surface along the flow decides; None where the first one points inwards."""
    slope, gradient = here.kernel.flow(here.t, *here.x), here.kernel.gradients[k](here.t, *here.x)
    rate = here.kernel.rates[k](here.t, *here.x)[0]
    sizes = flow_sizes(run, here, slope)
    size = total((abs(g) * f for g, f in zip(gradient[1:], sizes, strict=True)), run.arithmetic.zero)
    if abs(rate) <= ZERO_UNITS * run.arithmetic.unit * size:
        return 2
    return 1 if rate > 0 else None


def push(run: Run, here: ModeState, k: int, order: int, t: Number) -> Number:
    """The first or second derivative of surface k along the flow from the present state, at time t."""
    x, kernel = here.x, here.kernel
    if order == 1:
        return kernel.rates[k](t, *x)[0]
    series = run.kernel.taylor(here.index, here.segment.data)
    row = None if series is None else series.surfaces(2, series.flow(2, t, x))[k]
    if row is not None:
        return 2 * row[2]
    slope = kernel.flow(t, *x)  # a kinked flow has no second derivative at hand: the rate's difference along it
    small = instant(run, here, slope)
    ahead = tuple(a + small * f for a, f in zip(x, slope, strict=True))
    return (kernel.rates[k](t + small, *ahead)[0] - kernel.rates[k](t, *x)[0]) / small


def moves_alone(run: Run, here: ModeState, k: int) -> bool:
    """Whether the flow moves the state only in the direction that the reset takes back."""
    t, x = here.t, here.x
    slope = here.kernel.flow(t, *x)
    if not any(slope):
        return False
    sizes, small = flow_sizes(run, here, slope), instant(run, here, slope)
    ahead = tuple(a + small * f for a, f in zip(x, slope, strict=True))
    back = tuple(a - b for a, b in zip(here.kernel.resets[k](t, *ahead), ahead, strict=True))
    return takes_back(slope, back, sizes, _noise(run, here))


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
