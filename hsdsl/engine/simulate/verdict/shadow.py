"""Errors of a run without another run: a shadow run takes the same steps, closer to the solution.

The shadow run starts where the run does. Each of its steps begins where it is itself, and takes as long as the run's.
It makes each transition where it crosses the same surface. Its distance to the run is the sum of what the run's steps
left out, carried along by the flow and by jumps, as long as that is small.

- What the polynomial of a Taylor step leaves out follows from how badly it solves the equation at the end, as when its
  size was chosen. The first two terms that are left out are found so: an even or odd solution is no trap.
- What such a step makes of the distance before is the difference of two series. The run has recorded one of them. The
  other has fewer terms: a distance needs few digits. Where its last two terms, times the number of steps, exceed all of
  a state's terms together, more are made from there on, up to as many as the run has. So growth that the run does not
  show is seen.
- Both follow for other methods from a `correction` of the step, as long as that leaves out less than the step.
- Round-off is much the same for both, so each step moves the shadow run further away from the run by the most that it
  may do: that of the flow, and of states that move. Where an arc begins these are rounded, too. Starts, parameters and
  results of resets are moved by their own round-off, and crossings by that of their surface: see `moving`.

The shadow run crosses no other surface: enclosures wider than the errors decide along the run's own steps that none
is reached.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.base.numbers.enclosures import Array
from hsdsl.engine.execution import Execution
from hsdsl.engine.integrators import Method
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.verdict.agreement import Errors
from hsdsl.engine.simulate.verdict.shadow_run import Lost, ShadowRun

MOST_ORDER = 30  # of series in C: HS_MOST_ORDER
MOST_CORRECTED = 5  # order of methods whose steps leave out more than corrections of them


@dataclass(frozen=True)
class ShadowErrors:
    """How far a run is from its shadow run.

    Attributes
    ----------
    state_errors : array, shape (rows, states of the largest mode)
    time_errors : array, shape (transitions,)
        How far the times of transitions are apart, up to each.
    lost : float or None
        From when on it could not follow.
    """

    state_errors: Array
    time_errors: Array
    lost: float | None = None


@dataclass(frozen=True)
class ErrorsByShadow(Errors):
    """What a shadow run shows of a run."""

    shadow: ShadowErrors = field(kw_only=True)

    @cached_property
    def parted(self) -> float | None:
        """From when on the shadow run could not follow."""
        return self.shadow.lost

    @cached_property
    def time_errors(self) -> Array:
        """How far times of transitions are apart, up to each of them; shape (transitions,)."""
        return self.shadow.time_errors

    @cached_property
    def measured(self) -> Array:
        """How far the run is from its shadow run in each state; shape (rows, states), nowhere falling."""
        found = np.zeros(self._values.shape)
        for arc in self.run.arcs:
            columns = [self.columns[name] for name in arc.states]
            found[arc.first : arc.last + 1, columns] = self.shadow.state_errors[
                arc.first : arc.last + 1, : len(columns)
            ]
        return np.maximum.accumulate(np.nan_to_num(found))


def is_compiled(run: Execution) -> bool:
    """Whether a run was made in C, where it is followed as well."""
    return run.compiled is not None


def order_of(method: Method) -> int | None:
    """The most that the order of the shadow run's series may be: with one coefficient more, as many as the run's.

    None where it has no series.
    """
    return method.order - 1 if method.is_series else None


def has_shadow(problem: Problem, run: Execution) -> bool:
    """Whether a shadow run shows the errors of a run: one with a tolerance, without strips and samples of inputs.

    Strips and transitions on entry of a run made in C are found where the shadow run follows it.
    """
    return (
        may_have_shadow(problem)
        and run.stop.complete
        and (is_compiled(run) or not (run.enters_beyond or any(arc.kind != "flow" for arc in run.arcs)))
    )


def may_have_shadow(problem: Problem) -> bool:
    """Whether a shadow run may show the errors of runs of a problem."""
    settings, method = problem.settings, problem.settings.method
    return (
        settings.scheme == "located"
        and settings.tolerance is not None
        and method is not None
        and method.order <= (MOST_ORDER if method.is_series else MOST_CORRECTED)
        and problem.arithmetic.digits is None
        and len(problem.timeline.segments) == 1
    )


def shadow_errors(problem: Problem, run: Execution) -> ShadowErrors:
    """Follow a run that has a shadow run."""
    assert problem.settings.method is not None
    shadow, arcs = ShadowRun(problem, run, order_of(problem.settings.method)), run.arcs
    lost = None
    for arc, following in zip(arcs, (*arcs[1:], None), strict=True):
        if problem.program.modes[shadow.modes[arc.mode]].final:
            break
        leaves = arc.jump < len(run.transitions) and (following is None or following.jump > arc.jump)
        try:
            shadow.follow(arc, run.transitions[arc.jump] if leaves else None)
        except (Lost, *DOMAIN_ERRORS):
            lost = float(run.times[arc.first])
            break
    late = np.maximum.accumulate([float(problem.tie(run.times[-1])), *shadow.time_errors])[1:]
    missing = np.full(len(run.transitions) - len(late), np.inf)
    return ShadowErrors(shadow.state_errors, np.append(late, missing), lost)
