"""When to stop trying ever shorter steps: a run that closes in on a surface ends there, one that creeps says so."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.surfaces import StepFailure

IDLE_UNITS = 64  # a step below this many units of round-off of time (or of the full step) is idle
MOST_IDLE = 64  # in a row: enough to close in on a surface to round-off
CREEPING = 10  # halvings; steps below a thousandth of the full one
MOST_CREEPING = 2000  # in a row: the run would take a thousand times its length in steps
SHORT = 1e-6  # of a run
MOST_SHORT = 100_000  # steps within that, in one flight: so the run would take a hundred billion


@dataclass
class Patience:
    """Counts accepted steps in a row that had to be cut short; ``unit`` is the unit round-off."""

    unit: Number
    reached: Number | None = None  # by the last step counted: another start means that full steps came between
    idle: int = 0
    creeping: int = 0

    def ends(
        self,
        here: ModeState,
        halvings: int,
        full: Number,
        failure: StepFailure,
        t: Number,
        x: State,
        t1: Number,
        z: State,
    ) -> StepFailure | None:
        """Count a step from (t, x) to (t1, z) that was halved because of ``failure``; say what ends the run, if so."""
        if t != self.reached:
            self.idle = self.creeping = 0
        self.reached = t1
        small = t1 - t <= IDLE_UNITS * self.unit * max(t, full)
        still = _still(here, failure, t, x, t1, z)
        self.idle = self.idle + 1 if small or still else 0
        self.creeping = self.creeping + 1 if halvings >= CREEPING else 0
        if self.idle > MOST_IDLE or (small and z == x):
            return failure
        return StepFailure("creeping", failure.surface) if self.creeping > MOST_CREEPING else None


@dataclass
class Pace:
    """Counts the steps of a flight within a millionth of the run: ``short``, 0 for fixed steps, from ``since`` on."""

    short: Number
    since: Number
    made: int = 0

    def is_slow(self, t: Number) -> bool:
        """Count a step from t; whether there were too many."""
        self.made += 1
        if t - self.since > self.short:
            self.since, self.made = t, 0
        return self.made > MOST_SHORT


def pace(run: Run, t: Number) -> Pace:
    """Begin to count at the start of a flight."""
    return Pace(run.settings.until * (0 if run.control.tolerance is None else SHORT), t)


def _still(here: ModeState, failure: StepFailure, t: Number, x: State, t1: Number, z: State) -> bool:
    """Whether the surface in the way did not come nearer: its round-off is larger than what the step adds."""
    k = failure.surface
    if k is None:
        return False
    return here.kernel.surfaces(t1, *z)[k] == here.kernel.surfaces(t, *x)[k]
