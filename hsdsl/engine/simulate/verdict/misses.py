"""Surfaces that are almost reached, or passed over: along steps, where an arc begins or ends, and at the end of a run.

Along steps every surface is enclosed on parts of a step that are cut in halves (`steps`). A part is done where the
surface stays below zero although the states are moved by the error, or where it only rises or only falls there. What
remains are its turning points close to zero: these are evaluated one by one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, NOTHING, Number
from hsdsl.engine.execution import Arc
from hsdsl.engine.simulate.stops import Remark, of_edge, show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.endings import at_its_end, at_the_end
from hsdsl.engine.simulate.verdict.finding import Finding, times
from hsdsl.engine.simulate.verdict.near_surface import has_condition, may_hold, near_surface, rising_zero
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.steps import Parts, high, low, steps_of, undecided
from hsdsl.engine.simulate.verdict.tangent import leaves_along
from hsdsl.engine.simulate.verdict.transparent import (
    Passed,
    almost_left,
    begins_beyond,
    passed_at,
    reached,
    shares_between,
    transparent,
)

HALVINGS = 20
MOST_TURNING_POINTS = 256  # turning points, one by one


class Open(NamedTuple):
    """Consecutive parts of one step on which a surface may turn close to zero: from share to share of it."""

    row: int
    surface: int
    start: float
    end: float


class NearMiss(NamedTuple):
    """How often the error fits between a surface and the run where it turns back, the surface's name, and when."""

    margin: float
    name: str
    time: Number


