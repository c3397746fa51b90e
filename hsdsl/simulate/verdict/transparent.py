"""Surfaces that a run passes while the `if` of their edge is false: does it stay false within the error?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hsdsl.arithmetic import Number
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.agreement import SAFE
from hsdsl.simulate.verdict.finding import Finding
from hsdsl.simulate.verdict.judged import closed_in
from hsdsl.simulate.verdict.place import Place
from hsdsl.simulate.verdict.run_view import RunView
from hsdsl.simulate.verdict.steps import Parts, high, low

Passed = dict[str, list[Number]]  # when the surface of an edge was passed while its `if` was false


def transparent(run: RunView, steps: Parts, passed: Passed) -> Iterator[Finding]:
    """Surfaces passed where their condition does not hold: does it all around? Notes in ``passed`` where it does."""
    edges = run.problem.program.modes[steps.mode].edges
    if not any(edge.conditional for edge in edges):
        return
    with np.errstate(all="ignore"):
        kernel, (first, last) = steps.bound(run), steps.ends()
        before, after = (kernel.surfaces(*end) for end in (first, last))
    for k, edge in enumerate(edges):
        if not edge.conditional:
            continue
        rising = (low(before[k], len(steps)) <= 0) & (high(after[k], len(steps)) > 0)
        for i in np.flatnonzero(rising).tolist():
            row = int(steps.row[i])
            arc = run.arc_of(row)
            if run.crossed.get(arc.last) == k and row + 1 == arc.last:
                continue
            place = closed_in(run.between(arc, row), lambda place: place.value(k))  # noqa: B023
            level = SAFE * run.shift(place, k, row + 1) + place.roundoff_bound(k)
            reached = place.value(k) > 0 or abs(place.value(k)) <= level
            if reached and (finding := undecided_condition(run, place, k, row + 1, passed)):
                yield finding


def undecided_condition(run: RunView, place: Place, k: int, row: int, passed: Passed) -> Finding | None:
    """Note that a surface is passed at a place where its condition does not hold, or say that it might."""
    if place.conditions(k, run.around(place, row)) == {False}:
        if not place.mode.edges[k].of_event:  # an event fires when it turns true on any of its surfaces
            passed.setdefault(place.name(k), []).append(place.t)
        return None
    where = f"{place.name(k)} at t = {show(place.t)}"
    return Finding("condition", "unknown", f"whether the condition of {where} holds is within the error")


def passed_at(name: str, at: list[Number]) -> str:
    more = f" and {len(at) - 1} more times" if len(at) > 1 else ""
    return (
        f"the surface of {name} was passed at t = {show(at[0])}{more} while its `if` was false: "
        "it fires only where it is reached again from inside"
    )
