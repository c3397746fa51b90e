"""Where an arc or the run ends: surfaces that are about to be reached there, or were reached just before."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

from hsdsl.arithmetic import DOMAIN_ERRORS
from hsdsl.execution import Arc
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.agreement import SAFE
from hsdsl.simulate.verdict.commutation import commute
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.judged import judged
from hsdsl.simulate.verdict.run_view import RunView

TWICE = 2  # as long as it takes to reach a surface: reached together


def at_its_end(run: RunView, arc: Arc, crossed: int | None) -> Iterator[Finding]:
    """Surfaces about to be reached where another is crossed or an input jumps: an error may change their order."""
    place, until = run.at_row(arc, arc.last), run.problem.settings.until
    if crossed is None and (place.t >= until or not run.problem.timeline.at(place.t).jump):
        return
    if crossed is None:
        place = run.between(arc, arc.last - 1)(run.arithmetic.zero + 1)
    for k in range(len(place.mode.edges) + len(place.mode.walls)):
        if k == crossed or place.value(k) > place.roundoff_bound(k) or not place.rate(k) > 0:
            continue
        if crossed is not None and crossed != k and place.outranks(crossed, k, run.around(place, arc.last)):
            continue
        finding = judged(run, place, k, arc.last, "is about to reach")
        if finding is None:
            continue
        if crossed is None:
            yield Finding(
                "order",
                "unknown",
                f"an input jumps at t = {show(place.t)}, within the error of reaching the surface of {place.name(k)}",
            )
        elif k < len(place.mode.edges) and not commute(
            run, place, (crossed, k), TWICE * -place.value(k) / place.rate(k)
        ):
            sentence = (
                f"the order of {place.name(crossed)} and {place.name(k)} at t = {show(place.t)} is within the error"
            )
            yield Finding("order", "unknown", f"{sentence}, and it matters")


def at_the_end(run: RunView) -> Iterator[Finding]:
    """Surfaces that would be reached just behind the end, and a transition just before it."""
    if run.errors is None or run.upto < inf or run.stop.reason != "until" or not run.flows:
        return
    arc, until = run.flows[-1], run.times[-1]
    place = run.at_row(arc, arc.last)
    if run.times[arc.last] == until:
        for k in range(len(place.mode.edges)):
            try:
                near = abs(place.value(k)) <= SAFE * run.shift(place, k, arc.last)
                if near and place.rate(k) > 0 and judged(run, place, k, arc.last, "ends at"):
                    yield Finding("end", "unknown", _undecided(place.name(k)))
            except DOMAIN_ERRORS:
                continue
    if run.transitions:
        made, length = run.transitions[-1], float(run.times[-1] - run.times[0])
        late = run.errors.late_by(made.time) + run.errors.tolerance * length
        if until - made.time < SAFE * late:
            yield Finding("end", "unknown", _undecided(made.edge))


def _undecided(name: str) -> str:
    return f"a transition of {name} within the error of the end is undecided: the end is too close to it"
