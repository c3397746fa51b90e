"""Zeno tails: impacts that follow each other ever faster towards rest on a guard are replaced by their limit (M11).

Flights T_n of one edge that leads back to its own mode shrink by the ratio q at least; what is left is then at most
T_n q/(1 - q). Once that is below the relaxation the state is taken to the limit, where it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Stop, Transition
from hsdsl.integrators.stepper import State
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.sticking import is_pushed, moves_alone, stays

LEAST_FLIGHTS = 3
MOST_ROUNDS = 60  # of acceleration towards a reset's fixed point


def contraction(made: Sequence[Transition]) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of the last few, if one edge's flights shrink; else None."""
    last = made[-LEAST_FLIGHTS - 1 :]
    if len(last) <= LEAST_FLIGHTS or not all(_one_edge(t, last[0]) for t in last):
        return None
    flights = [b.time - a.time for a, b in pairwise(last)]
    if not flights[-1] > 0:
        return None
    ratios = [b / a for a, b in pairwise(flights) if a > 0]
    shrinking = len(ratios) == LEAST_FLIGHTS - 1 and max(ratios) < 1
    return (flights[-1], max(ratios)) if shrinking else None


def _one_edge(one: Transition, other: Transition) -> bool:
    same = (one.edge, one.source) == (other.edge, other.source)
    return same and one.source == one.target and not one.entry


def close_tail(run: Run, here: ModeState, k: int) -> ModeState | Stop:
    """Go to the limit of a tail that is nearly over; stop at one where more than the impacts goes on."""
    made = run.recorder.transitions
    found = contraction(made)
    if found is None or here.mode.states != here.arc.states:
        return here
    flight, ratio = found
    left = flight * ratio / (1 - ratio)
    end = here.t + left
    if left > run.settings.relaxation or end > here.segment.end:
        return here
    try:
        q = fixed_point(here, k, end)
        if q is None:
            return here
        limit = here.moved(end, q)
        if not is_pushed(run, limit, k) or not stays(run, limit, k) or meets_another(here, limit, k):
            return here
        alone = moves_alone(run, limit, k)
    except DOMAIN_ERRORS:
        return here
    edge = here.mode.edges[k].name
    if not alone:
        return run.diagnostics.accumulates(edge, end, here.t)
    run.diagnostics.replaced(edge, len(made) - 1, end, left)
    here.arc.append(end, q, (tuple(b - a for a, b in zip(here.x, q, strict=True)),))
    mode = here.index
    rest = run.place(mode, here.mode.states, end, q, here.surfaces.scale)
    rest.surfaces.enter(end, q, rest.kernel.surfaces(end, *q))
    rest.surfaces.active.add(k)
    return rest


def meets_another(here: ModeState, limit: ModeState, k: int) -> bool:
    """Whether a surface other than k is passed on the way to a limit."""
    surfaces = here.surfaces
    before, after = here.kernel.surfaces(here.t, *here.x), here.kernel.surfaces(limit.t, *limit.x)
    for j, (one, two) in enumerate(zip(before, after, strict=True)):
        rises = two > surfaces.roundoff_bound(j, limit.t, limit.x) and not one > surfaces.roundoff_bound(
            j, here.t, here.x
        )
        if j != k and rises:
            return True
    return False


def fixed_point(here: ModeState, k: int, t: Number) -> State | None:
    """The point on the guard that repeated resets run to (Aitken's acceleration, by component)."""
    reset, x = here.kernel.resets[k], here.x
    for _ in range(MOST_ROUNDS):
        one = reset(t, *x)
        if one == x:
            break
        two = reset(t, *one)
        x = tuple(map(_accelerated, x, one, two))
    if abs(here.kernel.surfaces(t, *x)[k]) > here.surfaces.roundoff_bound(k, t, x, entry=True):
        return None
    return x


def _accelerated(a: Number, b: Number, c: Number) -> Number:
    bend = c - 2 * b + a
    return a - (b - a) * (b - a) / bend if bend != 0 else c
