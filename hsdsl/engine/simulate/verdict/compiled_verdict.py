"""Compiled runs that the screen finds clear by their shadow runs: sentences on their margins are written when read."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from hsdsl.engine.execution import Execution, Verdict
from hsdsl.engine.simulate.verdict import RunView, assess, margins_of
from hsdsl.engine.simulate.verdict.effort import crowded_steps
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun
from hsdsl.engine.simulate.verdict.remarked import ends_beyond, may_end_beyond
from hsdsl.engine.simulate.verdict.screen import screens_of
from hsdsl.engine.simulate.verdict.waiting_orders import keep_values, waiting_orders
from hsdsl.mathematics.program import Program

if TYPE_CHECKING:
    from hsdsl.engine.simulate.compiled import CompiledRun


def assess_compiled(under_way: CompiledRun, execution: Execution) -> Verdict:
    """Decide whether the theorem's hypotheses hold for a compiled run, are left, or are unknown."""
    compiled: Any = execution.compiled
    columns, problem, screens = compiled.columns, under_way.plan.problem, screens_of(under_way.plan, True)
    if screens is None or columns.notes or crowded_steps(problem, execution) or not execution.stop.complete:
        return assess(RunView(problem, execution), under_way.diagnostics)
    screen = screens.take()
    if not screen.decide(columns) or (
        keep_values(problem.program) and any(waiting_orders(RunView(problem, execution, screen_made=screen)))
    ):
        return assess(RunView(problem, execution, screen_made=screen), under_way.diagnostics)
    shown = problem.program, compiled.made, screen.margins, screen.commuting
    screens.leave(screen)
    warnings = ends_beyond(RecordedRun(problem, execution)) if _has_more(problem.program, execution) else ()
    return Verdict.deferred(_LATER, theorem="holds", warnings=warnings, _shown=shown)


def _has_more(program: Program, execution: Execution) -> bool:
    """Whether a run may have warnings though nothing is undecided."""
    return bool(program.assumptions) or may_end_beyond(execution, program)


_LATER: dict[str, Callable[[Any], Any]] = {"reasons": lambda verdict: margins_of(*verdict._shown)}
