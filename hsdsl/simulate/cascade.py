"""Transitions that follow each other without any flow between them, and whether they return to where they were."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.arithmetic import Number
from hsdsl.integrators.stepper import State

PARALLEL = 1e-6


@dataclass
class Cascade:
    """One of the states that such transitions led to, with which those after it are compared (Brent's algorithm)."""

    reference: tuple[int, State] | None = None
    length: int = 0
    room: int = 1

    def returns(self, flowed: bool, mode: int, x: State) -> bool:
        """Count a transition that led to a state; say whether one of the same cascade has led there before."""
        here = mode, x
        if flowed or self.reference is None:
            self.reference, self.length, self.room = here, 0, 1
            return False
        if here == self.reference:
            return True
        self.length += 1
        if self.length == self.room:
            self.reference, self.length, self.room = here, 0, 2 * self.room
        return False


def takes_back(slope: State, back: State) -> bool:
    """Whether one direction is opposite to another that is not zero."""
    largest = greatest(slope)
    if len(slope) != len(back) or not largest > 0:
        return False
    along = max(range(len(slope)), key=lambda i: abs(slope[i]))
    share: Number = back[along] / slope[along]
    return share < 0 and all(
        abs(b - share * f) <= PARALLEL * abs(share) * largest for b, f in zip(back, slope, strict=True)
    )


def greatest(x: State) -> Number:
    """The largest absolute value."""
    return max(abs(a) for a in x)