def misses(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about every surface along every arc, and the nearest miss."""
    if run.errors is None:
        return [], []
    found: list[Finding] = []
    passed: Passed = {}
    nearest: NearMiss | None = None
    for steps in steps_of(run, marked="turning"):
        turning = _turning(run, steps)
        found += filter(
            None, (_turned(run, run.arc_of(each.row), each, passed) for each in turning[:MOST_TURNING_POINTS])
        )
        if len(turning) > MOST_TURNING_POINTS:
            more = f"{len(turning) - MOST_TURNING_POINTS} more turning points close to surfaces were not looked at"
            found.append(Finding("misses", "unknown", more))
    passing, near = run.undecided("transparent"), run.undecided("nearest")
    for steps in steps_of(run) if passing or near else ():
        if passing:
            found += transparent(run, steps, passed)
        if near:
            nearest = min(filter(None, (nearest, _nearest(run, steps))), default=None)
    for arc in run.undecided_flows("ending"):
        try:
            found += at_its_end(run, arc, run.crossed.get(arc.last))
        except DOMAIN_ERRORS:
            sentence = f"a surface of {arc.mode} has no value close to t = {show(run.times[arc.last])}"
            found.append(Finding("no value", "unknown", sentence))
    margins = _margins(run, nearest) if not found else []
    ended = at_the_end(run) if run.undecided("ending") else ()
    run.remarks = [of_edge("passed", name, time) for name, times in passed.items() for time in times]
    run.remarks += [Remark("beyond", *each.wall) for each in found if each.wall is not None]
    return [*found, *ended], [*margins, *(passed_at(name, at) for name, at in passed.items())]


def _margins(run: RunView, nearest: NearMiss | None) -> list[str]:
    """Say which turning point comes closest to its surface."""
    if not run.undecided("nearest") and run.screen is not None:
        return run.screen.margins.nearest_miss(run.problem.program.modes)
    if nearest is None:
        return []
    return [f"the nearest miss is of {nearest.name} at t = {show(nearest.time)}, by {times(nearest.margin)} the error"]


def _turning(run: RunView, steps: Parts) -> list[Open]:
    """Where surfaces may turn close to zero, by the enclosures."""
    mode = run.problem.program.modes[steps.mode]
    count = len(mode.edges) + len(mode.walls)
    if not count:
        return []

    begun = np.zeros((int(steps.row.max(initial=0)) + 1, count), dtype=bool)
    begun[steps.row, : len(mode.edges)] = _begun_beyond(run, steps)

    def decides(parts: Parts) -> NDArray[np.bool_]:
        kernel, t, x, n = parts.bound(run), parts.times, parts.states(SAFE), len(parts)
        values = kernel.surfaces(t, *x)
        below, beyond = (np.stack([end(r, n) for r in values], axis=1) for end in (high, low))
        open_ = np.where(begun[parts.row], ~(beyond > 0), ~(below < 0))
        for k in range(count):
            if open_[:, k].any():
                (rate,) = kernel.rates[k](t, *x)
                least, most = low(rate, n), high(rate, n)
                open_[:, k] &= ~((least > 0) | (most < 0) | ((least == 0) & (most == 0)))  # it rises, falls or stays
        return open_

    with np.errstate(all="ignore"):
        parts, open_ = undecided(steps, decides, HALVINGS)
    order = np.lexsort((parts.start, parts.row))
    found = (each for k in range(count) for each in _joined(parts, order[open_[order, k]], k))
    return sorted(found, key=lambda each: (each.row, each.start))


def _begun_beyond(run: RunView, steps: Parts) -> NDArray[np.bool_]:
    """Whether steps begin beyond the surfaces of edges with an `if`: these may be left and reached again.

    Where that is for round-off alone, and falls, it is left as the step begins.
    """
    edges = run.problem.program.modes[steps.mode].edges
    found = np.zeros((len(steps), len(edges)), dtype=bool)
    if any(edge.conditional for edge in edges):
        with np.errstate(all="ignore"):
            values = steps.bound(run).surfaces(*steps.ends()[0])
        for k, edge in enumerate(edges):
            found[:, k] = edge.conditional & (low(values[k], len(steps)) > 0)
            for i in np.flatnonzero(found[:, k]).tolist():
                found[i, k] = begins_beyond(run.at_row(run.arc_of(int(steps.row[i])), int(steps.row[i])), k)
    return found


def _joined(parts: Parts, which: NDArray[np.int64], surface: int) -> list[Open]:
    """Join those of the parts that follow each other; they are in order, and none overlap."""
    if not which.size:
        return []
    row, start = parts.row[which], parts.start[which]
    end = start + parts.width[which]
    apart = (row[1:] != row[:-1]) | (start[1:] > end[:-1])
    first, last = np.r_[True, apart], np.r_[apart, True]
    joined = zip(row[first].tolist(), start[first].tolist(), end[last].tolist(), strict=True)
    return [Open(at, surface, begin, until) for at, begin, until in joined]


def _turned(run: RunView, arc: Arc, each: Open, passed: Passed) -> Finding | None:
    """Decide a surface on parts of a step that the enclosures leave open, by its values there."""
    k, last = each.surface, each.row + 1 == arc.last
    if last and each.end >= 1 and k in run.tied_at_end(arc):
        return None  # `crossings` and `choices` decide it
    along = run.dense_output(arc, each.row)
    if run.followed and each.row == arc.first and not each.start and leaves_along(run, arc, k):
        return None
    try:
        places = [along(run.arithmetic.zero + s) for s in shares_between(each.start, each.end)]
        place = max(places, key=lambda place: place.value(k))
        if has_condition(place, k):
            beyond = begins_beyond(along(run.arithmetic.zero), k)
            if beyond or place.value(k) > place.roundoff_bound(k):
                finding = reached(
                    run, k, (arc, each.row), {*shares_between(0.0, 1.0), *shares_between(each.start, each.end)}, passed
                )
                return finding or (almost_left(run, k, each.row + 1, places) if beyond else None)
            if not may_hold(run, place, k, each.row + 1):
                return None
        if finding := near_surface(run, place, k, each.row + 1, "turns back close to"):
            return finding
        sentence = f"whether {place.name(k)} is reached close to t = {show(place.t)} could not be decided"
        return Finding("undecided", "unknown", sentence)
    except DOMAIN_ERRORS:
        time = show(run.times[each.row])
        return Finding("no value", "unknown", f"a surface of {arc.mode} has no value close to t = {time}")


def _nearest(run: RunView, steps: Parts) -> NearMiss | None:
    """The turning point that comes closest to its surface, measured in errors."""
    mode = run.problem.program.modes[steps.mode]
    count, best = len(mode.edges) + len(mode.walls), None
    with np.errstate(all="ignore"):
        kernel, (first, last), n = steps.bound(run), steps.ends(), len(steps)
        middle = steps.halves().take(slice(0, n)).ends()[1]
        for k in range(count):
            turns = (low(kernel.rates[k](*first)[0], n) > 0) & (high(kernel.rates[k](*last)[0], n) <= 0)
            if not turns.any():
                continue
            at_middle, moved = kernel.surfaces(*middle)[k], kernel.surfaces(middle[0], *steps.moved(middle[1:]))[k]
            below = -high(at_middle, n)
            margin = np.where(turns & (below > 0), below / np.maximum(high(moved, n) + below, NOTHING), np.inf)
            i = int(np.argmin(margin))
            if margin[i] < np.inf and (best is None or margin[i] < best[0]):
                best = float(margin[i]), k, int(steps.row[i])
    if best is None:
        return None
    _, k, row = best
    try:
        place = rising_zero(run.dense_output(run.arc_of(row), row), lambda place: -place.rate(k))
        shift, below = run.surface_error(place, k, row + 1), -place.value(k)
        if below <= 0 or (has_condition(place, k) and not may_hold(run, place, k, row + 1)):
            return None
        return NearMiss(float(below / shift) if shift > 0 else float("inf"), place.name(k), place.t)
    except DOMAIN_ERRORS:
        return None
