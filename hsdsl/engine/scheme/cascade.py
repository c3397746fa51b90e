"""Transitions without flow between them: whether they come back. See hsdsl/engine/simulate/transitions.py."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.engine.scheme.words import Count, Room, Vector

PARALLEL = 1e-6  # of a component: flows that differ by less move no state on by more than this share of the way back


@dataclass
class Cascade:
    """One of the states that such transitions led to, with which those after it are compared (Brent's algorithm).

    There is none where ``room`` is 0.
    """

    x: Room
    mode: int = 0
    length: Count = 0
    room: Count = 0


def same_state(a: Vector, b: Vector, n: int) -> bool:
    """Whether two states are one."""
    same = True
    for k in range(n):
        same = same and a[k] == b[k]
    return same


def returns(cascade: Cascade, flowed: bool, mode: int, x: Vector, n: int) -> bool:
    """Count a transition that led to a state; return whether one of the same cascade has led there before."""
    if not flowed and cascade.room > 0:
        if mode == cascade.mode and same_state(x, cascade.x, n):
            return True
        cascade.length += 1
        if cascade.length != cascade.room:
            return False
    cascade.room = 1 if flowed or cascade.room == 0 else 2 * cascade.room
    cascade.length = 0
    cascade.mode = mode
    for k in range(n):
        cascade.x[k] = x[k]
    return False


def takes_back(slope: Vector, back: Vector, n: int) -> bool:
    """Whether one direction is opposite to another that is not zero, in each component."""
    first = 0
    while first < n and slope[first] == 0:
        first += 1
    share = back[first] / slope[first] if first < n else 0
    for k in range(n):
        if not abs(back[k] - share * slope[k]) <= PARALLEL * abs(share) * abs(slope[k]):
            return False
    return share < 0
