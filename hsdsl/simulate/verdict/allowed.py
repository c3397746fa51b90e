"""How wrong a run may be, as far as its own settings tell.

Each step may be wrong by the tolerance, relative to 1 + abs(x); a strip delays what follows. Both are summed up to a
time as they would add in a flow that neither enlarges nor shrinks them. That is an estimate and no bound: an unstable
flow enlarges what came before.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from hsdsl.arithmetic import Number
from hsdsl.integrators.stepper import State
from hsdsl.simulate.verdict.place import Place


@dataclass(frozen=True)
class Allowed:
    """A tolerance, and the times of transitions with the waiting summed up to each."""

    safe: ClassVar[int] = 10  # margins below so many errors are named
    tolerance: Number
    times: tuple[Number, ...]
    waited: tuple[Number, ...]

    def error(self, steps: int, place: Place, slope: State) -> State:
        """How wrong each state may be after so many steps, at a place where the flow is ``slope``."""
        late = self.delay(place.t)
        return tuple(steps * self.tolerance * (1 + abs(a)) + abs(f) * late for a, f in zip(place.x, slope, strict=True))

    def delay(self, t: Number) -> Number:
        """How late the strips before time t have made the run."""
        k = bisect_right(self.times, t) - 1
        return self.waited[k] if k >= 0 else self.tolerance * 0


@dataclass(frozen=True)
class Measured:
    """One error for each state, at all times."""

    safe: ClassVar[int] = 2
    errors: Mapping[str, Number]

    def error(self, steps: int, place: Place, slope: State) -> State:
        """How wrong each state of a place is; one that was not measured, as wrong as the worst."""
        zero = place.t * 0
        worst = max(self.errors.values(), default=zero)
        names = place.mode.states or ()
        known = tuple(self.errors.get(name, worst) for name in names)
        return known if len(known) == len(place.x) else tuple(worst for _ in place.x)
