"""A recorded run with its errors: how wrong its states, times and surfaces are, and what a screen leaves undecided."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from math import inf

import numpy as np

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Arc, Execution, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.remarks import Remark
from hsdsl.engine.simulate.surfaces import Surfaces
from hsdsl.engine.simulate.verdict.agreement import SAFE, Errors
from hsdsl.engine.simulate.verdict.exact_states import errors_by_resets
from hsdsl.engine.simulate.verdict.place import Place
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun
from hsdsl.engine.simulate.verdict.screen import Screen, screened
from hsdsl.engine.simulate.verdict.shadow import ErrorsByShadow, shadow_errors
from hsdsl.mathematics.program import ModeProgram


@dataclass(eq=False)
class RunView(RecordedRun):
    """A recorded run, as its verdict sees it.

    Attributes
    ----------
    against : Execution or None
        A finer run that shows the errors of this one. Where it is None and steps are chosen by a tolerance, the same
        run is repeated, finer.
    reliable_until : float
        Until when the run can be relied on.
    followed : bool
        Whether motion along surfaces counts as the flow of a mode of the system, as for derivatives.
    by_shadow : bool
        Whether errors are those that a shadow run shows, not a finer run.
    screen_made : Screen or None
        The screen of a run with a shadow run, where it was made already.
    remarks : list of Remark or None
        What the look along its steps remarks of surfaces that were passed; None where nothing has looked along them.
    """

    against: Execution | None = None
    reliable_until: float = inf
    followed: bool = False
    by_shadow: bool = False
    screen_made: Screen | None = None
    remarks: list[Remark] | None = None

    @cached_property
    def errors(self) -> Errors | None:
        """How wrong the run is, by a shadow or a finer run; None where steps are fixed and no finer one is given."""
        tolerance, finer = self.problem.settings.tolerance, self.against
        tie = float(self.tie(self.execution.times[-1]))
        known = float(tolerance or 0), float(self.arithmetic.unit), tie, partial(errors_by_resets, self)
        if self.by_shadow:
            shadow = self.screen.shadow_errors if self.screen else shadow_errors(self.problem, self.execution)
            return ErrorsByShadow(self.execution, self.execution, *known, shadow=shadow)
        if finer is None and tolerance is not None:
            finer = self.execution.finer
        if finer is None or finer.stop.reason == "interrupted":
            return None
        return Errors(self.execution, finer, *known)

    @cached_property
    def screen(self) -> Screen | None:
        """What a compiled screen leaves undecided; None where there is none."""
        if self.by_shadow:
            screen = self.screen_made or screened(self.execution, None)
        else:
            screen = self.errors and screened(self.execution, self.errors.finer)
        return None if screen is None or screen.undecided("parted", "accumulation") else screen

    def undecided(self, *words: str) -> bool:
        """Whether the screen leaves any of the hypotheses that are named undecided."""
        return self.screen is None or self.screen.undecided(*words)

    def undecided_flows(self, name: str) -> list[Arc]:
        """Those of them that the screen leaves undecided."""
        if self.screen is None:
            return self.reliable_flows
        marked = self.screen.arcs(name)
        return [arc for arc in self.reliable_flows if arc.first in marked] if marked else []

    def undecided_transitions(self, mark: int) -> list[Transition]:
        """The transitions that the screen leaves undecided."""
        if self.screen is None:
            return self.reliable_transitions
        marked = np.flatnonzero(self.screen.marked("crossing") & mark).tolist()
        return [self.transitions[index] for index in marked]

    @property
    def reliable_flows(self) -> list[Arc]:
        """The arcs that begin before the run becomes unreliable."""
        return [arc for arc in self.flows if self.times[arc.first] < self.reliable_until]

    @property
    def reliable_transitions(self) -> list[Transition]:
        """The transitions made until the run becomes unreliable: the last one may be why."""
        return [made for made in self.transitions if made.time <= self.reliable_until]

    def error(self, place: Place, row: int) -> State:
        """How wrong each state of a place may be that is reached at a row."""
        assert self.errors is not None
        columns = self.errors.columns
        return tuple(float(self.errors.by_row[row, columns[name]]) for name in place.mode.states)

    def safe_error(self, place: Place, row: int) -> State:
        """The same, as many times over as a margin must be."""
        return tuple(SAFE * e for e in self.error(place, row))

    def surface_error(self, place: Place, k: int, row: int) -> Number:
        """How much the error may move surface k."""
        assert self.errors is not None
        gradient = place.kernel.gradients[k](place.t, *place.x)
        errors = (self.errors.time_error_at(place.t), *self.error(place, row))
        return sum((abs(g) * e for g, e in zip(gradient, errors, strict=True) if e), self.arithmetic.zero)

    def safe_time_error(self, place: Place, k: int, row: int) -> float:
        """How wrong the time may be at which the step to a row reaches surface k, as often as a margin must be."""
        assert self.errors is not None
        rate, shift = abs(float(place.rate(k))), SAFE * float(self.surface_error(place, k, row))
        step = float(self.times[row] - self.times[row - 1]) if row else 0.0
        moved = shift / rate if rate * step > shift else step
        return max(SAFE * self.errors.time_error_at(place.t), moved)

    def roundoff(self, place: Place, k: int, row: int) -> Number:
        """Round-off of surface k at a place, by the largest sizes that the states have had."""
        assert self.errors is not None
        columns = self.errors.columns
        sizes = tuple(float(self.errors.sizes[row, columns[name]]) for name in place.mode.states)
        surfaces = Surfaces(place.kernel, place.mode.edges, sizes, self.arithmetic)
        return surfaces.roundoff_bound(k, place.t, place.x, entry=True)


def visited(run: RunView) -> list[ModeProgram]:
    """The modes that a run flowed in."""
    names = {arc.mode for arc in run.flows}
    return [mode for mode in run.problem.program.modes if mode.name in names]
