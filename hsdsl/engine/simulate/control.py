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

A state that has been zero so far has no scale. It is held against its own value at the step's end. Where it begins as
a power of time that is above the method's order, no step is short enough for that: over the least step a state that has
been no more than the tolerance times what it is then does not count.

The scales of states grow along a run (`hsdsl.engine.integrators.stepper`). The terms that a flow is computed from are
evaluated only where a step would be rejected for the second time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, NOTHING, Arithmetic, Number
from hsdsl.engine.integrators.stepper import State, Stepper, resolved
from hsdsl.engine.simulate.settings import Settings

if TYPE_CHECKING:
    from hsdsl.engine.simulate.run import ModeState, Run

SAFETY, LEAST, MOST = 0.9, 0.2, 5
MOST_REJECTIONS = 2_000  # in a stretch
STRETCH = 1e-3  # of the largest step: the time in which rejections are counted together
BAND_FROM, BAND_TO = 0.9, 1.2  # an implicit step is kept where it would change by a factor between these
LEAST_SEEN = 1e-10  # an error ratio below this counts as this
LEAST_BEFORE = 0.3  # a root of the one before likewise
FIRST_PART = 100  # the first step is the largest one divided by this
LARGEST_SHARE = 0.1  # of the run: a step over a state at rest must still notice time going on


@dataclass
class Control:
    """The step to try next, ``h``; ``tolerance`` is None for a fixed step.

    ``largest`` and ``least`` bound steps that nothing else bounds; ``first`` is the one that a run tries first.

    ``before`` has the step last accepted and the root of its error ratio, for an ``implicit`` method. ``failed_at`` is
    where the last step began that was too wrong; ``closer`` says that a look at the flow's round-off let one pass.
    ``reach`` has the step that the surfaces of a mode allow, where they do not allow any; those of a mode in ``lost``
    cannot be followed.
    """

    h: Number
    tolerance: Number | None
    order: int
    largest: Number
    power: Callable[[Number, Number], Number] | None
    implicit: bool = False
    before: tuple[Number, Number] | None = None
    accepted: int = 0
    rejected: int = 0
    stretch: Number = 0
    least: Number = 0
    first: Number = 0
    failed_at: Number | None = None
    closer: bool = False
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

    def ratio(
        self, h: Number, error: State, z: State, scales: Sequence[Number], had: Sequence[Number] | None = None
    ) -> Number:
        """Error ratio of a step of length h to z; at most 1 is acceptable.

        ``had`` is given where ``scales`` are more than the sizes that the states have had.
        """
        tolerance = self.tolerance
        assert tolerance is not None
        worst, tiny = self.h * 0, h <= self.least
        for e, b, s, before in zip(error, z, scales, scales if had is None else had, strict=True):
            size = max(s, abs(b))
            if abs(e) <= NOTHING or (tiny and before <= tolerance * abs(b)):
                continue
            worst = max(worst, abs(e) / (tolerance * size) if size > 0 else 1 / tolerance)
        return worst

    def factor(self, ratio: Number) -> Number:
        """Factor from one step to the next."""
        if ratio == 0 or self.power is None:
            return MOST
        return min(MOST, max(LEAST, SAFETY * self.power(ratio, -1 / (ratio * 0 + self.order))))

    def accept(self, taken: Number, ratio: Number) -> None:
        """Learn from an accepted, unhalved step; one cut short by a boundary never shrinks the next."""
        self.accepted += 1
        self.stretch = self.stretch + taken
        if self.stretch > self.largest * STRETCH:
            self.accepted, self.rejected, self.stretch = 0, 0, taken * 0
        proposed = taken * (self.predicted(taken, ratio) if self.implicit else self.factor(ratio))
        self.h = min(self.largest, max(proposed, self.h) if taken < self.h else proposed)

    def begin(self, scales: Sequence[Number], slope: State) -> None:
        """Begin a stretch of flow; an implicit method's first step must show a decay from there, however fast."""
        self.before = None
        if not self.implicit or self.power is None:
            return
        share = self.power(self.tolerance, 1 / (self.h * 0 + self.order))
        for s, f in zip(scales, slope, strict=True):
            if s > 0 and self.h * abs(f) > share * s:
                self.h = max(min(self.h, self.least), share * s / abs(f))

    def predicted(self, taken: Number, ratio: Number) -> Number:
        """Factor from one step to the next for an implicit method."""
        assert self.power is not None
        root = self.power(max(LEAST_SEEN, ratio), 1 / (ratio * 0 + self.order))
        factor = min(MOST, max(LEAST, SAFETY / root))
        if self.before is not None:
            length, last = self.before
            factor = min(factor, max(LEAST, SAFETY * (taken / length) * (last / (root * root))))
        self.before = taken, max(LEAST_BEFORE, root)
        return 1 if BAND_FROM <= factor <= BAND_TO else factor

    def reject(self, taken: Number, ratio: Number | None) -> None:
        """Shrink after a rejected, unhalved step; without a ratio it has no end at all."""
        self.rejected += 1
        self.h = taken / 2 if ratio is None else taken * min(1, self.factor(ratio))

    @property
    def struggles(self) -> bool:
        """Whether rejections keep pace with steps for a stretch of time: the flow jumps, and no step fits it."""
        return self.rejected > MOST_REJECTIONS and 4 * self.rejected > self.accepted


def make_control(settings: Settings, arithmetic: Arithmetic) -> Control:
    """Start from the fixed step, or from a part of the largest step and the error formula."""
    order = settings.method.error_order if settings.method else 1
    if settings.step is not None:
        return Control(settings.step, None, order, settings.step, None)
    largest = settings.until * LARGEST_SHARE
    if settings.longest_step is not None:
        largest = min(largest, settings.longest_step)
    implicit = settings.method is not None and settings.method.implicit
    control = Control(largest / FIRST_PART, settings.tolerance, order, largest, arithmetic.functions["pow"], implicit)
    control.first_steps = iter(settings.first_steps) if settings.first_steps else None
    control.first = control.h
    control.least = max(control.tolerance, arithmetic.sqrt(arithmetic.unit)) * largest
    return control


def error_ratio(
    run: Run, here: ModeState, method: Stepper, error: State, t: Number, h: Number, x: State, z: State
) -> Number:
    """Error ratio of a step from (t, x) to z; at most 1 is acceptable."""
    control, had = run.control, here.arc.scales
    scales: Sequence[Number] = had if method.scales is None else method.scales(False)
    ratio = control.ratio(h, error, z, scales, had)
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
            scales = resolved(here.kernel.flow, t, h, x, scales, None, run.arithmetic, control.tolerance, terms)
    except DOMAIN_ERRORS:
        return ratio
    ratio = control.ratio(h, error, z, scales, had)
    control.closer = ratio <= 1
    return ratio
