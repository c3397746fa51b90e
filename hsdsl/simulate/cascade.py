"""Transitions that follow each other without any flow between them, and whether they return to where they were."""

from __future__ import annotations

from collections.abc import Sequence
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


def takes_back(slope: State, back: State, sizes: Sequence[Number], noise: Sequence[Number]) -> bool:
    """Whether one direction is opposite to another that is not zero, relative to each component's size."""
    moving = [i for i, f in enumerate(slope) if f != 0]
    if not moving:
        return False
    along = max(moving, key=lambda i: abs(slope[i]) / sizes[i])
    share: Number = back[along] / slope[along]
    return share < 0 and all(
        abs(b - share * f) <= PARALLEL * abs(share) * size + small
        for b, f, size, small in zip(back, slope, sizes, noise, strict=True)
    )
