"""A run screened in C (``hsdsl/runtime/c/screen.c``): where there is surely nothing to find, nobody looks again.

The screen holds for compiled runs by `located` with a tolerance, which noted nothing, end as the finer run does, and
make the same transitions. Of others there is none, and every hypothesis is looked at here.
"""

from __future__ import annotations

import ctypes
from functools import cache, cached_property
from typing import Any

import numpy as np

from hsdsl.execution import Array, Execution
from hsdsl.program import ModeProgram
from hsdsl.runtime import structures
from hsdsl.runtime.kernel import runtime
from hsdsl.simulate.problem import Problem
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.companion import Companion, is_compiled, order_of
from hsdsl.simulate.verdict.correction import INSIDE, POLE, correction
from hsdsl.simulate.verdict.finding import times
from hsdsl.simulate.verdict.formulas import Compiled

LOOK_AT_CROSSING, LOOK_AT_RESET, COMMUTES = 1, 2, 4
DOUBTS = {word: 1 << bit for bit, word in enumerate(structures.DOUBTS)}


class Screen:
    """What the screen found of one run; ``table`` is its ``hs_screen``.

    Parameters
    ----------
    problem : Problem
    run, finer : compiled runs
        Without a finer one, the run is held against its companion.
    """

    def __init__(self, problem: Problem, run: Any, finer: Any) -> None:
        common: dict[bool, Any] = run.under_way.plan.of_screens
        if (finer is None) not in common:
            common[finer is None] = _common(problem, run.under_way.plan, finer is None)
        self.table = table = structures.Screen.from_buffer_copy(common[finer is None])
        table.run = _record(run.columns)
        if finer is not None:
            table.finer = _record(finer.columns)
        where, library = ctypes.addressof(table), runtime()
        self._memory = np.empty(library.hs_screen_room(where))
        table.workspace = structures.start_of(self._memory)
        library.hs_look(where)
        self._columns = run.columns
        self._modes: tuple[ModeProgram, ...] = problem.program.modes

    @property
    def companion(self) -> Companion:
        """How far the run is from its companion; only of a run that is held against one."""
        run = self.table.run
        measured = self._found("measured", run.rows * run.width, np.float64)
        return Companion(measured.reshape(run.rows, run.width), self._found("late", run.transitions, np.float64))

    def _found(self, name: str, count: int, kind: Any) -> Array:
        """Numbers of a column that was found."""
        start = getattr(self.table, name) - self.table.workspace
        return self._memory.view(np.uint8)[start : start + count * np.dtype(kind).itemsize].view(kind)

    def doubts(self, *words: str) -> bool:
        """Whether a closer look is needed at any of these; without words, at anything."""
        if not words:
            return bool(self.table.doubts or self.table.marks & ~COMMUTES)
        return any(self.table.doubts & DOUBTS[word] for word in words)

    def marked(self, name: str) -> Array:
        """The marks of a column by transition, arc or row."""
        run = self.table.run
        counts = {"crossing": run.transitions, "landing": run.arcs, "ending": run.arcs}
        return self._found(name, counts.get(name, run.rows), np.int32)

    @cached_property
    def first_rows(self) -> Array:
        """The first row of each arc."""
        return self._columns["arc"]["first"]

    def arcs(self, name: str) -> set[int]:
        """The first rows of the arcs that are marked."""
        return set(self.first_rows[self.marked(name) != 0].tolist())

    @property
    def crossings(self) -> tuple[int, float, float]:
        """How many transitions the flow made, the least rate and the least margin."""
        return self.table.crossed, self.table.slowest, self.table.least

    @property
    def commuting(self) -> list[float]:
        """When transitions were reached together of which every order leads to the same point."""
        if not self.table.marks & COMMUTES:
            return []
        return self._columns["transition"]["time"][self.marked("crossing") & COMMUTES != 0].tolist()

    @property
    def nearest_miss(self) -> list[str]:
        """The sentence on the turning point that comes closest to its surface."""
        table = self.table
        number: int = table.missed_mode
        k: int = table.missed_surface
        if number < 0:
            return []
        mode = self._modes[number]
        edges = mode.edges
        name = edges[k].name if k < len(edges) else f"the wall {mode.walls[k - len(edges)]} of {mode.name}"
        return [f"the nearest miss is of {name} at t = {show(table.missed)}, by {times(table.margin)} the error"]


def screened(problem: Problem, run: Execution, finer: Execution | None) -> Screen | None:
    """Screen a run, where that can be done; without a finer run by its companion."""
    if problem.settings.scheme != "located" or problem.settings.tolerance is None:
        return None
    if not all(map(is_compiled, (run, finer or run))) or any(mode.slides for mode in problem.program.modes):
        return None
    one: Any = run.compiled
    other: Any = finer and finer.compiled
    if not run.stop.complete or (finer and finer.stop.reason != run.stop.reason):
        return None
    if one.columns.notes or (other and other.columns.notes):
        return None
    screen = Screen(problem, one, other)
    return None if screen.doubts("parted", "accumulation") else screen


def _common(problem: Problem, plan: Any, accompanied: bool) -> Any:
    """The table that screens of all runs by a plan begin with."""
    model, settings, method = plan.compiled, problem.settings, problem.settings.method
    formulas: Compiled = model.shared("formulas", lambda: Compiled(problem.program))
    assert method is not None
    order = order_of(method) if accompanied else None
    return structures.Screen(
        model=ctypes.addressof(model.table),
        timeline=plan.timeline,
        formulas=ctypes.addressof(formulas.table),
        order=order or 0,
        correction=ctypes.addressof(_correction()) if accompanied and order is None else 0,
        until=settings.until,
        relaxation=settings.relaxation,
        tolerance=settings.tolerance,
    )


@cache
def _correction() -> Any:
    """The coefficients of corrections."""
    known = correction()
    numbers = (*known.nodes, *known.weights.ravel(), *known.bulge, *known.slope, INSIDE, POLE)
    return structures.Correction.from_buffer((ctypes.c_double * len(numbers))(*numbers))


def _record(columns: Any) -> Any:
    where, made = columns.where, columns.made
    return structures.Record(
        where.rows, where.arcs, made.transitions, where.width, where.degree, where.times, where.values, where.pieces,
        where.arc, made.transition, made.before, made.after, made.alternatives,
    )  # fmt: skip
