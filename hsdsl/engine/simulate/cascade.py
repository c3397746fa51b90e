"""Transitions that follow each other without any flow between them, and whether they return to where they were."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.integrators.stepper import State
from hsdsl.mathematics.program import ModeProgram

PARALLEL = 1e-6  # of a component: flows that differ by less move no state on by more than this share of the way back


@dataclass
class Cascade:
    """One of the states that such transitions led to, with which those after it are compared (Brent's algorithm)."""

    reference: tuple[int, State] | None = None
    length: int = 0
    room: int = 1

    def returns(self, flowed: bool, index: int, mode: ModeProgram, x: State) -> bool:
        """Count a transition that led to a state; say whether one of the same cascade has led there before."""
        here = index, decisive(mode, x)
        if flowed or self.reference is None:
            self.reference, self.length, self.room = here, 0, 1
            return False
        if here == self.reference:
            return True
        self.length += 1
        if self.length == self.room:
            self.reference, self.length, self.room = here, 0, 2 * self.room
        return False


def decisive(mode: ModeProgram, x: State) -> State:
    """What of a state decides how a run goes on: a cascade that only counts comes back to it."""
    return tuple(x[i] for i in mode.deciding) if mode.idle else x


def takes_back(slope: State, back: State) -> bool:
    """Whether one direction is opposite to another that is not zero, in each component."""
    pairs = list(zip(back, slope, strict=True))
    share: Number = next((b / f for b, f in pairs if f != 0), 0)
    return share < 0 and all(abs(b - share * f) <= PARALLEL * abs(share) * abs(f) for b, f in pairs)
