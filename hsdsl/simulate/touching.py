"""A guard that the flow reaches and has no value beyond, as that of an empty tank: h' = -sqrt(h) with h <= 0.

The execution comes to the surface tangentially, in finite time. A step's polynomial turns back there, as the equation
does not: at its end the flow still leads towards the surface.
"""

from __future__ import annotations

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.integrators.stepper import State
from hsdsl.simulate.along import Piece, slope_of
from hsdsl.simulate.isolate import total
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.spans import Span
from hsdsl.simulate.surfaces import Crossing, at

TURNINGS = 60  # halvings of a step


def touched(run: Run, here: Here, span: Span, k: int, pieces: list[Piece]) -> Crossing | None:
    """Return where in a step surface k is reached so and its condition holds, on the step's own polynomial."""
    c, one = pieces[0].coefficients, run.arithmetic.zero + 1
    if not c[1] > 0 or len(pieces) > 1 or run.control.tolerance is None or not slope_of(c, one) < 0:
        return None
    if not here.kernel.rates[k](span.t1, *span.z)[0] > 0:
        return None
    low, high = one * 0, one
    for _ in range(TURNINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if slope_of(c, middle) > 0 else (low, middle)
    time, q = span.t + low * span.h, at(span.x, span.piece, low)
    if not ends_at(run, here, k, time, q):
        return None
    holds = k >= len(here.mode.edges) or here.kernel.conditions[k](time, *q)[0]
    return Crossing(k, low, time, q, run.arithmetic.zero) if holds else None


def ends_at(run: Run, here: Here, k: int, time: Number, q: State) -> bool:
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
