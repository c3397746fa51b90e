"""Rest on a guard: a state that its own reset keeps in place while the flow pushes it out (M11).

At such a point q the reset is the identity, the target is the same mode, and the flow leaves the domain in the
direction that the reset takes back, and in no other. The execution stays there until the flow no longer pushes out.
"""

from __future__ import annotations

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.simulate.cascade import takes_back
from hsdsl.simulate.root_isolation import total
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.scales import flow_sizes, instant

SAME_UNITS = 4  # of round-off, relative to its scale: how far a reset may move a state that rests
ZERO_UNITS = 16  # of round-off: a rate that counts as zero


def rests(run: Run, here: ModeState) -> int | None:
    """Return the edge on whose guard the state rests; None where it moves."""
    if not here.surfaces.active or here.mode.states != here.arc.states:
        return None
    mode = run.program.modes.index(here.mode)
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
    series = run.kernel.taylor(run.program.modes.index(here.mode), here.segment.data)
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
