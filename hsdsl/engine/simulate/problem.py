"""An initial value problem with the settings of its run: everything that decides an execution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import TIE, Arithmetic, Number
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import Kernel
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.moving import Start
from hsdsl.engine.simulate.settings import Settings
from hsdsl.engine.simulate.transitions import Waits
from hsdsl.mathematics.program import Program


@dataclass(frozen=True, eq=False)
class Problem:
    """A program, its numbers, and where it starts: mode, the names of its states, ``x`` at t = 0, and what ``waits``.

    ``moved`` gives start and inputs as their round-off moves them; None where there is none, or nothing is known of it.
    """

    program: Program
    kernel: Kernel
    settings: Settings
    timeline: Timeline
    mode: int
    states: tuple[str, ...]
    x: State
    waits: Mapping[str, Sequence[Waits]]
    moved: Callable[[], Start | None]

    @property
    def arithmetic(self) -> Arithmetic:
        """The run's number type."""
        return self.kernel.arithmetic

    def with_settings(self, settings: Settings) -> Problem:
        """The same problem with other settings."""
        return self._from(settings, self.timeline, self.x, self.moved)

    @property
    def start(self) -> Start:
        """Where it starts as its round-off moves that, as far as it is known."""
        return self.moved() or Start(self.x, self.timeline)

    def moved_with(self, settings: Settings) -> Problem:
        """The same problem from where its round-off moves it."""
        return self._from(settings, self.start.timeline, self.start.x, lambda: None)

    def _from(self, settings: Settings, timeline: Timeline, x: State, moved: Callable[[], Start | None]) -> Problem:
        return Problem(self.program, self.kernel, settings, timeline, self.mode, self.states, x, self.waits, moved)

    def tie(self, t: Number) -> Number:
        """Times closer than this to t are the same instant, however long the run goes on."""
        return TIE * abs(t)

    def output_values(self, mode: str, t: Number, x: State) -> State:
        """Outputs at a state of a mode, the input taken on the segment that starts at or holds t."""
        index = [m.name for m in self.program.modes].index(mode)
        if len(self.program.modes[index].states) != len(x):
            return (self.arithmetic.functions["nan"],) * len(self.program.outputs)
        return self.kernel.bind(index, self.timeline.at(t).data).outputs(t, *x)
