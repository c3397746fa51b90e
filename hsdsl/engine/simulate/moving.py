"""A run moved by its round-off, which errors are measured by: where it starts, its resets and its flow.

Two runs of the same routines share what these round. So the finer run that another one is held against is moved by it:
parameters, samples of inputs, initial values and results of resets by their rounding, which is known with its sign;
states along the flow by the most that rounding of its terms may do, and crossings by that of their surface. The moves
grow and fade as the run has it.

Each is at least to the next number where a result is not exact. Of flows and surfaces only what exceeds the least error
of a state counts: less is in the last digits of every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.base.numbers.roundoff import exactly, following, moved
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import Kernel
from hsdsl.engine.simulate.input_segments import Timeline

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
    """The state behind a reset, moved by its round-off; None where that is not known."""
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
