"""The step size: fixed, or from the embedded error estimate. See hsdsl/engine/simulate/control.py."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import NOTHING, Number
from hsdsl.engine.scheme.primitives import Count, Time, Vector, inline

SAFETY = 0.9
LEAST = 0.2
MOST = 5
MOST_REJECTIONS = 2000  # in a stretch of time
STRETCH = 1e-3  # of the largest step: the time in which rejections are counted together
BAND_FROM = 0.9  # an implicit step is kept where it would change by a factor between these
BAND_TO = 1.2
LEAST_SEEN = 1e-10  # an error ratio below this counts as this
LEAST_BEFORE = 0.3  # a root of the error ratio of the step before below this counts as this


@dataclass
class Control:
    """The step to try next, ``h``; ``tolerance`` is 0 for a fixed step.

    ``largest`` and ``least`` bound steps that nothing else bounds. ``before`` has the step last accepted, 0 for none,
    and ``root_before`` the root of its error ratio, for an ``implicit`` method. ``failed_at`` is where the last step
    began that was too wrong, not-a-number before the first; ``closer`` says that a look at the flow's round-off let one
    pass.
    """

    h: Number
    tolerance: Number
    largest: Number
    least: Number
    failed_at: Time
    order: int
    implicit: bool = False
    closer: bool = False
    before: Number = 0
    root_before: Number = 0
    stretch: Number = 0
    accepted: Count = 0
    rejected: Count = 0


@inline
def ratio_to(control: Control, h: Number, error: Vector, z: Vector, scales: Vector, had: Vector, n: int) -> Number:
    """Return the error ratio of a step of length h to z; at most 1 is acceptable.

    ``scales`` may be lifted by round-off of the flow; the states ``had`` these sizes before that.
    """
    worst = control.h * 0
    tiny = h <= control.least
    for k in range(n):
        end = abs(z[k])
        size = max(scales[k], end)
        off = abs(error[k])
        if off <= NOTHING or (tiny and had[k] <= control.tolerance * end):
            continue
        worst = max(worst, off / (control.tolerance * size) if size > 0 else 1 / control.tolerance)
    return worst


def factor(control: Control, ratio: Number) -> Number:
    """Return the factor from one step to the next, by the error ratio of that step alone."""
    if ratio == 0:
        return MOST
    return min(MOST, max(LEAST, SAFETY * ratio ** (-1 / (ratio * 0 + control.order))))


def begin_steps(control: Control, scales: Vector, slope: Vector, n: int) -> None:
    """Begin a stretch of flow; an implicit method's first step must show a decay from there, however fast."""
    control.before = 0
    if not control.implicit or not control.tolerance > 0:
        return
    share = control.tolerance ** (1 / (control.h * 0 + control.order))
    for k in range(n):
        speed = abs(slope[k])
        if scales[k] > 0 and control.h * speed > share * scales[k]:
            control.h = max(min(control.h, control.least), share * scales[k] / speed)


def predicted(control: Control, taken: Number, ratio: Number) -> Number:
    """Return the factor to the next step of an implicit method, by the ratios of this step and of the one before.

    This is Gustafsson's predictive controller (Hairer and Wanner 1996, IV.8). It remembers the step.
    """
    root = max(LEAST_SEEN, ratio) ** (1 / (ratio * 0 + control.order))
    found = min(MOST, max(LEAST, SAFETY / root))
    if control.before > 0:
        ahead = SAFETY * (taken / control.before) * (control.root_before / (root * root))
        found = min(found, max(LEAST, ahead))
    control.before = taken
    control.root_before = max(LEAST_BEFORE, root)
    return 1 if BAND_FROM <= found <= BAND_TO else found


def accept(control: Control, taken: Number, ratio: Number) -> None:
    """Learn from an accepted, unhalved step; one cut short by a boundary never shrinks the next."""
    control.accepted += 1
    control.stretch = control.stretch + taken
    if control.stretch > control.largest * STRETCH:
        control.accepted = 0
        control.rejected = 0
        control.stretch = 0
    proposed = taken * (predicted(control, taken, ratio) if control.implicit else factor(control, ratio))
    control.h = min(control.largest, max(proposed, control.h) if taken < control.h else proposed)


def reject(control: Control, taken: Number, ratio: Number, ends: bool) -> None:
    """Shrink after a rejected, unhalved step; one without an end has no ratio."""
    control.rejected += 1
    control.h = taken * min(1, factor(control, ratio)) if ends else taken / 2


def struggles(control: Control) -> bool:
    """Whether rejections keep pace with steps for a stretch of time: the flow jumps, and no step fits it."""
    return control.rejected > MOST_REJECTIONS and 4 * control.rejected > control.accepted
