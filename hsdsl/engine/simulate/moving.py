"""The finer run that another one is compared with: its settings, and how its round-off moves it.

The difference of the two runs estimates the error of the first. The tolerance falls to a tenth, so the finer run is
wrong by about a tenth of what the run is. Steps that the tolerance does not bound become shorter in the same way: the
run's longest step, and with `located` the first one of each arc of flow, which a transition or a sample of an input may
have cut. A fixed step becomes two fifths of itself; a method of order 1 needs a fifth, or the difference would be no
larger than the error of the finer run. It is no half: steps that the relaxed scheme halves would be those of the finer
run, and both wrong in the same way. The relaxed scheme's strips shrink to a tenth: the delay of a transition is known
only up to a factor. Below round-off the other run is coarser instead, and the difference is that much larger than the
error.

Two runs of the same routines share what these round. So the finer run is moved by it: parameters, samples of inputs,
initial values and results of resets by their rounding, which is known with its sign; states along the flow by the most
that rounding of its terms may do, and crossings by that of their surface. The moves grow and fade as the run has it.
Each is at least to the next number where a result is not exact. Of flows and surfaces only what exceeds the least error
of a state counts: less is in the last digits of every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.base.numbers.roundoff import exactly, following, moved
from hsdsl.engine.execution import Execution
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import Kernel
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.settings import Settings

ERROR_UNITS = 64  # of the size of a state: no error is smaller


@dataclass(frozen=True)
class Start:
    """Where a run starts that is moved by its round-off, and its parameters and inputs."""

    x: State
    timeline: Timeline

    @property
    def data(self) -> tuple[Number, ...]:
        """What routines are bound to at the start."""
        return self.timeline.segments[0].data


def moved_reset(kernel: Kernel, mode: int, k: int, data: Sequence[Number], t: Number, q: State) -> State | None:
    """The state after a reset, moved by its round-off; None where that is not known."""
    arithmetic = following(kernel.arithmetic, traced=True)
    try:
        resets = kernel.over(arithmetic).bind(mode, list(exactly(arithmetic, data))).resets
        found = tuple(map(moved, resets[k](*exactly(arithmetic, (t, *q)))))
    except DOMAIN_ERRORS:
        return None
    return found if all(map(kernel.arithmetic.isfinite, found)) else None


def surface_roundoff(kernel: Kernel, mode: int, k: int, data: Sequence[Number], t: Number, x: State) -> Number:
    """What surface k is beyond its value, by its round-off; zero where that is not known."""
    arithmetic, zero = following(kernel.arithmetic, traced=True), kernel.arithmetic.zero
    try:
        of = kernel.over(arithmetic).bind(mode, list(exactly(arithmetic, data)))
        surface = of.surfaces(*exactly(arithmetic, (t, *x)))[k]
    except DOMAIN_ERRORS:
        return zero
    beyond = surface.error - surface.off if surface.error < 0 else surface.error + surface.off
    return beyond if kernel.arithmetic.isfinite(beyond) else zero


def moved_crossing(
    kernel: Kernel, mode: int, k: int, data: Sequence[Number], t: Number, q: State, scales: Sequence[Number]
) -> State:
    """The state that crosses surface k, moved along the flow to where it does so but for the surface's round-off."""
    here = kernel.bind(mode, data)
    try:
        rate, flow = here.rates[k](t, *q)[0], here.flow(t, *q)
    except DOMAIN_ERRORS:
        return q
    late = -surface_roundoff(kernel, mode, k, data, t, q) / rate if rate > 0 else 0
    by = [late * f for f in flow]
    return tuple(a + e if _counts(kernel, e, a, s) else a for a, e, s in zip(q, by, scales, strict=True))


def _counts(kernel: Kernel, by: Number, a: Number, size: Number) -> bool:
    """Whether a state moves by more than the least error of one."""
    return abs(by) > ERROR_UNITS * kernel.arithmetic.unit * max(size, abs(a))


def flow_roundoff(kernel: Kernel, mode: int, data: Sequence[Number], t: Number, x: State) -> list[Number] | None:
    """The most that rounding may change each component of a flow by; None where it has no bound."""
    arithmetic = following(kernel.arithmetic, traced=False)
    try:
        flow = kernel.over(arithmetic).bind(mode, list(exactly(arithmetic, data))).flow(*exactly(arithmetic, (t, *x)))
    except DOMAIN_ERRORS:
        return None
    off = [f.off for f in flow]
    return off if all(map(isfinite, off)) else None


def moved_by_flow(
    kernel: Kernel, mode: int, data: Sequence[Number], t: Number, x: State, h: Number, scales: Sequence[Number]
) -> State:
    """A state moved by what rounding of the flow may do in a time h."""
    off = flow_roundoff(kernel, mode, data, t, x)
    if off is None:
        return x
    by = [h * e for e in off]
    return tuple(
        a + side(i) * e if _counts(kernel, e, a, s) else a
        for i, (a, e, s) in enumerate(zip(x, by, scales, strict=True))
    )


def side(state: int) -> int:
    """Which way a state is moved along the flow: no two, four, eight, ... states after each other go the same ways."""
    return -1 if state.bit_count() % 2 else 1


def moved_time(time: Number, exact: Number, tie: Number) -> Number:
    """The time of a sample, moved where that makes another instant of it."""
    return exact if abs(exact - time) > tie else time


FINER = 10
LEAST_UNITS = 32  # of round-off: a tolerance that a finer run may still have


def finer_settings(settings: Settings, execution: Execution, arithmetic: Arithmetic) -> Settings:
    """Return the settings of the run to compare an execution with."""
    finer = replace(settings, moves=True)
    if settings.scheme != "located":
        finer = replace(finer, relaxation=settings.relaxation / FINER)
    if settings.step is not None:
        first = settings.method is not None and settings.method.order == 1
        return replace(finer, step=settings.step * (1 if first else 2) / 5)
    assert settings.tolerance is not None
    smaller = settings.tolerance / FINER
    tolerance = smaller if smaller >= LEAST_UNITS * arithmetic.unit else settings.tolerance * FINER
    method = settings.method
    assert method is not None
    share = float(FINER) ** (-1 / method.order)
    table, steps = execution.arc_table, np.append(np.diff(execution.times), 0)
    longest: list[Number] = (
        np.maximum.reduceat(steps, table.first)[table.kind == "flow"].tolist() if len(table.first) else []
    )
    bounds: list[Number] = [share * step for step in longest]  # of arcs of flow
    finer = replace(finer, longest_step=max(bounds, default=0) or None)
    if settings.scheme == "located":
        finer = replace(finer, first_steps=bounds)
    return replace(finer, tolerance=tolerance, method=method.for_tolerance(tolerance, arithmetic))
