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
from hsdsl.simulate.contact import contact_at, in_contact, in_touch, is_possible, keeping, keeps, pushes
from hsdsl.simulate.diagnostics import FREE
from hsdsl.simulate.root_isolation import total
from hsdsl.simulate.run import ModeState, Run

LEAST_FLIGHTS = 3
MOST_CORRECTIONS = 4  # of a point towards a guard
MOST_ROUNDS = 60  # of acceleration towards a reset's fixed point


def contraction(made: Sequence[Transition]) -> tuple[Number, Number] | None:
    """Return the last flight and the largest ratio of the last few of the last edge, if they shrink; else None.

    Other edges that lead back to the same mode may fire meanwhile; :data:`FREE` transitions are looked at.
    """
    times: list[Number] = []
    for one in reversed(made[-FREE:]):
        if one.source != made[-1].source or one.source != one.target or one.entry:
            break
        if one.edge == made[-1].edge:
            times.append(one.time)
        if len(times) > LEAST_FLIGHTS:
            break
    flights = [a - b for a, b in pairwise(times)][::-1]
    if len(flights) < LEAST_FLIGHTS or not min(flights) > 0:
        return None
    ratio = max(b / a for a, b in pairwise(flights))
    return (flights[-1], ratio) if ratio < 1 else None


def close_tail(run: Run, here: ModeState, k: int) -> ModeState | Stop:
    """Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on."""
    made = run.recorder.transitions
    found = contraction(made)
    if found is None or here.mode.states != here.arc.states:
        return here
    flight, ratio = found
    left = flight * ratio / (1 - ratio)
    end = min(here.t + left, here.segment.end)
    if left > run.settings.relaxation or not end > here.t:
        return here
    edge = here.mode.edges[k]
    try:
        held = contact_at(run, here)
        if isinstance(held, Stop):
            return held
        if held.surfaces.releases(k):
            return here
        q = limit_of(run, here, held, k, end)
        touched = in_touch(here, held)
        if q is None or not keeps(run, limit := here.moved(end, q), k) or not is_possible(run, here, k, end, q, touched):
            return here
        if edge.contact is None or run.settings.completion == "none":
            return run.diagnostics.accumulates(edge.name, end, here.t)
        if not keeping(run, limit, [k], touched) or not pushes(run, limit, [*touched, k], [k]):
            return here
        if meets_another(here, limit, k):
            return here
    except DOMAIN_ERRORS:
        return here
    run.diagnostics.replaced(edge.name, len(made) - 1, end, left)
    here.arc.append(end, q, (tuple(b - a for a, b in zip(here.x, q, strict=True)),))
    rest = run.place(here.index, here.mode.states, end, q, here.surfaces.scale)
    rest.surfaces.enter(end, q, rest.kernel.surfaces(end, *q))
    rest.surfaces.active.add(k)
    return rest


def limit_of(run: Run, here: ModeState, held: ModeState, k: int, end: Number) -> State | None:
    """The point that a tail runs to: kept by resets, moved along the guards to its end, and kept by resets there."""
    q = fixed_point(here, k, here.t, here.x)
    if here.mode.edges[k].contact is not None:
        slope = in_contact(run, here, [*in_touch(here, held), k]).kernel.flow(here.t, *q)
        q = onto_guard(here, k, end, tuple(a + (end - here.t) * f for a, f in zip(q, slope, strict=True)))
    q = fixed_point(here, k, end, q)
    far = abs(here.kernel.surfaces(end, *q)[k]) > here.surfaces.roundoff_bound(k, end, q, entry=True)
    return None if far else q


def onto_guard(here: ModeState, k: int, t: Number, x: State) -> State:
    """A point near a guard taken to it, each state in proportion to its scale."""
    for _ in range(MOST_CORRECTIONS):
        r, gradient = here.kernel.surfaces(t, *x)[k], here.kernel.gradients[k](t, *x)[1:]
        if abs(r) <= here.surfaces.roundoff_bound(k, t, x):
            break
        weights = [g * s * s for g, s in zip(gradient, here.arc.scales, strict=True)]
        across = total((g * w for g, w in zip(gradient, weights, strict=True)), r * 0)
        if across > 0:
            x = tuple(a - r / across * w for a, w in zip(x, weights, strict=True))
    return x


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


def fixed_point(here: ModeState, k: int, t: Number, x: State) -> State:
    """The point that repeated resets run to (Aitken's acceleration, by component)."""
    reset = here.kernel.resets[k]
    for _ in range(MOST_ROUNDS):
        one = reset(t, *x)
        if one == x:
            break
        two = reset(t, *one)
        x = tuple(map(_accelerated, x, one, two))
    return x


def _accelerated(a: Number, b: Number, c: Number) -> Number:
    bend = c - 2 * b + a
    return a - (b - a) * (b - a) / bend if bend != 0 else c
