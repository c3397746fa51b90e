"""Does the theorem hold for this run? Its hypotheses, one by one, in what a run recorded.

The convergence theorem (Burden et al. 2013, Thm 26, Cor. 28) is about executions that cross finitely many guards, each
transversally. No other surface is so near that an error could change the sequence, and simultaneous choices lead to the
same point. A run shows its own neighbourhood of the execution, so every margin is compared with the error that the run
allows itself: that of a shadow run, and where that does not show that the theorem holds, that of a finer run.

The hypotheses are checked in this order. Where the compiled `screen` leaves none undecided, that is all.

1. There are finitely many transitions, none is lost in a strip, and no arc slides: `crossings`.
2. Executions that wait go in an order that the error does not change: `commutation.waiting_orders`.
3. The errors are bounded, and a finer run makes the same transitions: `flows.reliability`.
4. Each transition is transversal, and its condition the same all around it: `crossings.crossings`.
5. Simultaneous transitions commute: `commutation.choices`.
6. Transitions that fire at once on entry do so all around it: `resets.entries`.
7. Resets are continuous, and land within the error of no surface: `resets.landings`.
8. No surface is almost reached, passed over or passed unseen, along steps or at the end: `misses`.
9. The flow is continuous with bounded slopes, and does not vary where no step saw it: `flows.flows`.

What they need: `run_view`, the run with its places; `errors` by a finer run and `shadow` by a shadow run; `steps`,
which are polynomials, and routines over intervals along them. `remarks` is what a run reports first, whatever its
verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hsdsl.engine.execution import INCOMPLETE, LEFT, Execution, Verdict
from hsdsl.engine.scheme.pace import SHORT
from hsdsl.engine.simulate.compiled import CompiledRun
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stops import Diagnostics, has_remarks_at_rows, show
from hsdsl.engine.simulate.verdict.commutation import choices, first_of_many, together, waiting_orders
from hsdsl.engine.simulate.verdict.crossings import accumulations, crossings, lost_in_strips, sliding_spans, summary
from hsdsl.engine.simulate.verdict.remarks import WARNINGS, noted, remarked, told
from hsdsl.engine.simulate.verdict.run_view import Finding, RunView
from hsdsl.engine.simulate.verdict.screen import Margins, screens_of
from hsdsl.engine.simulate.verdict.shadow import has_shadow, is_compiled
from hsdsl.mathematics.program import Program

__all__ = ["RunView", "assess", "assess_compiled", "noted"]

MANY = 10_000  # steps


def assess_compiled(run: CompiledRun, execution: Execution) -> Verdict:
    """Decide the same as `assess` of a compiled run.

    Where the screen finds it clear by its shadow run, sentences on its margins are written when they are read.
    """
    columns, problem, screens = run.columns, run.plan.problem, screens_of(run.plan, True)
    assert columns is not None
    view = partial(RunView, problem, execution)
    crowded = columns.rows > MANY and _crowded_steps(problem, execution)
    if screens is None or columns.notes or crowded or not execution.stop.complete:
        return assess(view(), run.diagnostics)
    screen = screens.take()
    if not screen.decide(columns) or (screens.keep_values and any(waiting_orders(view()))):
        return assess(view(screen_made=screen), run.diagnostics)
    shown = problem.program, run.made, screen.margins, screen.commuting
    screens.leave(screen)
    return Verdict.deferred(
        _LATER, theorem="holds", _shown=shown, _told=told(view, (), problem.program, screens.remarked)
    )


_LATER: dict[str, Callable[[Any], Any]] = {"reasons": lambda verdict: _margins_of(*verdict._shown), **WARNINGS}


@np.errstate(all="ignore")  # what overflows is no number, and decides nothing
def assess(run: RunView, diagnostics: Diagnostics) -> Verdict:
    """Decide whether the theorem's hypotheses hold for a run, are left, or are unknown.

    ``diagnostics`` are what the loop itself noted. Where a shadow run shows that they hold, there is no finer run.
    """
    verdict, judged = _judged(run, diagnostics)
    crowded = _crowded_steps(run.problem, run.execution)
    reasons = _once(verdict.reasons, crowded) if crowded else verdict.reasons
    program = run.problem.program
    remarks = told(lambda: judged, remarked(judged, diagnostics), program, has_remarks_at_rows(program))
    return Verdict.deferred(WARNINGS, theorem=verdict.theorem, reasons=reasons, _told=remarks)


def _judged(run: RunView, diagnostics: Diagnostics) -> tuple[Verdict, RunView]:
    """The verdict, and the view that it is of."""
    if run.stop.reason == "interrupted":  # nobody waits for what could not decide it
        if diagnostics.departures:
            return Verdict("left", _once(diagnostics.departures)), run
        return Verdict("unknown", _once(diagnostics.undecided, _unchecked(run))), run
    told_so = diagnostics.departures or diagnostics.undecided
    if not told_so and (matters := first_of_many(run)):
        return Verdict("left", (matters,)), run
    if not (told_so or run.against or run.followed) and has_shadow(run.problem, run.execution):
        by_shadow = replace(run, by_shadow=True)
        if by_shadow.screen is not None or not is_compiled(run.execution):
            found = _assessed(by_shadow, diagnostics)
            if found.theorem == "holds":
                return found, by_shadow
    return _assessed(run, diagnostics), run


def _assessed(run: RunView, diagnostics: Diagnostics) -> Verdict:
    """The verdict; of a shadow run it has the findings of the first hypothesis that does not hold."""
    left, unknown = list(_departures(run, diagnostics)), [*diagnostics.undecided, *waiting_orders(run)]
    if left:
        return Verdict("left", _once(left, unknown))
    screen = run.screen
    entered_inside = run.by_shadow or not run.execution.enters_beyond
    if not unknown and screen is not None and not screen.undecided() and entered_inside:
        run.remarks = []
        return Verdict("holds", _margins_of(run.problem.program, run.execution.made, screen.margins, screen.commuting))
    from hsdsl.engine.simulate.verdict.flows import flows, reliability
    from hsdsl.engine.simulate.verdict.misses import misses
    from hsdsl.engine.simulate.verdict.resets import (
        entries,  # of few runs
        landings,
    )

    found, margins = list(reliability(run)), list[str]()
    for hypothesis in (crossings, choices, entries, landings, misses, flows):
        if found and run.by_shadow:
            break
        findings, reasons = hypothesis(run)
        found += findings
        margins += reasons
    left += _named(found, "left")
    unknown += _named(found, "unknown")
    unknown += _unchecked(run)
    if left:
        return Verdict("left", _once(left, unknown))
    return Verdict("unknown", _once(unknown, margins)) if unknown else Verdict("holds", _once(margins))


def _departures(run: RunView, diagnostics: Diagnostics) -> Iterator[str]:
    """How the run left what the theorem is about, as far as the run itself shows."""
    yield from diagnostics.departures
    yield from lost_in_strips(run)
    if not diagnostics.departures and run.stop.reason not in LEFT and run.screen is not None:
        return  # it neither slid nor made crowded transitions
    if not run.followed:  # the theorem knows no motion on a surface that two modes press on
        for modes, start, end in sliding_spans(run):
            yield f"sliding between {' and '.join(modes)} from t = {show(start)} to t = {show(end)}"
    if not diagnostics.departures:
        yield from accumulations(run)
    if run.stop.reason in LEFT:
        yield run.stop.message


def _margins_of(program: Program, made: int, margins: Margins, commuting: Sequence[float]) -> tuple[str, ...]:
    """The sentences on a run that a screen leaves nothing undecided of."""
    crossed = summary(made, margins.crossed, margins.slowest, margins.least)
    return _once(crossed, together(commuting), margins.nearest_miss(program.modes))


def _once(*sentences: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(sentence for each in sentences for sentence in each))


def _named(found: Sequence[Finding], theorem: str) -> Iterator[str]:
    """The sentences of findings that make the verdict ``theorem``, by their kinds."""
    of = [f for f in found if f.theorem == theorem]
    for kind in dict.fromkeys(f.kind for f in of):
        yield from dict.fromkeys(f.sentence for f in of if f.kind == kind)


def _unchecked(run: RunView) -> list[str]:
    """Why hypotheses could not be checked for all of a run."""
    if run.stop.reason in INCOMPLETE:
        return [f"the run did not reach its end: {run.stop.message}"]
    if run.errors is not None:
        return []
    if run.problem.settings.tolerance is not None:
        return ["the finer run was interrupted, so no margin can be compared with the error"]
    return ["a fixed step gives no estimate of its error, so no margin can be compared with it (a tolerance does)"]


def _crowded_steps(problem: Problem, execution: Execution) -> list[str]:
    """The sentence on the steps that are closest to each other, where thousands are within a millionth of the run."""
    times = execution.times
    if problem.settings.tolerance is None or len(times) <= MANY:
        return []
    rows = np.flatnonzero(times[1:] > times[:-1])
    late = times[rows[MANY:] + 1] - times[rows[:-MANY]] if len(rows) > MANY else np.array([np.inf])
    first = int(np.argmin(late))
    if not late[first] < SHORT * problem.settings.until:
        return []
    start, end = int(rows[first]), int(rows[first + MANY])
    arc = execution.arcs[int(np.searchsorted(execution.arc_table.first, start, "right")) - 1]
    values = execution.values[start : min(end, arc.last) + 1, : len(arc.states)].astype(float)
    sizes = np.abs(values).max(axis=0, initial=0.0)
    moved = np.abs(np.diff(values, axis=0)).sum(axis=0) / np.where(sizes > 0, sizes, 1.0)
    most = f", where {arc.states[int(np.argmax(moved))]} of {arc.mode} moves most" if len(arc.states) else ""
    return [f"{MANY} steps from t = {show(times[start])} on are within a millionth of the run{most}"]
