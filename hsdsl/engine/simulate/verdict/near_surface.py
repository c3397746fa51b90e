"""One surface at one place of a run: could the error make another execution of it?"""

from __future__ import annotations

from collections.abc import Callable

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.simulate.stops import show, wall_of
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding, times
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.run_view import RunView

ROUNDS = 48  # of closing in on a zero
TWICE = 2  # as deep as a strip: beyond a surface


def has_condition(place: Place, k: int) -> bool:
    return k < len(place.mode.edges) and place.mode.edges[k].conditional


def may_hold(run: RunView, place: Place, k: int, row: int) -> bool:
    """Whether the `if` of an edge holds at a place or at a state that the error moves it to."""
    return place.conditions(k, run.safe_error(place, row), run.safe_time_error(place, k, row)) != {False}


def near_surface(run: RunView, place: Place, k: int, row: int, how: str) -> Finding | None:
    """Say whether the error could make another execution of a surface that the run is close to, or beyond."""
    value, shift = place.value(k), run.surface_error(place, k, row)
    margin = abs(value) / shift if shift > 0 else run.arithmetic.zero + float("inf")
    beyond = value > _level(run, place, k)
    if not (beyond or margin < SAFE) or (has_condition(place, k) and not may_hold(run, place, k, row)):
        return None
    if beyond:
        return passed_over(place, k)
    where = f"the surface of {place.name(k)} at t = {show(place.t)}"
    return Finding("miss", "unknown", f"the run {how} {where}, {times(margin)} the error away")


def passed_over(place: Place, k: int) -> Finding:
    """The finding that a step was beyond a surface."""
    sentence = f"inside a step, at t = {show(place.t)}, the run is beyond the surface of {place.name(k)}"
    wall = (wall_of(place.mode, k), place.t) if k >= len(place.mode.edges) else None
    return Finding("passed over", "unknown", f"{sentence}: transitions were passed over", wall)


def _level(run: RunView, place: Place, k: int) -> Number:
    """Below this a surface value is none: round-off, and a strip of the relaxed scheme."""
    level = place.roundoff_bound(k)
    if run.problem.settings.scheme == "relaxed":
        slopes = place.kernel.gradients[k](place.t, *place.x)
        level = level + TWICE * run.problem.settings.relaxation * sum((abs(g) for g in slopes), level * 0)
    return level


def rising_zero(along: Callable[[Number], Place], of: Callable[[Place], Number]) -> Place:
    """Close in on where a function of the place rises through zero between the ends of a step (bisection)."""
    a = 0.0
    b, place = 1.0, along(1.0)
    for _ in range(ROUNDS):
        s = (a + b) / 2
        found = along(s)
        if of(found) <= 0:
            a = s
        else:
            b, place = s, found
    return place
