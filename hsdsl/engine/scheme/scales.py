"""The scales of states that errors are compared with: see hsdsl/engine/integrators/stepper.py.

The *scale* of a state is the largest size it has had in a run. No error of a state is compared with 1: a state may be a
current of 1e-12 or a pressure of 1e5. A state whose flow is a small difference of large terms, as the speed of a mass
at rest on a spring, may be no more than their round-off. So where a step cannot be accepted, the scale of a state is
not below a share of what these terms could move it by (`resolved`): that share whose tolerance is so many units of
round-off of this, and no more than a thirty-second.
"""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.scheme.primitives import (
    Here,
    IndexRoom,
    Room,
    Time,
    Vector,
    flow_at,
    has_terms,
    inline,
    may_fail,
    terms_at,
)

SHARE = 32  # the terms of a flow may move a state by at least so many times its scale in a step
NOISE_UNITS = 64  # units of round-off of what they move it by: no tolerance asks for less
ITERATED = 1024  # units of it: no iteration asks for less
BLUR_UNITS = 4  # units of round-off of its terms that a flow changes by with them


@dataclass
class Resolved:
    """Scales of states over a step, ``found`` by what the terms of their flow could move them by. The rest is room."""

    unit: Number
    tolerance: Number
    found: Room
    least: Room
    slope: Room
    near: Room
    other: Room
    diagonal: Room
    lifted: IndexRoom


@inline
def is_finite(x: Number) -> bool:
    """Whether a number is one."""
    return x - x == 0


@inline
def move_of(place: int) -> int:
    """Units of round-off by which one of the last digits moves."""
    digit = place % 4
    return (2 if digit < 2 else 6) * (1 if digit % 2 == 0 else -1)


@may_fail
def flow_terms(here: Here, by: Resolved, n: int, t: Time, x: Vector) -> None:
    """The sizes of the terms of a flow, by what the last digits of states that have moved so far change in it.

    No two of 255 states, and no state and time, move alike in all probes: in each another digit of a place, to the base
    4, says how. So the terms of a difference do not stay equal.
    """
    every = 1
    for s in range(n):
        by.least[s] = 0
    for probe in range(4):
        for s in range(n):
            by.near[s] = x[s] + move_of(s // every + probe) * by.unit * by.found[s]
        flow_at(here, t + move_of(n // every + probe) * by.unit * t, by.near, by.other)
        for s in range(n):
            by.least[s] = max(by.least[s], abs(by.other[s] - by.slope[s]))
        every = 4 * every
    for s in range(n):
        by.least[s] = by.least[s] / (BLUR_UNITS * by.unit)


@may_fail
def resolve(here: Here, by: Resolved, n: int, t: Time, h: Number, x: Vector, scales: Vector, implicit: bool) -> None:
    """Find the scales over a step of length h, none below a share of what the terms of its flow could move it by.

    A state that they lift moves others in turn. A routine bounds the terms, or last digits tell. An ``implicit`` step
    has the derivative of each state's flow by itself in ``diagonal``: there a fast decay forgets round-off.
    """
    flow_at(here, t, x, by.slope)
    share = max(SHARE, by.tolerance / ((ITERATED if implicit else NOISE_UNITS) * by.unit))
    for s in range(n):
        by.found[s] = scales[s]
        by.lifted[s] = 0
    for _round in range(n):
        if has_terms(here):
            terms_at(here, t, x, by.found, by.least)
        else:
            flow_terms(here, by, n, t, x)
        further = False
        for s in range(n):
            size = h * by.least[s]
            if implicit:
                size = size / (1 + h * abs(by.diagonal[s]))
            if is_finite(size) and size > share * scales[s]:
                by.found[s] = max(by.found[s], size)
                further |= by.lifted[s] == 0
                by.lifted[s] = 1
        if not further:
            break
    for s in range(n):
        by.found[s] = max(scales[s], by.found[s] / share)
