"""An initial value problem with the settings of its run: everything that decides an execution.

Executions of events wait in queues. The first of each is among the states; the rest is its tail.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from hsdsl.base.names import nth_memory
from hsdsl.base.numbers.arithmetic import TIE, Arithmetic, Number
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.kernel import Kernel
from hsdsl.engine.simulate.input_segments import Timeline
from hsdsl.engine.simulate.moving import Start
from hsdsl.engine.simulate.settings import Settings
from hsdsl.mathematics.program import ModeProgram, Program, Queue

Waits = tuple[Number, ...]  # the time at which one is made, and its values


class Tails:
    """The tails of a run; ``full`` names the count of a queue in which more wait than may."""

    def __init__(self, waits: Mapping[str, Iterable[Waits]] | None = None) -> None:
        self._waits = {name: [*given] for name, given in (waits or {}).items()}
        self.full: str | None = None

    def copy(self) -> Tails:
        """The same tails, to go on with otherwise."""
        return Tails(self._waits)

    def advance(self, before: ModeProgram, x: State, after: ModeProgram, z: State) -> State:
        """Take part in a reset from x to z; return z with the first executions that wait then."""
        if before.name != after.name:
            self._waits.clear()
            return z
        for queue in after.queues if len(z) == len(after.states) else ():
            had, has = x[queue.waiting], z[queue.waiting]
            if has < 1:
                self._waits.pop(queue.name, None)
            elif has < had:
                z = _with(queue, z, self._waits[queue.name].pop(0))
            elif 1 <= had < has:
                z = _with(queue, z, self._joined(queue, _of(queue, x), _of(queue, z)))
                if has > queue.most:
                    self.full = queue.name
        return z

    def _joined(self, queue: Queue, first: Waits, new: Waits) -> Waits:
        """The first of those that wait, with one more; of tied times, made one, the one that has waited goes first."""
        waits = self._waits.setdefault(queue.name, [])
        if new[0] < _not_tied(first):
            waits.insert(0, first)
            return new
        place = bisect_right(waits, new[0], key=_not_tied)
        ahead = waits[place - 1] if place else first
        waits.insert(place, (max(ahead[0], new[0]), *new[1:]))
        return first

    def states(self, modes: Iterable[ModeProgram]) -> dict[str, Number]:
        """Tails as if they were states: with `run.final.state` a run can go on from there."""
        queues = {queue.name: (queue, mode) for mode in modes for queue in mode.queues}
        found: dict[str, Number] = {}
        for name, waits in self._waits.items():
            queue, mode = queues[name]
            names = [mode.states[i] for i in queue.values]
            for k, one in enumerate(waits, 2):
                found |= {nth_memory(state, k): value for state, value in zip(names, one, strict=True)}
        return found


def _not_tied(one: Waits) -> Number:
    """Before when others are made before one."""
    return one[0] - TIE * abs(one[0])


def _of(queue: Queue, x: State) -> Waits:
    return tuple(x[i] for i in queue.values)


def _with(queue: Queue, z: State, first: Waits) -> State:
    whole = list(z)
    for i, value in zip(queue.values, first, strict=True):
        whole[i] = value
    return tuple(whole)


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
