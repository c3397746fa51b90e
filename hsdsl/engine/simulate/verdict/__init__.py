"""Does the theorem hold for this run? Its hypotheses, one by one, in what a run recorded.

The convergence theorem (Burden et al. 2013, Thm 26, Cor. 28) is about executions that cross finitely many guards, each
transversally. No other surface is so near that an error could change the sequence, and simultaneous choices lead to the
same point. A run shows its own neighbourhood of the execution, so every margin is held against the error that the run
allows itself.

==================  =================================================================================================
`screen`            what compiled enclosures leave undecided
`formulas`          routines as operations, as it takes them; `formula_tables`: those of a program in C
`shadow`            the errors of a run, by a `shadow_run` that takes the same steps, closer to the solution
`correction`        steps that no series repeats, corrected
`agreement`         the errors of a run, by the same run made finer
`recorded_run`      an execution with its modes' routines; `place` is one state of it
`run_view`          the same with its errors
`steps`             its steps as polynomials, many at once, with routines over intervals
`compiled_verdict`  compiled runs of which it leaves nothing undecided
`findings`          all of the following, of a run that the screen leaves undecided
`finding`           one reason; `near_surface` holds margins against errors
`reliability`       from when on a run cannot be relied on
`crossings`         is each transition transversal, and its condition the same all around it?
`entries`           do transitions that fire at once on entry do so all around it?
`input_jumps`       jumps of inputs that transitions near them do not notice
`exact_states`      states without an error, and errors by kinks of resets
`nearby`            where transitions take states that are moved along the guard
`landings`          does a reset land within the error of a surface, or jump?
`misses`            surfaces that are almost reached or passed over; `endings`: what happens at the end
`tangent`           arcs that leave a surface tangentially, as where sliding ends
`remarked`          what a run reports first, whatever its verdict; `passings`: by its rows
`transparent`       surfaces that are passed where their condition is false
`flows`             does the flow vary unseen, jump, or have a slope without bound?
`expansions`        operations along parts of steps, and what they leave unresolved; `expanded`: functions of these
`commutation`       do transitions that are reached together commute?
`accumulation`      Zeno points and rest, which the relaxed scheme goes through without a word
`effort`            steps that crowd: no hypothesis, but reported
`strips`            transitions that are lost while another one waits in a strip
==================  =================================================================================================
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from hsdsl.engine.execution import INCOMPLETE, LEFT, Stop, Verdict
from hsdsl.engine.simulate.diagnostics import Diagnostics
from hsdsl.engine.simulate.verdict.accumulation import accumulations, slidings
from hsdsl.engine.simulate.verdict.commutation import together
from hsdsl.engine.simulate.verdict.crossings import summary
from hsdsl.engine.simulate.verdict.effort import crowded_steps
from hsdsl.engine.simulate.verdict.finding import Finding
from hsdsl.engine.simulate.verdict.remarked import WARNINGS, remarked
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.engine.simulate.verdict.screen import Margins
from hsdsl.engine.simulate.verdict.shadow import has_shadow, is_compiled
from hsdsl.engine.simulate.verdict.strips import lost_in_strips
from hsdsl.engine.simulate.verdict.waiting_orders import waiting_orders
from hsdsl.mathematics.program import Program

__all__ = ["RunView", "assess", "margins_of"]


@np.errstate(all="ignore")  # what overflows is no number, and decides nothing
def assess(run: RunView, diagnostics: Diagnostics) -> Verdict:
    """Decide whether the theorem's hypotheses hold for a run, are left, or are unknown.

    Where a shadow run shows that they hold, there is no finer run.

    Parameters
    ----------
    run : RunView
        What was recorded.
    diagnostics : Diagnostics
        What the loop itself noted.
    """
    verdict, looked_at = _judged(run, diagnostics)
    crowded = crowded_steps(run.problem, run.execution)
    reasons = _once(verdict.reasons, crowded) if crowded else verdict.reasons
    told = remarked(looked_at, diagnostics), run.problem.program
    return Verdict.deferred(WARNINGS, theorem=verdict.theorem, reasons=reasons, _told=told)


def _judged(run: RunView, diagnostics: Diagnostics) -> tuple[Verdict, RunView]:
    """The verdict, and the view that it is of."""
    if run.stop.reason == "interrupted":  # nobody waits for what could not decide it
        if diagnostics.departures:
            return Verdict("left", _once(diagnostics.departures)), run
        return Verdict("unknown", _once(diagnostics.undecided, [_incomplete(run.stop)])), run
    noted = diagnostics.departures or diagnostics.undecided
    if not (noted or run.against or run.followed) and has_shadow(run.problem, run.execution):
        by_shadow = replace(run, by_shadow=True)
        if by_shadow.screen is not None or not is_compiled(run.execution):
            found = _assessed(by_shadow, diagnostics)
            if found.theorem == "holds":
                return found, by_shadow
    return _assessed(run, diagnostics), run


def _assessed(run: RunView, diagnostics: Diagnostics) -> Verdict:
    left, unknown = list(departures(run, diagnostics)), [*diagnostics.undecided, *waiting_orders(run)]
    if left:
        return Verdict("left", _once(left, unknown))
    screen = run.screen
    entered_inside = run.by_shadow or not run.execution.enters_beyond
    if not unknown and screen is not None and not screen.undecided() and entered_inside:
        run.remarks = []
        return Verdict("holds", margins_of(run.problem.program, run.execution.made, screen.margins, screen.commuting))
    from hsdsl.engine.simulate.verdict.findings import findings_of  # of a run that the screen leaves undecided

    found, margins = findings_of(run)
    left += _named(found, "left")
    unknown += _named(found, "unknown")
    unknown += _unchecked(run, run.stop)
    if left:
        return Verdict("left", _once(left, unknown))
    return Verdict("unknown", _once(unknown, margins)) if unknown else Verdict("holds", _once(margins))


def margins_of(program: Program, made: int, margins: Margins, commuting: Sequence[float]) -> tuple[str, ...]:
    """The sentences on a run that a screen leaves nothing undecided of."""
    crossed = summary(made, margins.crossed, margins.slowest, margins.least)
    return _once(crossed, together(commuting), margins.nearest_miss(program.modes))


def departures(run: RunView, diagnostics: Diagnostics) -> Iterator[str]:
    """How the run left what the theorem is about, as far as the run itself shows."""
    yield from diagnostics.departures
    yield from lost_in_strips(run)
    if not diagnostics.departures and run.stop.reason not in LEFT and run.screen is not None:
        return  # it neither slid nor made crowded transitions
    if not run.followed:
        yield from slidings(run)
    if not diagnostics.departures:
        yield from accumulations(run)
    if run.stop.reason in LEFT:
        yield run.stop.message


def _once(*sentences: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(sentence for each in sentences for sentence in each))


def _named(found: Sequence[Finding], theorem: str) -> Iterator[str]:
    """The sentences of findings that make the verdict ``theorem``, by their kinds."""
    of = [f for f in found if f.theorem == theorem]
    for kind in dict.fromkeys(f.kind for f in of):
        yield from dict.fromkeys(f.sentence for f in of if f.kind == kind)


def _incomplete(stop: Stop) -> str:
    return f"the run did not get to its end: {stop.message}"


def _unchecked(run: RunView, stop: Stop) -> Iterator[str]:
    if stop.reason in INCOMPLETE:
        yield _incomplete(stop)
    elif run.errors is None and run.problem.settings.tolerance is not None:
        yield "the finer run was interrupted, so no margin can be held against the error"
    elif run.errors is None:
        yield "a fixed step does not say how wrong it is, so no margin can be held against the error (a tolerance does)"
