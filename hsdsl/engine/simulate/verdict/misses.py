"""Surfaces that are almost reached, passed over or passed: along steps, where an arc ends, and at the end of a run.

Along steps every surface is enclosed on parts of a step that are cut in halves (`steps`). A part is done where the
surface stays below zero although the states are moved by the error, or where it only rises or only falls there. What
remains are its turning points close to zero: these are evaluated one by one. A surface may be passed while the `if` of
its edge is false, as long as that stays false within the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, NOTHING, Number
from hsdsl.base.numbers.enclosures import Range, Undecided
from hsdsl.engine.execution import Arc
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.stops import Remark, may_be_passed, of_edge, show, wall_of
from hsdsl.engine.simulate.surfaces import ROUNDOFF_UNITS
from hsdsl.engine.simulate.verdict.commutation import commute
from hsdsl.engine.simulate.verdict.errors import SAFE, times
from hsdsl.engine.simulate.verdict.resets import indifferent, jumps_near, leaves_along
from hsdsl.engine.simulate.verdict.run_view import ROUNDS, Finding, Place, RunView
from hsdsl.engine.simulate.verdict.steps import Parts, high, low, steps_of, undecided

HALVINGS = 20
MOST_TURNING_POINTS = 1024  # of a mode, one by one: each takes milliseconds
CLOSEST = 2.0**-ROUNDS  # shares of a step that count as one
SHARES = 9  # at one turning point
TWICE = 2  # as long as it takes to reach a surface: reached together; as deep as a strip: beyond a surface

Passed = dict[str, list[Number]]  # when the surface of an edge was passed while its `if` was false
Miss = tuple[float, str, Number]  # how often the error fits between a surface and the run, its name, and when


class Open(NamedTuple):
    """Consecutive parts of one step on which a surface may turn close to zero: from share to share of it."""

    row: int
    surface: int
    start: float
    end: float


def misses(run: RunView) -> tuple[list[Finding], list[str]]:
    """Findings about every surface along every arc, and the nearest miss."""
    if run.errors is None:
        return [], []
    found: list[Finding] = []
    passed: Passed = {}
    nearest: Miss | None = None
    for steps in steps_of(run, marked="turning"):
        turning = _turning(run, steps)
        found += filter(None, (_turned(run, each, passed) for each in turning[:MOST_TURNING_POINTS]))
        if len(turning) > MOST_TURNING_POINTS:
            left, mode = turning[MOST_TURNING_POINTS:], run.problem.program.modes[steps.mode].name
            since = f"from t = {show(run.times[left[0].row])} on were not checked"
            more = f"{len(left)} turning points close to surfaces of {mode} {since}"
            found.append(Finding("misses", "unknown", more))
    passing, near = run.undecided("transparent"), run.undecided("nearest")
    for steps in steps_of(run) if passing or near else ():
        if passing:
            found += _transparent(run, steps, passed)
        if near:
            nearest = min(filter(None, (nearest, _nearest(run, steps))), default=None)
    for arc in run.undecided_flows("ending"):
        try:
            found += _at_its_end(run, arc, run.crossed.get(arc.last))
        except DOMAIN_ERRORS:
            sentence = f"a surface of {arc.mode} has no value close to t = {show(run.times[arc.last])}"
            found.append(Finding("no value", "unknown", sentence))
    margins: list[str] = []
    if not found and not near and run.screen is not None:
        margins = run.screen.margins.nearest_miss(run.problem.program.modes)
    elif not found and nearest is not None:
        margin, name, time = nearest
        margins = [f"the nearest miss is that of {name} at t = {show(time)}, at {times(margin)} the error"]
    ended = _at_the_end(run) if run.undecided("ending") else ()
    run.remarks = [of_edge("passed", name, time) for name, at in passed.items() for time in at]
    run.remarks += [Remark("beyond", *each.wall) for each in found if each.wall is not None]
    return [*found, *ended], [*margins, *(_passed_at(name, at) for name, at in passed.items())]


def _passed_at(name: str, at: list[Number]) -> str:
    more = f" and {len(at) - 1} more times" if len(at) > 1 else ""
    return (
        f"the surface of {name} was passed at t = {show(min(at))}{more} while its `if` was false: "
        "it fires only where it is reached again from inside"
    )


# Turning points along steps


def _turning(run: RunView, steps: Parts) -> list[Open]:
    """Where surfaces may turn close to zero, by the enclosures."""
    mode = run.problem.program.modes[steps.mode]
    count = len(mode.surfaces)
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
    edges, n = run.problem.program.modes[steps.mode].edges, len(steps)
    found = np.zeros((n, len(edges)), dtype=bool)
    conditional = [k for k, edge in enumerate(edges) if edge.conditional]
    if conditional:
        kernel, first = steps.bound(run), steps.ends()[0]
        with np.errstate(all="ignore"):
            values = kernel.surfaces(*first)
            for k in conditional:
                found[:, k] = low(values[k], n) > 0
                sure = (low(kernel.rates[k](*first)[0], n) > 0) | (low(values[k], n) > _roundoff(kernel, k, first, n))
                for i in np.flatnonzero(found[:, k] & ~sure).tolist():
                    found[i, k] = _begins_beyond(run.at_row(run.arc_of(int(steps.row[i])), int(steps.row[i])), k)
    return found


def _roundoff(kernel: ModeKernel, k: int, first: list[Range], n: int) -> NDArray[np.float64]:
    """Twice a bound of the round-off of surface k where steps begin; infinite where it is not known."""

    def size(value: Any) -> NDArray[np.float64]:
        return np.maximum(np.abs(low(value, n)), np.abs(high(value, n)))

    try:
        slopes, total = kernel.gradients[k](*first), size(kernel.magnitudes(*first)[k])
    except (Undecided, *DOMAIN_ERRORS):
        return np.full(n, np.inf)
    total = sum((size(slope) * size(x) for slope, x in zip(slopes, first, strict=True)), total)
    return np.where(np.isfinite(total), 2 * ROUNDOFF_UNITS * FLOAT64.unit * total, np.inf)


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


def _turned(run: RunView, each: Open, passed: Passed) -> Finding | None:
    """Decide a surface on parts of a step that the enclosures leave open, by its values there."""
    k, row, arc = each.surface, each.row, run.arc_of(each.row)
    if row + 1 == arc.last and each.end >= 1 and k in run.tied_at_end(arc):
        return None  # `crossings` and `choices` decide it
    along = run.dense_output(arc, row)
    if run.followed and row == arc.first and not each.start and leaves_along(run, arc, k):
        return None
    try:
        shares = _shares_between(each.start, each.end)
        places = [along(run.arithmetic.zero + s) for s in shares]
        place = max(places, key=lambda place: place.value(k))
        if place.has_condition(k):
            beyond = _begins_beyond(along(run.arithmetic.zero), k)
            if beyond or place.value(k) > place.roundoff_bound(k):
                finding = _reached(run, k, (arc, row), {*_shares_between(0.0, 1.0), *shares}, passed)
                return finding or (_almost_left(run, k, row + 1, places) if beyond else None)
            if not run.may_hold(place, k, row + 1):
                return None
        if finding := near_surface(run, place, k, row + 1, "turns back close to"):
            return finding
        sentence = f"whether {place.name(k)} is reached close to t = {show(place.t)} could not be decided"
        return Finding("undecided", "unknown", sentence)
    except DOMAIN_ERRORS:
        time = show(run.times[row])
        return Finding("no value", "unknown", f"a surface of {arc.mode} has no value close to t = {time}")


def _nearest(run: RunView, steps: Parts) -> Miss | None:
    """The turning point that comes closest to its surface, measured in errors."""
    best = None
    with np.errstate(all="ignore"):
        kernel, (first, last), n = steps.bound(run), steps.ends(), len(steps)
        middle = steps.halves().take(slice(0, n)).ends()[1]
        for k in run.problem.program.modes[steps.mode].surfaces:
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
        if below <= 0 or not run.may_hold(place, k, row + 1):
            return None
        return float(below / shift) if shift > 0 else inf, place.name(k), place.t
    except DOMAIN_ERRORS:
        return None


def _shares_between(start: float, end: float) -> list[float]:
    """Shares of a step at which it is sampled, from one to another."""
    return [start + (end - start) * i / (SHARES - 1) for i in range(SHARES)]


def rising_zero(along: Callable[[Number], Place], of: Callable[[Place], Number]) -> Place:
    """Close in on where a function of the place rises through zero between the ends of a step (secants, halves)."""
    a, b, place = 0.0, 1.0, along(1.0)
    below, above = of(along(0.0)), of(place)
    for k in range(3 * ROUNDS):
        if b - a <= CLOSEST:
            break
        share = below / (below - above) if k % 3 < 2 and below <= 0 < above else 0.5
        s = min(max(a + (b - a) * float(share), a + CLOSEST / 2), b - CLOSEST / 2)
        found = along(s)
        if not (value := of(found)) > 0:
            a, below = s, value
        else:
            b, place, above = s, found, value
    return place


def near_surface(run: RunView, place: Place, k: int, row: int, how: str) -> Finding | None:
    """Say whether the error could make another execution of a surface that the run is close to, or beyond."""
    value, shift, level = place.value(k), run.surface_error(place, k, row), place.roundoff_bound(k)
    if run.problem.settings.scheme == "relaxed":
        slopes = place.kernel.gradients[k](place.t, *place.x)
        level = level + TWICE * run.problem.settings.relaxation * sum((abs(g) for g in slopes), level * 0)
    margin = abs(value) / shift if shift > 0 else run.arithmetic.zero + inf
    if not (value > level or margin < SAFE) or not run.may_hold(place, k, row):
        return None
    if value > level:
        return _passed_over(place, k)
    return Finding("miss", "unknown", f"the run {how} {place.where(k)}, {times(margin)} the error away")


def _passed_over(place: Place, k: int) -> Finding:
    """The finding that a step was beyond a surface."""
    sentence = f"inside a step, at t = {show(place.t)}, the run is beyond the surface of {place.name(k)}"
    wall = (wall_of(place.mode, k), place.t) if k >= len(place.mode.edges) else None
    return Finding("passed over", "unknown", f"{sentence}: transitions were passed over", wall)


# Surfaces of edges with an `if`


def _transparent(run: RunView, steps: Parts, passed: Passed) -> Iterator[Finding]:
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
            if reached and (finding := _undecided_condition(run, place, k, row + 1, passed)):
                yield finding


def _recorded(run: RunView, steps: Parts, after: int) -> list[Range]:
    """Time and states of the rows where steps begin, or of those after them: a polynomial ends beside its row."""
    rows, execution = steps.row + after, run.execution
    points = np.column_stack([execution.times[rows], execution.values[rows][:, : steps.bernstein.shape[1]]])
    return [Range(column, column) for column in points.astype(float).T]


def _reached(run: RunView, k: int, step: tuple[Arc, int], at: Iterable[float], passed: Passed) -> Finding | None:
    """A finding about the places where a step reaches surface k, of an edge with an `if`, from inside.

    ``step`` is its arc and the row where it begins; ``at`` are the shares between which such places are found.
    """
    (arc, row), shares, along = step, sorted(at), run.dense_output(*step)
    start = along(run.arithmetic.zero)
    values = [start.value(k), *(along(run.arithmetic.zero + s).value(k) for s in shares[1:])]
    if values[0] <= start.roundoff_bound(k) and not start.rate(k) > 0:
        values[0] = run.arithmetic.zero
    seen = values[0] <= 0 < values[-1]  # by `_transparent`
    if row + 1 == arc.last and k in run.tied_at_end(arc):
        del shares[-1]  # `crossings` and `choices` decide the end
    for (a, before), (b, after) in pairwise(zip(shares, values, strict=False)):
        if not before <= 0 < after:
            continue
        place = rising_zero(lambda s: along(a + s * (b - a)), lambda place: place.value(k))  # noqa: B023
        if run.conditions(place, k, row + 1) == {True}:
            return _passed_over(place, k)
        noted = any(abs(t - place.t) <= run.tie(t) for t in passed.get(place.name(k), ()))
        if finding := _undecided_condition(run, place, k, row + 1, {} if seen or noted else passed):
            return finding
    return None


def _begins_beyond(start: Place, k: int) -> bool:
    """Whether a step begins beyond surface k, by more than round-off unless it rises there."""
    return start.value(k) > start.roundoff_bound(k) or (start.value(k) > 0 and start.rate(k) > 0)


def _almost_left(run: RunView, k: int, row: int, places: Sequence[Place]) -> Finding | None:
    """A miss where a step to a row turns back close to surface k and beyond it: the error may take it inside."""
    place = min(places, key=lambda place: place.value(k))
    shift = run.surface_error(place, k, row)
    if not 0 < place.value(k) <= SAFE * shift or not run.may_hold(place, k, row):
        return None
    away = times(place.value(k) / shift)
    sentence = f"the run turns back close to {place.where(k)}, beyond it by {away} the error"
    return Finding("miss", "unknown", sentence)


def _undecided_condition(run: RunView, place: Place, k: int, row: int, passed: Passed) -> Finding | None:
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


# Ends of arcs and of the run


def _at_its_end(run: RunView, arc: Arc, crossed: int | None) -> Iterator[Finding]:
    """Surfaces about to be reached where another is crossed or an input jumps: an error may change their order.

    Where an input has a kink, a surface may turn back.
    """
    place, until = run.at_row(arc, arc.last), run.problem.settings.until
    behind = run.problem.timeline.at(place.t)
    if crossed is None and place.t >= until and behind.start < place.t:
        return
    if crossed is None:
        before = run.dense_output(arc, arc.last - 1)(run.arithmetic.zero + 1)
        if not behind.jump:
            yield from _at_a_kink(run, arc, before, place)
            return
        place = before
    alternatives = run.transitions[arc.jump].alternatives if crossed is not None else ()
    tied = {run.edge_at(place, name) for name in alternatives}  # `choices` decides these
    for k in place.mode.surfaces:
        if k == crossed or k in tied or place.value(k) > place.roundoff_bound(k) or not place.rate(k) > 0:
            continue
        if near_surface(run, place, k, arc.last, "is about to reach") is None:
            continue
        edge = k < len(place.mode.edges)
        if crossed is None:
            jumps = list(jumps_near(run, run.times[arc.last], 0.0)) if edge else []
            if jumps and all(indifferent(run, place, k, sides) for sides in jumps):
                continue
            what = f"an input or function of time jumps at t = {show(place.t)}"
            yield Finding("order", "unknown", f"{what}, within the error of reaching the surface of {place.name(k)}")
            continue
        error, late = run.safe_error(place, arc.last), run.safe_time_error(place, k, arc.last)
        if place.outranks(crossed, k, error, late) or not edge:
            continue
        tails, since = run.tails_before(run.transitions[arc.jump]), TWICE * -place.value(k) / place.rate(k)
        if not commute(run, place, (crossed, k), tails, since):
            order = f"the order of {place.name(crossed)} and {place.name(k)} at t = {show(place.t)}"
            yield Finding("order", "unknown", f"{order} is within the error, and it matters")


def _at_a_kink(run: RunView, arc: Arc, before: Place, after: Place) -> Iterator[Finding]:
    """Surfaces that rise up to a kink of an input and no further."""
    for k in after.mode.surfaces:
        if not before.rate(k) > 0 >= after.rate(k) or before.value(k) > before.roundoff_bound(k):
            continue
        if not run.may_hold(before, k, arc.last):
            continue
        margin = SAFE * run.surface_error(before, k, arc.last) + before.roundoff_bound(k)
        if abs(before.value(k)) <= margin:
            where = f"{before.where(k)}, where an input has a kink"
            yield Finding("miss", "unknown", f"the run turns back within the error of {where}")


def _at_the_end(run: RunView) -> Iterator[Finding]:
    """Surfaces reached just after the end, or there but for the time in strips, and a transition just before it."""
    if run.errors is None or run.reliable_until < inf or run.stop.reason != "until" or not run.flows:
        return
    arc, until = run.flows[-1], run.times[-1]
    place, names = run.at_row(arc, arc.last), list[str]()
    waited = sum(made.resumed - made.time for made in run.transitions if made.resumed is not None)
    if run.times[arc.last] == until:
        for k in range(len(place.mode.edges)):
            try:
                rate, error = place.rate(k), SAFE * run.surface_error(place, k, arc.last)
                near = rate > 0 and abs(place.value(k)) <= error + rate * waited
                if near and run.may_hold(place, k, arc.last):
                    names.append(place.name(k))
            except DOMAIN_ERRORS:
                continue
    if run.transitions:
        made, length = run.transitions[-1], float(run.times[-1] - run.times[0])
        if until - made.time < SAFE * (run.errors.time_error_at(made.time) + run.errors.tolerance * length):
            names.append(made.edge)
    for name in names:
        what = f"a transition of {name} within the error of the end is undecided, and the last state with it"
        advice = "take `until` a little earlier or later, as between two samples"
        yield Finding("end", "unknown", f"{what}: {advice}")
