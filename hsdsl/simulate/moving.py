"""A run moved by its round-off, which errors are measured by: where it starts, its resets and its flow.

Two runs of the same routines share what these round. So the finer run that another one is held against is moved by it:
parameters, samples of inputs, initial values and results of resets by their rounding, which is known with its sign, and
states along the flow by the most that rounding of its terms may do. The moves grow and fade as the run has it.

Each is at least to the next number where a result is not exact. Of the flow only what exceeds the least error of a
state counts: less is in the last digits of every step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.integrators.stepper import State
from hsdsl.kernel import Kernel
from hsdsl.roundoff import exactly, following, moved
from hsdsl.simulate.input_segments import Timeline

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
    return tuple(
        a + side(i) * (h * e) if h * e > ERROR_UNITS * kernel.arithmetic.unit * max(s, abs(a)) else a
        for i, (a, e, s) in enumerate(zip(x, off, scales, strict=True))
    )


def side(state: int) -> int:
    """Which way a state is moved along the flow: no two, four, eight, ... states after each other go the same ways."""
    return -1 if state.bit_count() % 2 else 1


def moved_time(time: Number, exact: Number, tie: Number) -> Number:
    """The time of a sample, moved where that makes another instant of it."""
    return exact if abs(exact - time) > tie else time
