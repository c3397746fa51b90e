"""The step size: fixed, or from the embedded error estimate by one documented formula.

With e the estimate and x, z the step's ends, the error ratio is max_i |e_i| / (tolerance (1 + max(|x_i|, |z_i|))). A
step is accepted when it is at most 1. The next step is h times 0.9 ratio**(-1/order), kept between 0.2 and 5 (and not
above 1 after a rejection), order being the power of h that the estimate falls with. A step whose equations could not
be solved is halved. Trials halved to stay in the relaxed domain do not feed the formula.

An implicit method pays for each change of the step. For one the factor is also held down by what the ratio did over
the step before (Gustafsson's predictive control; Hairer and Wanner 1996, IV.8), and one from 0.9 to 1.2 counts as 1. A
stretch of flow begins with a step in which no state moves by more than tolerance**(1/4) (1 + |x|).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hsdsl.arithmetic import Arithmetic, Number
from hsdsl.integrators import RadauMethod
from hsdsl.integrators.stepper import State
from hsdsl.simulate.settings import Settings

SAFETY, LEAST, MOST = 0.9, 0.2, 5
MOST_REJECTIONS = 2_000  # in a stretch
STRETCH = 1e-3  # of the largest step: the time in which rejections are counted together
BAND = 0.9, 1.2  # an implicit step is kept where it would change by a factor between these
LEAST_SEEN = 1e-10  # an error ratio below this counts as this
LEAST_BEFORE = 0.3  # a root of the one before likewise
LARGEST_SHARE = 0.1  # of the run: a step over a state at rest must still notice time going on


@dataclass
class Control:
    """The step to try next, ``h``; ``tolerance`` is None for a fixed step.

    ``before`` has the step last accepted and the root of its error ratio, for an ``implicit`` method.
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

    def ratio(self, error: State, x: State, z: State) -> Number:
        """Error ratio of a step; at most 1 is acceptable."""
        assert self.tolerance is not None
        worst = self.h * 0
        for e, a, b in zip(error, x, z, strict=True):
            worst = max(worst, abs(e) / (self.tolerance * (1 + max(abs(a), abs(b)))))
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

    def begin(self, x: State, slope: State) -> None:
        """Begin a stretch of flow; an implicit method's first step must show a decay from there, however fast."""
        self.before = None
        if not self.implicit or self.power is None:
            return
        share = self.power(self.tolerance, 1 / (self.h * 0 + self.order))
        for a, f in zip(x, slope, strict=True):
            if self.h * abs(f) > share * (1 + abs(a)):
                self.h = share * (1 + abs(a)) / abs(f)

    def predicted(self, taken: Number, ratio: Number) -> Number:
        """Factor from one step to the next for an implicit method."""
        assert self.power is not None
        root = self.power(max(LEAST_SEEN, ratio), 1 / (ratio * 0 + self.order))
        factor = min(MOST, max(LEAST, SAFETY / root))
        if self.before is not None:
            length, last = self.before
            factor = min(factor, max(LEAST, SAFETY * (taken / length) * (last / (root * root))))
        self.before = taken, max(LEAST_BEFORE, root)
        return 1 if BAND[0] <= factor <= BAND[1] else factor

    def reject(self, taken: Number, ratio: Number | None) -> None:
        """Shrink after a rejected, unhalved step; without a ratio it has no end at all."""
        self.rejected += 1
        self.h = taken / 2 if ratio is None else taken * min(1, self.factor(ratio))

    @property
    def struggles(self) -> bool:
        """Whether rejections keep pace with steps for a stretch of time: the flow jumps, and no step fits it."""
        return self.rejected > MOST_REJECTIONS and 4 * self.rejected > self.accepted


def make_control(settings: Settings, arithmetic: Arithmetic) -> Control:
    """Start from the fixed step, or from a hundredth of the largest step and the error formula."""
    order = settings.method.error_order if settings.method else 1
    if settings.step is not None:
        return Control(settings.step, None, order, settings.step, None)
    largest = settings.until * LARGEST_SHARE
    implicit = isinstance(settings.method, RadauMethod)
    return Control(largest / 100, settings.tolerance, order, largest, arithmetic.functions["pow"], implicit)
