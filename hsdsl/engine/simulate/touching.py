"""A guard that the flow reaches and has no value beyond, as that of an empty tank: h' = -sqrt(h) with h <= 0.

The execution comes to the surface tangentially, in finite time. A step's polynomial ends there, or turns back there as
the equation does not: at its end the flow still leads towards the surface.
"""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.dense_steps import Span
from hsdsl.engine.simulate.root_isolation import total
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surface_polynomials import Piece, slope_of
from hsdsl.engine.simulate.surfaces import ROUNDOFF_UNITS, Crossing, at

TURNINGS = 60  # halvings of a step


def touched(run: Run, here: ModeState, span: Span, k: int, pieces: list[Piece]) -> Crossing | None:
    """Return where in a step surface k is reached so and its condition holds, on the step's own polynomial."""
    c, one = pieces[0].coefficients, run.arithmetic.zero + 1
    if not c[1] > 0 or len(pieces) > 1 or run.control.tolerance is None:
        return None
    share, time, q, slope = one, span.t1, span.z, slope_of(c, one)
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
        low, high = (middle, high) if slope_of(c, middle) > 0 else (low, middle)
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
