"""Surfaces that a run passes while the `if` of their edge is false: does it stay false within the error?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.base.numbers.enclosures import Range
from hsdsl.engine.execution import Arc
from hsdsl.engine.simulate.stops import may_be_passed, show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.finding import Finding, times
from hsdsl.engine.simulate.verdict.near_surface import may_hold, passed_over, rising_zero
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.steps import Parts, high, low

SHARES = 9  # at one turning point

Passed = dict[str, list[Number]]  # when the surface of an edge was passed while its `if` was false


def transparent(run: RunView, steps: Parts, passed: Passed) -> Iterator[Finding]:
    """Surfaces passed where their condition does not hold: does it all around? Notes in ``passed`` where it does."""
    edges = run.problem.program.modes[steps.mode].edges
    if not any(edge.conditional for edge in edges):
        return
    with np.errstate(all="ignore"):
        kernel, (first, last) = steps.bound(run), (_recorded(run, steps, after) for after in (0, 1))
        before, after = (kernel.surfaces(*end) for end in (first, last))
    for k, edge in enumerate(edges):
        if not edge.conditional:
            continue
        rising = (low(before[k], len(steps)) <= 0) & (high(after[k], len(steps)) > 0)
        for i in np.flatnonzero(rising).tolist():
            row = int(steps.row[i])
            arc = run.arc_of(row)
            if row + 1 == arc.last and k in run.tied_at_end(arc):
                continue
            place = rising_zero(run.dense_output(arc, row), lambda place: place.value(k))  # noqa: B023
            level = SAFE * run.surface_error(place, k, row + 1) + place.roundoff_bound(k)
            reached = place.value(k) > 0 or abs(place.value(k)) <= level
            if reached and (finding := undecided_condition(run, place, k, row + 1, passed)):
                yield finding


def _recorded(run: RunView, steps: Parts, after: int) -> list[Range]:
    """Time and states of the rows where steps begin, or of those after them: a polynomial ends beside its row."""
    rows, execution = steps.row + after, run.execution
    points = np.column_stack([execution.times[rows], execution.values[rows][:, : steps.bernstein.shape[1]]])
    return [Range(column, column) for column in points.astype(float).T]


def shares_between(start: float, end: float) -> list[float]:
    """Shares of a step at which it is sampled, from one to another."""
    return [start + (end - start) * i / (SHARES - 1) for i in range(SHARES)]


def reached(run: RunView, k: int, step: tuple[Arc, int], at: Iterable[float], passed: Passed) -> Finding | None:
    """A finding about the places where a step reaches surface k, of an edge with an `if`, from inside.

    ``step`` is its arc and the row where it begins; ``at`` are the shares between which such places are found.
    """
    (arc, row), shares, along = step, sorted(at), run.dense_output(*step)
    start = along(run.arithmetic.zero)
    values = [start.value(k), *(along(run.arithmetic.zero + s).value(k) for s in shares[1:])]
    if values[0] <= start.roundoff_bound(k) and not start.rate(k) > 0:
        values[0] = run.arithmetic.zero
    seen = values[0] <= 0 < values[-1]  # by `transparent`
    if row + 1 == arc.last and k in run.tied_at_end(arc):
        del shares[-1]  # `crossings` and `choices` decide the end
    for (a, before), (b, after) in pairwise(zip(shares, values, strict=False)):
        if not before <= 0 < after:
            continue
        place = rising_zero(lambda s: along(a + s * (b - a)), lambda place: place.value(k))  # noqa: B023
        if place.conditions(k, run.safe_error(place, row + 1), run.safe_time_error(place, k, row + 1)) == {True}:
            return passed_over(place, k)
        noted = any(abs(t - place.t) <= run.tie(t) for t in passed.get(place.name(k), ()))
        if finding := undecided_condition(run, place, k, row + 1, {} if seen or noted else passed):
            return finding
    return None


def begins_beyond(start: Place, k: int) -> bool:
    """Whether a step begins beyond surface k, by more than round-off unless it rises there."""
    return start.value(k) > start.roundoff_bound(k) or (start.value(k) > 0 and start.rate(k) > 0)


def almost_left(run: RunView, k: int, row: int, places: Sequence[Place]) -> Finding | None:
    """A miss where a step to a row turns back close to surface k and beyond it: the error may take it inside."""
    place = min(places, key=lambda place: place.value(k))
    shift = run.surface_error(place, k, row)
    if not 0 < place.value(k) <= SAFE * shift or not may_hold(run, place, k, row):
        return None
    where = f"the surface of {place.name(k)} at t = {show(place.t)}"
    away = times(place.value(k) / shift)
    return Finding("miss", "unknown", f"the run turns back close to {where}, beyond it by {away} the error")


def undecided_condition(run: RunView, place: Place, k: int, row: int, passed: Passed) -> Finding | None:
    """Note that a surface is passed at a place where its condition does not hold, or say that it might."""
    error, late = run.safe_error(place, row), run.safe_time_error(place, k, row)
    first = row in run.crossed and place.outranks(run.crossed[row], k, error, late)
    if first or place.conditions(k, error, late) == {False}:
        left = row in run.crossed and run.times[row] - place.t <= run.tie(place.t)  # the mode, at that very instant
        if not left and may_be_passed(run.problem.program, place.mode.edges[k]):
            passed.setdefault(place.name(k), []).append(place.t)
        return None
    where = f"{place.name(k)} at t = {show(place.t)}"
    return Finding("condition", "unknown", f"whether the condition of {where} holds is within the error")


def passed_at(name: str, at: list[Number]) -> str:
    more = f" and {len(at) - 1} more times" if len(at) > 1 else ""
    return (
        f"the surface of {name} was passed at t = {show(min(at))}{more} while its `if` was false: "
        "it fires only where it is reached again from inside"
    )
