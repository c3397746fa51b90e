"""What does not lead on: steps of which no shorter one helps, and transitions without flow between that come back.

See hsdsl/engine/simulate/stalls.py and transitions.py there.
"""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.scheme.primitives import Count, Here, Room, Time, Vector, flow_between, inline

IDLE_UNITS = 64  # a step below this many units of round-off of time (or of the full step) is idle
MOST_IDLE = 64  # in a row: enough to close in on a surface to round-off
CREEPING = 10  # halvings; steps below a thousandth of the full one
MOST_CREEPING = 2000  # in a row: the run would take a thousand times its length in steps
SHORT = 1e-6  # of a run
MOST_SHORT = 100000  # steps within that, in one flight: so the run would take a hundred billion
MOST_CHATTER = 2000  # a step that turns the flow around counts 2, any other takes 1 back
PARALLEL = 1e-6  # of a component: flows that differ by less move no state on by more than this share of the way back
JUMP_HALVINGS = 40  # of the way between two states: what changes as much over the last of them jumps


@dataclass
class Pace:
    """Counts of the steps of one stretch of flow that do not lead on.

    The last step cut short ``reached`` a time: another start means full steps between. So many steps were ``made``
    ``since`` a time, which lasts as long as is ``brief``; ``turns`` counts those that turn the flow around.
    """

    unit: Number
    brief: Time
    since: Time
    reached: Time
    idle: int = 0
    creeping: int = 0
    made: int = 0
    turns: int = 0


def count_creeping(pace: Pace, halvings: int) -> bool:
    """Count a step that was halved so often; return whether too many in a row were far below the full step."""
    pace.creeping = pace.creeping + 1 if halvings >= CREEPING else 0
    return pace.creeping > MOST_CREEPING


def count_step(pace: Pace, t: Time) -> bool:
    """Count a step from t; return whether there were too many within a millionth of the run."""
    pace.made += 1
    if t - pace.since > pace.brief:
        pace.since, pace.made = t, 0
    return pace.made > MOST_SHORT


def count_cut_short(pace: Pace, t: Time, t1: Time, full: Number) -> bool:
    """Note where a step that was cut short ends; return whether it is idle, so that `count_idle` counts it."""
    if t != pace.reached:
        pace.idle = 0
        pace.creeping = 0
    pace.reached = t1
    return t1 - t <= IDLE_UNITS * pace.unit * max(t, full)


def count_idle(pace: Pace, idle: bool) -> bool:
    """Count a step that is idle or not; return whether too many in a row were."""
    pace.idle = pace.idle + 1 if idle else 0
    return pace.idle > MOST_IDLE


@inline
def count_turns(pace: Pace, slope: Vector, end: Vector, n: int) -> bool:
    """Count a step, by whether a component of the flow has the other sign at its end; return whether very many had."""
    turned = False
    for k in range(n):
        turned |= slope[k] * end[k] < 0
    if turned:
        pace.turns += 2
    elif pace.turns > 0:
        pace.turns -= 1
    if pace.turns < MOST_CHATTER:
        return False
    pace.turns = 0
    return True


def jump_between(here: Here, k: int, t: Time, x: Vector, t1: Time, z: Vector) -> tuple[Number, Number, Number] | None:
    """Find the share of the way from (t, x) to (t1, z) at which component k of the flow jumps, and its values there.

    They are those before and after the jump. None where it does not jump, or has no value.
    """
    low: Number = 0
    high: Number = 1
    try:
        before = flow_between(here, k, t, x, t1, z, low)
        behind = flow_between(here, k, t, x, t1, z, high)
    except DOMAIN_ERRORS:
        return None
    size = abs(behind - before)
    for _half in range(JUMP_HALVINGS):
        middle = (low + high) / 2
        try:
            value = flow_between(here, k, t, x, t1, z, middle)
        except DOMAIN_ERRORS:
            return None
        if abs(value - before) >= abs(behind - value):
            high, behind = middle, value
        else:
            low, before = middle, value
    if not (size > 0 and 2 * abs(behind - before) >= size):
        return None
    return high, before, behind


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
