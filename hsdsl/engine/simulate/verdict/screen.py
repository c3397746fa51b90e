"""A run screened in C (`runtime/c/screen.c`): where there is surely nothing to find, Python takes no part.

The screen holds for compiled runs by `located` with a tolerance, which noted nothing, end as the finer run does, and
make the same transitions. Of others there is none, and Python decides every hypothesis.

It takes routines as tables of operations (`hsdsl.engine.runtime.formulas`).
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from hsdsl.engine.execution import Array, Execution
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.formulas import FormulaTables
from hsdsl.engine.runtime.kernel import runtime
from hsdsl.engine.simulate.columns import Columns
from hsdsl.engine.simulate.compiled import CompiledPlan
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.stops import has_remarks_at_rows, show, surface_of
from hsdsl.engine.simulate.verdict.errors import times
from hsdsl.engine.simulate.verdict.shadow import INSIDE, POLE, ShadowErrors, correction, may_have_shadow, order_of
from hsdsl.mathematics.program import ModeProgram

MOST_LEFT, MOST_ROOM = 4, 1 << 17  # screens that are kept, and numbers in the memory of one
CROSSING_UNDECIDED, RESET_UNDECIDED = 1, 2
HYPOTHESIS_BITS = {word: 1 << bit for bit, word in enumerate(structures.HYPOTHESES)}


class Margins(NamedTuple):
    """What a screen shows of a run that surely has no finding.

    How many transitions the flow made, the least rate and the least margin; of the turning point that comes closest to
    its surface the margin and the time, its mode (negative for none) and surface.
    """

    crossed: int
    slowest: float
    least: float
    margin: float
    missed: float
    mode: int
    surface: int

    def nearest_miss(self, modes: Sequence[ModeProgram]) -> list[str]:
        """The sentence on that turning point."""
        if self.mode < 0:
            return []
        name = surface_of(modes[self.mode], self.surface)
        return [f"the nearest miss is that of {name} at t = {show(self.missed)}, at {times(self.margin)} the error"]


class Screen:
    """What the screen found of one run; ``table`` is its ``hs_screen``, which begins as a copy of ``common``."""

    def __init__(self, common: Any) -> None:
        self.table: Any = structures.Screen.from_buffer_copy(common)
        self._where, self._decide, self._memory = ctypes.addressof(self.table), runtime().hs_screen_run, np.empty(0)
        self.columns: Columns | None = None

    def decide(self, columns: Columns, finer: int | None = None) -> bool:
        """Screen a run, and say whether there is surely nothing to find; ``finer`` is the record of a finer one.

        Without that, the run is compared with its shadow run.
        """
        self.columns = columns
        while (left := self._decide(self._where, columns.record, finer)) > 0:
            self._memory = np.empty(left)
            self.table.workspace, self.table.room = structures.start_of(self._memory), left
        return not left

    @property
    def shadow_errors(self) -> ShadowErrors:
        """How far the run is from its shadow run; only of a run that is compared with one."""
        run = self.table.run
        apart = self._found("shadow_errors", run.rows * run.width, np.float64)
        return ShadowErrors(apart.reshape(run.rows, run.width), self._found("time_errors", run.transitions, np.float64))

    def _found(self, name: str, count: int, kind: Any) -> Array:
        """Numbers of a column that was found."""
        start = getattr(self.table, name) - self.table.workspace
        return self._memory.view(np.uint8)[start : start + count * np.dtype(kind).itemsize].view(kind)

    def undecided(self, *words: str) -> bool:
        """Whether any of these hypotheses is undecided; without words, any at all."""
        if not words:
            return bool(self.table.undecided or self.table.marks)
        return any(self.table.undecided & HYPOTHESIS_BITS[word] for word in words)

    def marked(self, name: str) -> Array:
        """The marks of a column by transition, arc or row."""
        run = self.table.run
        counts = {"crossing": run.transitions, "landing": run.arcs, "ending": run.arcs}
        return self._found(name, counts.get(name, run.rows), np.int32)

    def arcs(self, name: str) -> set[int]:
        """The first rows of the arcs that are marked."""
        assert self.columns is not None
        return set(self.columns["arc"]["first"][self.marked(name) != 0].tolist())

    @property
    def margins(self) -> Margins:
        """What it shows of what holds."""
        of = self.table
        return Margins(of.crossed, of.slowest, of.least, of.margin, of.missed, of.missed_mode, of.missed_surface)

    @property
    def commuting(self) -> list[float]:
        """When transitions were reached together of which every order leads to the same point."""
        return [*structures.array_at(ctypes.c_double, self.table.tied_times, self.table.commuting)]


class Screens:
    """Screens of the runs by a plan, compared with shadow runs or finer runs.

    What one leaves can be used by the next.
    """

    def __init__(self, problem: Problem, plan: CompiledPlan, by_shadow: bool) -> None:
        model, settings, method = plan.compiled, problem.settings, problem.settings.method
        formulas: FormulaTables = model.shared("formulas", lambda: FormulaTables(problem.program))
        assert method is not None
        order, start = order_of(method) if by_shadow else None, problem.start if by_shadow else None
        self._start = [np.array(numbers, np.float64) for numbers in ((start.x, start.data) if start else ())]
        self._common = structures.Screen(
            model=ctypes.addressof(model.table),
            timeline=plan.timeline,
            formulas=ctypes.addressof(formulas.table),
            order=order or 0,
            correction=ctypes.addressof(_correction()) if by_shadow and order is None else 0,
            **dict(zip(("start", "data"), (array.ctypes.data for array in self._start), strict=False)),
            until=settings.until,
            relaxation=settings.relaxation,
            tolerance=settings.tolerance,
        )
        modes = problem.program.modes
        self.keep_values = any(len(queue.values) > 1 for mode in modes for queue in mode.queues)  # that wait
        self.remarked = has_remarks_at_rows(problem.program)
        self._left: list[Screen] = []

    def take(self) -> Screen:
        """Return a screen that nobody reads."""
        try:
            return self._left.pop()
        except IndexError:
            return Screen(self._common)

    def leave(self, screen: Screen) -> None:
        """Let the next run use a screen that nobody reads any more."""
        if len(self._left) < MOST_LEFT and screen.table.room <= MOST_ROOM:
            screen.columns = None
            self._left.append(screen)


def screens_of(plan: CompiledPlan, by_shadow: bool) -> Screens | None:
    """Screens of the runs by a plan, where there are any; see `has_shadow` for those with shadow runs."""
    if by_shadow not in plan.of_screens:
        problem = plan.problem
        located = problem.settings.scheme == "located" and problem.settings.tolerance is not None
        can = located and not any(mode.slides for mode in problem.program.modes)
        can = can and (may_have_shadow(problem) or not by_shadow) and not problem.waits
        plan.of_screens[by_shadow] = Screens(problem, plan, by_shadow) if can else None
    return plan.of_screens[by_shadow]


def screened(run: Execution, finer: Execution | None) -> Screen | None:
    """Screen a run, where that can be done; without a finer run by its shadow run."""
    one: Any = run.compiled
    other: Any = finer and finer.compiled
    if one is None or (finer and other is None):
        return None
    if not run.stop.complete or (finer and finer.stop.reason != run.stop.reason):
        return None
    if one.columns.notes or (other and other.columns.notes):
        return None
    screens = screens_of(one.plan, finer is None)
    if screens is None:
        return None
    screen = screens.take()
    screen.decide(one.columns, other and other.columns.record)
    return screen


@cache
def _correction() -> Any:
    """The coefficients of corrections."""
    numbers = (*(number for each in correction() for number in each.ravel()), INSIDE, POLE)
    return structures.Correction.from_buffer((ctypes.c_double * len(numbers))(*numbers))
