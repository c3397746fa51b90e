"""What a run reports first, for any verdict: remarks of the loop, of the look along its steps, and of its end.

Surfaces passed while an `if` was false and walls that do not hold are remarked by the look along the steps where the
verdict takes one, else by `passings`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.engine.execution import Execution
from hsdsl.engine.simulate.stops import Diagnostics, Remark, loop_remarks, may_be_passed, wall_of, warnings_of
from hsdsl.engine.simulate.verdict.accumulation import sliding_spans
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun
from hsdsl.engine.simulate.verdict.run_view import RunView
from hsdsl.mathematics.program import Program

BEYOND = 4  # times its round-off: a wall that does not hold


# The warnings of a `Verdict.deferred` that has its remarks and its program as `_told`.
WARNINGS: dict[str, Callable[[Any], Any]] = {"warnings": lambda verdict: warnings_of(*verdict._told)}


def remarked(run: RunView, diagnostics: Diagnostics) -> list[Remark]:
    """The remarks about a run."""
    program = run.problem.program
    found = [*loop_remarks(program, diagnostics, run.stop), *_slidings(run)]
    looked, walls = run.remarks is not None, any(mode.walls for mode in program.modes)
    found += run.remarks or ()
    if (walls and (not looked or run.problem.settings.scheme == "relaxed")) or (
        not looked and any(may_be_passed(program, edge) for edge in program.edges)
    ):
        from hsdsl.engine.simulate.verdict.passings import passings  # most runs need none

        known = {remark.of for remark in found if remark.kind == "beyond"}
        found += (one for one in passings(run, walls_alone=looked) if one.kind != "beyond" or one.of not in known)
    return [*found, *at_the_end(run)] if may_end_beyond(run.execution, program) else found


def may_end_beyond(execution: Execution, program: Program) -> bool:
    """Whether a run ended in a mode whose walls nothing checks."""
    return execution.stop.reason == "final" and any(mode.final and mode.walls for mode in program.modes)


def _slidings(run: RunView) -> Iterator[Remark]:
    return (Remark("sliding", " and ".join(modes), start, end) for modes, start, end in sliding_spans(run))


def at_the_end(run: RecordedRun) -> Iterator[Remark]:
    """Walls of the final mode that a run ended in: nothing flows there, so nothing has checked them."""
    final = run.execution.final
    mode = run.problem.program.modes[run.index(final.mode)]
    if tuple(final.state) != mode.states:
        return  # it has no flow, and the states of the mode before
    place = run.place(final.mode, final.time, tuple(final.state.values()))
    for k in range(len(mode.edges), len(mode.surfaces)):
        with suppress(*DOMAIN_ERRORS):
            if place.value(k) > BEYOND * place.roundoff_bound(k):
                yield Remark("beyond", wall_of(mode, k), final.time)
