"""Guards that a run touches and turns back from, within its error: no derivative exists from there on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.simulate.stops import show
from hsdsl.engine.simulate.verdict.misses import rising_zero
from hsdsl.engine.simulate.verdict.run_view import Place, RunView


def touched(run: RunView) -> Iterator[tuple[Number, str]]:
    """The times and reasons, in order; nothing where the run has no estimate of its error."""
    if run.errors is None:
        return
    for arc in run.flows:
        count = len(run.problem.program.modes[run.index(arc.mode)].edges)
        try:
            rates = [_rates(run.at_row(arc, row), count) for row in range(arc.first, arc.last + 1)]
        except DOMAIN_ERRORS:
            continue
        for i, (before, after) in enumerate(pairwise(rates)):
            for k in range(count):
                if before[k] > 0 >= after[k]:
                    yield from _turning(run, run.dense_output(arc, arc.first + i), arc.first + i + 1, k)


def _rates(place: Place, count: int) -> list[Number]:
    return [place.rate(k) for k in range(count)]


def _turning(run: RunView, along: Callable[[Number], Place], row: int, k: int) -> Iterator[tuple[Number, str]]:
    """Look at a surface where it turns back on a step."""
    try:
        place = rising_zero(along, lambda place: -place.rate(k))
        shift, below = run.surface_error(place, k, row), -place.value(k)
        if place.has_condition(k) and place.conditions(
            k, run.error(place, row), run.safe_time_error(place, k, row)
        ) == {False}:
            return
    except DOMAIN_ERRORS:
        return
    if abs(below) <= shift:
        where = f"at t = {show(place.t)} the run turns back at the guard of {place.name(k)}"
        yield place.t, f"{where}, within its error: executions from nearby cross it or do not"
