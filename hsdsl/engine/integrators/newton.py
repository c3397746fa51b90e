"""When the iterations for an implicit step have done enough, and when they will not.

They converge linearly, by a factor that the last two changes tell. What the next ones would still add follows from it.

E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, Springer 1996, IV.8
(doi:10.1007/978-3-642-05221-7).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

from hsdsl.base.numbers.arithmetic import Arithmetic, Number
from hsdsl.engine.integrators.linear import Vector
from hsdsl.engine.integrators.stepper import State

Increments = tuple[Vector, Vector, Vector]
Iteration = tuple[Vector, Increments]  # the largest change of each state, and the increments after it

MOST_ITERATIONS = 7  # iterations of a step that has a tolerance
RENEWED = 1e-3  # an iteration that leaves more than this of the one before has old derivatives,
FEW = 2  # which matters where a step takes more than these
LEAST_LEFT, MOST_LEFT = 1e-3, 0.03  # of the tolerance: what the iterations of such a step may leave
DIVERGING = 0.99  # an iteration that leaves more than this of the one before is one of too long a step
SLOW_RATE = 0.5  # likewise for iterations that go on to round-off
NEWTON_NOISE = 2**10  # units of round-off, relative to the scales: a correction this small may be all noise
NEWTON_SHARE = 1e-2  # of the tolerance, likewise: what an iteration may leave in a badly conditioned step


class NoConvergence(ValueError):
    """The equations of a step are not solved by the iteration: the step is too long."""


class Convergence:
    """How iterations converge, over the steps of one stretch of flow.

    Attributes
    ----------
    rate : Number
        What the last iteration left of the one before it; 1 where that is not known, or they do not converge.
    left : Number
        What all that follow would have added to the last of a step, relative to it.
    aged : bool
        Whether the derivatives they use should be renewed for the next step.
    """

    def __init__(self, tolerance: Number | None, arithmetic: Arithmetic) -> None:
        self._tolerance, self._arithmetic = tolerance, arithmetic
        self.rate = self.left = arithmetic.zero + 1
        self.aged = False

    def to_tolerance(self, x: State, scales: Sequence[Number], iterations: Iterator[Iteration]) -> Increments:
        """Iterate until what is left is a small share of the tolerance.

        Raises NoConvergence: it will not be, within the iterations that a step may take.
        """
        unit, tolerance, one = self._arithmetic.unit, self._tolerance, self._arithmetic.zero + 1
        assert tolerance is not None
        noise = NEWTON_NOISE * unit / tolerance
        enough = max(10 * unit / tolerance, min(MOST_LEFT, max(LEAST_LEFT, self._arithmetic.sqrt(tolerance))))
        left, before = self._arithmetic.functions["pow"](max(self.left, unit), one * 4 / 5), None
        for count, (largest, z) in enumerate(iterations, 1):
            size = _scaled(largest, x, scales, z) / tolerance
            rated = before is not None and count > 1 + _followers(x, scales, z)
            if rated:
                rate = size / before
                if rate >= DIVERGING:
                    if size <= noise:
                        return z
                    break
                self.rate, left = rate, rate / (1 - rate)
            self.aged = count > FEW and self.rate > RENEWED
            ahead = left * size
            if size == 0 or ahead <= enough:
                self.left = left
                return z
            for _ in range(count, MOST_ITERATIONS if rated else count):
                ahead = ahead * self.rate
            if count == MOST_ITERATIONS or (rated and ahead > enough and size > noise):
                break
            before = size
        self.rate, self.left, self.aged = one, one, True
        raise NoConvergence("an iteration that does not settle")

    def to_roundoff(self, x: State, scales: Sequence[Number], iterations: Iterator[Iteration]) -> Increments:
        """Iterate until the next correction would be below the last digit, or they are all noise.

        Raises NoConvergence: they become no smaller before that.
        """
        unit, before, z = self._arithmetic.unit, None, None
        allowed = max(NEWTON_NOISE * unit, NEWTON_SHARE * (self._tolerance or 0))
        for count, (largest, z) in enumerate(islice(iterations, self._arithmetic.most_halvings), 1):
            size = _scaled(largest, x, scales, z)
            rate = SLOW_RATE if not before else size / before
            reach = [max(abs(a), *(abs(a + k) for k in ks)) for a, *ks in zip(x, *z, strict=True)]
            if size == 0 or (
                rate < SLOW_RATE and all(rate * d <= unit * a for d, a in zip(largest, reach, strict=True))
            ):
                self.rate, self.aged = rate, rate > RENEWED
                return z
            if before and rate >= SLOW_RATE and count > 1 + _followers(x, scales, z):
                if size <= allowed:
                    return z
                self.rate, self.aged = self._arithmetic.zero + 1, True
                raise NoConvergence("an iteration that does not settle")
            before = size
        assert z is not None
        return z


def _scaled(largest: Vector, x: State, scales: Sequence[Number], z: Increments) -> Number:
    """The largest change relative to the scales; of a state that has been zero so far, to where it is now."""
    size = largest[0] * 0
    for i, (d, s) in enumerate(zip(largest, scales, strict=True)):
        if d > 0:
            reach = s if s > 0 else max(abs(x[i] + k[i]) for k in z)
            size = max(size, d / reach if reach > 0 else reach + 1)
    return size


def _followers(x: State, scales: Sequence[Number], z: Increments) -> int:
    """How many states that have been zero so far no longer are: each may follow another one, an iteration later."""
    moved = (max(abs(x[i] + k[i]) for k in z) > 0 for i, s in enumerate(scales) if not s > 0)
    return sum(moved)
