"""An initial value problem with the settings of its run: everything that decides an execution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from hsdsl.arithmetic import TIE, Arithmetic, Number
from hsdsl.integrators.stepper import State
from hsdsl.kernel import Kernel
from hsdsl.program import Program
from hsdsl.simulate.input_segments import Timeline
from hsdsl.simulate.queues import Waits
from hsdsl.simulate.settings import Settings


@dataclass(frozen=True, eq=False)
class Problem:
    """A program, its numbers, and where it starts: mode, names of its states, ``x`` at t = 0, and what ``waits``."""

    program: Program
    kernel: Kernel
    settings: Settings
    timeline: Timeline
    mode: int
    states: tuple[str, ...]
    x: State
    waits: Mapping[str, Sequence[Waits]]

    @property
    def arithmetic(self) -> Arithmetic:
        """The run's number type."""
        return self.kernel.arithmetic

    def with_settings(self, settings: Settings) -> Problem:
        """The same problem with other settings."""
        return Problem(self.program, self.kernel, settings, self.timeline, self.mode, self.states, self.x, self.waits)

    def tie(self, t: Number) -> Number:
        """Times closer than this to t are the same instant, however long the run goes on."""
        return TIE * abs(t)

    def output_values(self, mode: str, t: Number, x: State) -> State:
        """Outputs at a state of a mode, the input taken on the segment that starts at or holds t."""
        index = [m.name for m in self.program.modes].index(mode)
        if len(self.program.modes[index].states) != len(x):
            return (self.arithmetic.functions["nan"],) * len(self.program.outputs)
        return self.kernel.bind(index, self.timeline.at(t).data).outputs(t, *x)
