"""A run screened in C (``hsdsl/runtime/c/screen.c``): where there is surely nothing to find, nobody looks again.

The screen holds for compiled runs by `located` with a tolerance, which noted nothing, end as the finer run does, and
make the same transitions. Of others there is none, and every hypothesis is looked at here.
"""

from __future__ import annotations

import ctypes
from functools import cached_property
from typing import Any

import numpy as np

from hsdsl.execution import Array, Execution
from hsdsl.program import ModeProgram
from hsdsl.runtime import structures
from hsdsl.runtime.kernel import runtime
from hsdsl.simulate.problem import Problem
from hsdsl.simulate.stops import show
from hsdsl.simulate.verdict.companion import Companion, is_compiled, order_of
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
        plan = run.under_way.plan
        model = plan.compiled
        formulas: Compiled = model.shared("formulas", lambda: Compiled(problem.program))
        record = _record(run.columns)
        method = problem.settings.method
        assert method is not None
        self.table = table = structures.Screen(
            model=ctypes.addressof(model.table),
            timeline=plan.timeline,
            formulas=ctypes.addressof(formulas.table),
            run=record,
            until=problem.settings.until,
            relaxation=problem.settings.relaxation,
            tolerance=problem.settings.tolerance,
            taylor=method.kind == "taylor",
        )
        if finer is None:
            table.order = order_of(method)
        else:
            table.finer = _record(finer.columns)
        self._reserve(record, finer is None)
        runtime().hs_look(ctypes.addressof(table))
        self._columns = run.columns
        self._modes: tuple[ModeProgram, ...] = problem.program.modes

    def _reserve(self, record: Any, accompanied: bool) -> None:
        """Give the table memory for what it finds: columns of marks, then what a companion is apart, and scratch."""
        table, rows, arcs, made = self.table, record.rows, record.arcs, record.transitions
        self._ends = 0, made, made + arcs, made + 2 * arcs, made + 2 * arcs + rows, made + 2 * (arcs + rows)
        self._sizes = (self._ends[-1] + 1) // 2, rows * record.width, made + 1
        room = runtime().hs_screen_room(ctypes.addressof(table))
        self._memory = np.empty(sum(self._sizes if accompanied else self._sizes[:1]) + room)
        start = self._memory.ctypes.data
        table.crossing, table.landing, table.ending, table.turning, table.changing = (
            start + 4 * end for end in self._ends[:-1]
        )
        table.workspace = start + 8 * self._sizes[0]
        if accompanied:
            table.measured = table.workspace
            table.late = table.measured + 8 * self._sizes[1]
            table.workspace = table.late + 8 * self._sizes[2]

    @property
    def companion(self) -> Companion:
        """How far the run is from its companion; only of a run that is held against one."""
        first, apart, late = self._sizes
        of_rows, rest = np.split(self._memory[first : first + apart + late], [apart])
        return Companion(of_rows.reshape(self.table.run.rows, self.table.run.width), rest)

    def doubts(self, *words: str) -> bool:
        """Whether a closer look is needed at any of these; without words, at anything."""
        if not words:
            return bool(self.table.doubts or self.table.marks & ~COMMUTES)
        return any(self.table.doubts & DOUBTS[word] for word in words)

    def marked(self, name: str) -> Array:
        """The marks of a column by transition, arc or row."""
        place = ("crossing", "landing", "ending", "turning", "changing").index(name)
        marks = self._memory[: self._sizes[0]].view(np.int32)
        return marks[self._ends[place] : self._ends[place + 1]]

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


def _record(columns: Any) -> Any:
    where, made = columns.where, columns.made
    return structures.Record(
        where.rows, where.arcs, made.transitions, where.width, where.degree, where.times, where.values, where.pieces,
        where.arc, made.transition, made.before, made.after, made.alternatives,
    )  # fmt: skip
