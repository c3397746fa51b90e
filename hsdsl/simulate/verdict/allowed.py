"""How wrong a run may be, as far as its own settings tell.

Each step may be wrong by the tolerance, relative to 1 + abs(x); a strip delays what follows. Both are summed up to a
time as they would add in a flow that neither enlarges nor shrinks them. That is an estimate and no bound: an unstable
flow enlarges what came before.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

from hsdsl.arithmetic import Number
from hsdsl.integrators.stepper import State


@dataclass(frozen=True)
class Allowed:
    """A tolerance, and the times of transitions with the waiting summed up to each."""

    tolerance: Number
    times: tuple[Number, ...]
    waited: tuple[Number, ...]

    def error(self, steps: int, t: Number, x: State, slope: State) -> State:
        """How wrong each state may be after so many steps, at time t where the flow is ``slope``."""
        late = self.delay(t)
        return tuple(steps * self.tolerance * (1 + abs(a)) + abs(f) * late for a, f in zip(x, slope, strict=True))

    def delay(self, t: Number) -> Number:
        """How late the strips before time t have made the run."""
        k = bisect_right(self.times, t) - 1
        return self.waited[k] if k >= 0 else self.tolerance * 0
