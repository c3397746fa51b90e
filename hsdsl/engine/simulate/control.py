"""The step size: fixed, or from the embedded error estimate by one documented formula.

With e the estimate, z the step's end and s the scales of the states (the largest size that each has had), the error
ratio is max_i |e_i| / (tolerance max(s_i, |z_i|)). A step is accepted when it is at most 1. The next step is h times
0.9 ratio**(-1/order), kept between 0.2 and 5 (and not above 1 after a rejection), order being the power of h that the
estimate falls with. A step whose equations could not be solved is halved. Trials halved to stay in the relaxed domain
do not feed the formula.

Where surfaces of a mode vary too fast along a step it is halved as well, and this length is kept: the next step in the
mode, also of another stretch of flow, begins with it, or with twice the last one that they allowed.

An implicit method pays for each change of the step. For one the factor is also held down by what the ratio did over
the step before (Gustafsson's predictive control; Hairer and Wanner 1996, IV.8), and one from 0.9 to 1.2 counts as 1. A
stretch of flow begins with a step in which no state moves by more than tolerance**(1/4) of its scale, but no shorter
than the least step: the largest one times the tolerance, or times 1e-8 (half the digits of a number) if that is more.

A state that has been zero so far has no scale. It is compared with its own value at the step's end. Where it begins as
a power of time that is above the method's order, no step is short enough for that: over the least step a state that has
been no more than the tolerance times what it is then does not count.

The scales of states grow along a run (`hsdsl.engine.integrators.stepper`). The terms that a flow is computed from are
evaluated only where a step would be rejected for the second time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import nan
from types import SimpleNamespace
from typing import TYPE_CHECKING, Literal

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.engine.integrators.stepper import State, Stepper, make_resolved
from hsdsl.engine.scheme import control as text
from hsdsl.engine.scheme.control import ratio_to
from hsdsl.engine.scheme.scales import resolve
from hsdsl.engine.simulate.settings import Settings

if TYPE_CHECKING:
    from hsdsl.engine.simulate.run import ModeState, Run

FIRST_PART = 100  # the first step is the largest one divided by this
ALMOST = 1 - 2.0**-30  # a step this close to a boundary ends on it
LARGEST_SHARE = 0.1  # of the run: a step over a state at rest must still notice time going on


@dataclass(frozen=True)
class StepFailure:
    """Why a trial step ends outside the relaxed domain."""

    kind: Literal["wall", "deep", "flat", "inward", "not finite", "error", "unsolved", "creeping", "jump", "slow"]
    surface: int | None = None


NOT_FINITE, TOO_WRONG, UNSOLVED = StepFailure("not finite"), StepFailure("error"), StepFailure("unsolved")
TOO_FAST = StepFailure("not finite")  # a surface, for one step


@dataclass
class Control(text.Control):
    """The step size of a run, and what it has learnt of modes.

    ``first`` is the step that a run tries first. ``reach`` has the step that the surfaces of a mode allow, where they
    do not allow any; those of a mode in ``lost`` cannot be followed.
    """

    first: Number = 0
    reach: dict[str, Number] = field(default_factory=dict[str, Number])
    lost: set[str] = field(default_factory=set[str])
    first_steps: Iterator[Number] | None = None  # of the arcs of flow to come; 0 where there is no bound

    def begin_arc(self, mode: str) -> None:
        """Begin an arc of flow in a mode."""
        if self.first_steps is not None and (bound := next(self.first_steps, 0)) > 0:
            self.reach[mode] = self.within_reach(mode, bound)

    def within_reach(self, mode: str, h: Number) -> Number:
        """Cut a step to what the surfaces of a mode allow."""
        return min(h, self.reach.get(mode, h))

    def too_fast(self, mode: str, tried: Number) -> None:
        """Learn that surfaces vary too fast for a step."""
        self.reach[mode] = tried / 2

    def slow_enough(self, mode: str, taken: Number) -> None:
        """Learn that they do not for another one."""
        if taken >= self.reach.get(mode, 2 * taken):
            self.reach[mode] = 2 * taken


def make_control(settings: Settings, arithmetic: Arithmetic) -> Control:
    """Start from the fixed step, or from a part of the largest step and the error formula."""
    zero, order = arithmetic.zero, settings.method.error_order if settings.method else 1
    if settings.step is not None:
        return Control(settings.step, zero, settings.step, zero, nan, order)
    largest = settings.until * LARGEST_SHARE
    if settings.longest_step is not None:
        largest = min(largest, settings.longest_step)
    least = max(settings.tolerance, arithmetic.sqrt(arithmetic.unit)) * largest
    implicit = settings.method is not None and settings.method.implicit
    control = Control(largest / FIRST_PART, settings.tolerance, largest, least, nan, order, implicit)
    control.first_steps = iter(settings.first_steps) if settings.first_steps else None
    control.first = control.h
    return control


def end_of_step(t: Number, h: Number, limit: Number) -> tuple[Number, Number]:
    """Return the length and the end of a step, which ends on a limit that is so close."""
    return (h, t + h) if h < (limit - t) * ALMOST else (limit - t, limit)


def error_ratio(
    run: Run, here: ModeState, method: Stepper, error: State, t: Number, h: Number, x: State, z: State
) -> Number:
    """Error ratio of a step from (t, x) to z; at most 1 is acceptable."""
    control, had = run.control, here.arc.scales
    scales: Sequence[Number] = had if method.scales is None else method.scales(False)
    ratio = ratio_to(control, h, error, z, scales, had, len(z))
    if not ratio > 1:
        return ratio
    again, control.failed_at = t == control.failed_at, t
    if not (control.closer or again):  # at the second step from t that is too wrong, or where that helped before
        return ratio
    try:
        if method.scales is not None:
            scales = method.scales(True)
        else:
            terms = run.kernel.terms(here.flow, here.segment.data)
            by = make_resolved(len(x), control.tolerance, run.arithmetic)
            resolve(SimpleNamespace(flow=here.kernel.flow, terms=terms), by, len(x), t, h, x, scales, False)
            scales = by.found
    except DOMAIN_ERRORS:
        return ratio
    ratio = ratio_to(control, h, error, z, scales, had, len(z))
    control.closer = ratio <= 1
    return ratio
