"""The scales of states along a run: what errors are held against, and what counts as moving.

See `hsdsl.engine.integrators.stepper`. What a flow is computed from is looked at only where a step would be rejected
for the second time.
"""

from __future__ import annotations

from collections.abc import Sequence

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.integrators.linear import Vector
from hsdsl.engine.integrators.stepper import State, Stepper, resolved, rows_of
from hsdsl.engine.simulate.root_isolation import total
from hsdsl.engine.simulate.run import ModeState, Run


def error_ratio(
    run: Run, here: ModeState, method: Stepper, error: State, t: Number, h: Number, x: State, z: State
) -> Number:
    """Error ratio of a step from (t, x) to z; at most 1 is acceptable."""
    control, had = run.control, here.arc.scales
    scales: Sequence[Number] = had if method.scales is None else method.scales(False)
    ratio = control.ratio(h, error, z, scales, had)
    if not ratio > 1 or not control.looks_closer(t):
        return ratio
    try:
        if method.scales is not None:
            scales = method.scales(True)
        else:
            terms = run.kernel.terms(here.flow, here.segment.data)
            scales = resolved(here.kernel.flow, t, h, x, scales, None, run.arithmetic, control.tolerance, terms)
    except DOMAIN_ERRORS:
        return ratio
    ratio = control.ratio(h, error, z, scales, had)
    control.closer = ratio <= 1
    return ratio


def flow_sizes(run: Run, here: ModeState, slope: State) -> Vector:
    """For each state the size that its flow has had, |f| + sum |df/dx_j| s_j: below round-off of it, it is at rest."""
    mode, scales = here.flow, here.sizes
    found: Vector = []
    rows = rows_of(run.kernel.jacobian(mode, here.segment.data)(here.t, *here.x), len(here.x))
    for f, row in zip(slope, rows, strict=True):
        total = abs(f)
        for d, s in zip(row, scales, strict=True):
            total = total + abs(d) * s
        found.append(total)
    return found


def start_sizes(run: Run, mode: int, x: State) -> State:
    """The sizes that the flow gives the states within the run, from a start at x in a mode with motion along guards.

    A start on a guard is off it by the round-off of these. Elsewhere they are zero.
    """
    program, segment, zero = run.program.modes[mode], run.timeline.at(run.arithmetic.zero), run.arithmetic.zero
    nothing = tuple(zero for _ in x)
    if program.held is None:
        return nothing
    try:
        slope = run.kernel.bind(mode, segment.data).flow(zero, *x)
        rows = rows_of(run.kernel.jacobian(mode, segment.data)(zero, *x), len(x))
    except DOMAIN_ERRORS:
        return nothing
    back = zero
    for i, row in enumerate(rows):
        back = max(back, total((abs(d) * abs(rows[k][i]) for k, d in enumerate(row)), zero))
    time = run.settings.until / (1 + run.settings.until * run.arithmetic.sqrt(back))  # in which motion turns back
    first = tuple(max(abs(a), time * abs(f)) for a, f in zip(x, slope, strict=True))
    moved = (time * total((abs(d) * s for d, s in zip(row, first, strict=True)), zero) for row in rows)
    found = tuple(map(max, first, moved))
    return found if all(map(run.arithmetic.isfinite, found)) else nothing
