"""What `method: auto` is, for one run: chosen before it starts, from the expressions and from the start's surroundings.

With a fixed step it is the table `dopri5`. With a tolerance it is

========= ============================================================================================
`radau`   where the mode of the start, or one that its edges lead to, is stiff (below)
`taylor`  where every flow is smooth
`dopri5`  where one has `abs`, `sign`, `min`, `max` or `floor` of a state, or no derivatives at the start
========= ============================================================================================

A mode is called stiff where both hold, near the start, once what decays fast has decayed:

- the fastest decay, the largest -Re of an eigenvalue of the flow's Jacobian that does not oscillate faster than it
  decays, would alone keep an explicit method to :data:`LEAST_STEPS` steps until the end;
- the curve there is straight, to a hundredth of 1 + |x|, for at least :data:`APART` times of that decay.

To get there a few linearly implicit Euler steps are made, as long as the fast decay: guards do not count in them, and
what lies far from the start is not seen. With a precision asked for nothing is looked at, and no stiffness is found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Array
from hsdsl.integrators import AUTO, METHODS, Method, TaylorMethod
from hsdsl.kernel import Kernel
from hsdsl.program import Program
from hsdsl.simulate import Settings
from hsdsl.simulate.timeline import Timeline

LEAST_STEPS = 1000
REACH = 3.3  # the length of an explicit step, in times of decay, that is still stable (dopri5 on the real axis)
APART = 100
SETTLING_STEPS, SETTLING_LENGTH = 32, 2.0  # steps, and their length in times of decay
MOST_STATES, MOST_MODES = 100, 8  # a larger Jacobian, or more modes, take longer to look at than to run


@dataclass(frozen=True)
class Stiffness:
    """Where a decay is fast beside what happens: its time, and for how long the curve is straight to a hundredth."""

    mode: str
    decay: float
    straight: float

    def __str__(self) -> str:
        fast = f"{self.mode} is stiff near the start: something decays within {self.decay:.2g}"
        return fast + (f", the curve is straight for {self.straight:.2g}" if isfinite(self.straight) else ", to rest")


def chosen(
    settings: Settings, program: Program, kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]
) -> Settings:
    """Return the settings with the method that `auto` is for them, and why."""
    method, why = _chosen(settings, program, kernel, timeline, mode, x)
    if isinstance(method, TaylorMethod):
        method = method.for_tolerance(settings.tolerance, kernel.arithmetic)
    return replace(settings, method=method, method_chosen=f"{method.name}: {why}")


def _chosen(
    settings: Settings, program: Program, kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]
) -> tuple[Method, str]:
    if settings.tolerance is None:
        return METHODS[AUTO], "the step is fixed"
    if kernel.arithmetic.digits is None:
        near = list(_near(program, mode, len(x)))
        for k in near:
            stiff = stiffness(kernel, timeline, program.modes[k].name, k, x, float(settings.until))
            if stiff is not None:
                return METHODS["radau"], str(stiff)
        if mode in near and not _has_derivatives(kernel, timeline, mode, x):
            return METHODS[AUTO], f"the flow of {program.modes[mode].name} has no derivatives at the start"
    for each in program.modes:
        if each.tape is None:
            return METHODS[AUTO], f"the flow of {each.name} has abs, sign, min, max or floor of a state"
    return METHODS["taylor"], "every flow is smooth, and none was seen to be stiff"


def _has_derivatives(kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]) -> bool:
    """Whether the flow has finite derivatives at the start: the square root of 0 has none, and so no Taylor series."""
    try:
        return bool(np.isfinite(_Look(kernel, timeline, mode).jacobian(0.0, np.array(x, float))).all())
    except DOMAIN_ERRORS:
        return False


def _near(program: Program, mode: int, states: int) -> Iterator[int]:
    """The mode of the start and those its edges lead to, where they have as many states: x is a point of theirs."""
    if states == 0 or states > MOST_STATES:
        return
    targets = dict.fromkeys((mode, *(edge.target for edge in program.modes[mode].edges)))
    yield from [k for k in targets if len(program.modes[k].states) == states][:MOST_MODES]


def stiffness(
    kernel: Kernel, timeline: Timeline, name: str, mode: int, x: Sequence[Number], until: float
) -> Stiffness | None:
    """Return how stiff a mode is near x at t = 0, None where it is not."""
    try:
        look = _Look(kernel, timeline, mode)
        here = np.array(x, float)
        if look.decay(0.0, here) * until < LEAST_STEPS * REACH:
            return None
        t, here = look.settled(here)
        decay = look.decay(t, here)
        if decay * until < LEAST_STEPS * REACH:
            return None
        straight = look.straight(t, here, decay)
    except (*DOMAIN_ERRORS, np.linalg.LinAlgError):
        return None  # it cannot be told here
    return Stiffness(name, 1 / decay, straight) if straight * decay >= APART else None


class _Look:
    """A mode's flow and Jacobian as arrays, with the inputs of the start."""

    def __init__(self, kernel: Kernel, timeline: Timeline, mode: int) -> None:
        data = timeline.at(0.0).data
        self._flow, self._jacobian = kernel.bind(mode, data).flow, kernel.jacobian(mode, data)

    def flow(self, t: float, x: Array) -> Array:
        return np.array(self._flow(t, *x.tolist()), float)

    def jacobian(self, t: float, x: Array) -> Array:
        return np.array(self._jacobian(t, *x.tolist()), float).reshape(len(x), len(x))

    def decay(self, t: float, x: Array) -> float:
        """The fastest decay that does not oscillate faster than it decays; 0 where nothing decays."""
        values = np.linalg.eigvals(self.jacobian(t, x))
        return float(max((-v.real for v in values if v.real < 0 and abs(v.imag) <= -v.real), default=0.0))

    def settled(self, x: Array) -> tuple[float, Array]:
        """Where what decays fast has decayed, by linearly implicit Euler steps, and when."""
        t = 0.0
        for _ in range(SETTLING_STEPS):
            decay = self.decay(t, x)
            if decay == 0:
                break
            h = SETTLING_LENGTH / decay
            x = x + np.linalg.solve(np.eye(len(x)) - h * self.jacobian(t, x), h * self.flow(t, x))
            t += h
        return t, x

    def straight(self, t: float, x: Array, decay: float) -> float:
        """For how long the curve stays within a hundredth of 1 + |x| of its tangent."""
        f, ahead = self.flow(t, x), 0.01 / decay
        bend = np.abs(self.flow(t + ahead, x + ahead * f) - f) / ahead / (1 + np.abs(x))
        return float(np.sqrt(0.02 / np.max(bend))) if np.any(bend) else inf
