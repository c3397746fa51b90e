"""Where an arc or the run ends: surfaces that are about to be reached there, or were reached just before."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.engine.execution import Arc
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.agreement import SAFE
from hsdsl.engine.simulate.verdict.commutation import commute
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.input_jumps import indifferent, jumps_near
from hsdsl.engine.simulate.verdict.near_surface import has_condition, may_hold, near_surface
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.run_view import RunView

TWICE = 2  # as long as it takes to reach a surface: reached together


def at_its_end(run: RunView, arc: Arc, crossed: int | None) -> Iterator[Finding]:
    """Surfaces about to be reached where another is crossed or an input jumps: an error may change their order.

    Where an input has a kink, a surface may turn back.
    """
    place, until = run.at_row(arc, arc.last), run.problem.settings.until
    behind = run.problem.timeline.at(place.t)
    if crossed is None and place.t >= until and behind.start < place.t:
        return
    if crossed is None and not behind.jump:
        yield from _at_a_kink(run, arc, place)
        return
    if crossed is None:
        place = run.dense_output(arc, arc.last - 1)(run.arithmetic.zero + 1)
    alternatives = run.transitions[arc.jump].alternatives if crossed is not None else ()
    tied = {run.edge_at(place, name) for name in alternatives}  # `choices` decides these
    for k in range(len(place.mode.edges) + len(place.mode.walls)):
        if k == crossed or k in tied or place.value(k) > place.roundoff_bound(k) or not place.rate(k) > 0:
            continue
        finding = near_surface(run, place, k, arc.last, "is about to reach")
        if finding is None:
            continue
        error, late = run.safe_error(place, arc.last), run.safe_time_error(place, k, arc.last)
        if crossed is not None and place.outranks(crossed, k, error, late):
            continue
        if crossed is None:
            jumps = list(jumps_near(run, run.times[arc.last], 0.0)) if k < len(place.mode.edges) else []
            if jumps and all(indifferent(run, place, k, sides) for sides in jumps):
                continue
            what = f"an input or function of time jumps at t = {show(place.t)}"
            yield Finding("order", "unknown", f"{what}, within the error of reaching the surface of {place.name(k)}")
        elif k < len(place.mode.edges) and not commute(
            run,
            place,
            (crossed, k),
            run.tails_before(run.transitions[arc.jump]),
            TWICE * -place.value(k) / place.rate(k),
        ):
            sentence = (
                f"the order of {place.name(crossed)} and {place.name(k)} at t = {show(place.t)} is within the error"
            )
            yield Finding("order", "unknown", f"{sentence}, and it matters")


def _at_a_kink(run: RunView, arc: Arc, after: Place) -> Iterator[Finding]:
    """Surfaces that rise up to a kink of an input and no further."""
    before = run.dense_output(arc, arc.last - 1)(run.arithmetic.zero + 1)
    for k in range(len(after.mode.edges) + len(after.mode.walls)):
        if not before.rate(k) > 0 >= after.rate(k) or before.value(k) > before.roundoff_bound(k):
            continue
        if has_condition(before, k) and not may_hold(run, before, k, arc.last):
            continue
        margin = SAFE * run.surface_error(before, k, arc.last) + before.roundoff_bound(k)
        if abs(before.value(k)) <= margin:
            where = f"the surface of {before.name(k)} at t = {show(before.t)}, where an input has a kink"
            yield Finding("miss", "unknown", f"the run turns back within the error of {where}")


def at_the_end(run: RunView) -> Iterator[Finding]:
    """Surfaces reached just behind the end, or there but for the time in strips, and a transition just before it."""
    if run.errors is None or run.reliable_until < inf or run.stop.reason != "until" or not run.flows:
        return
    arc, until = run.flows[-1], run.times[-1]
    place = run.at_row(arc, arc.last)
    waited = sum(made.resumed - made.time for made in run.transitions if made.resumed is not None)
    if run.times[arc.last] == until:
        for k in range(len(place.mode.edges)):
            try:
                rate, error = place.rate(k), SAFE * run.surface_error(place, k, arc.last)
                near = rate > 0 and abs(place.value(k)) <= error + rate * waited
                if near and (not has_condition(place, k) or may_hold(run, place, k, arc.last)):
                    yield Finding("end", "unknown", _undecided(place.name(k)))
            except DOMAIN_ERRORS:
                continue
    if run.transitions:
        made, length = run.transitions[-1], float(run.times[-1] - run.times[0])
        late = run.errors.time_error_at(made.time) + run.errors.tolerance * length
        if until - made.time < SAFE * late:
            yield Finding("end", "unknown", _undecided(made.edge))


def _undecided(name: str) -> str:
    undecided = f"a transition of {name} within the error of the end is undecided"
    return f"{undecided}, and the last state with it: take `until` a little earlier or later, as between two samples"
