"""Surfaces passed while an `if` was false, and walls that do not hold, at the rows of a run, and where steps turn back.

This is for runs whose verdict needs no closer look along the steps, as of those that are outside the theorem. A surface
that rises where a step begins and falls where it ends is looked at on the way, at eighths.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Number
from hsdsl.base.numbers.enclosures import Array, Range, as_range
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.remarks import Remark, may_be_passed, of_edge, wall_of
from hsdsl.engine.simulate.surfaces import ROUNDOFF_UNITS
from hsdsl.engine.simulate.verdict.near_surface import ROUNDS
from hsdsl.engine.simulate.verdict.recorded_run import RecordedRun
from hsdsl.engine.simulate.verdict.remarked import BEYOND
from hsdsl.engine.simulate.verdict.steps import MOST_PARTS, data_at, pieces_at, rows_by_mode
from hsdsl.mathematics.program import ModeProgram

END = 1.0
POINTS = (*(i / 8 for i in range(8)), END)  # of a step that turns back
Spans = Iterator[tuple["Looked", float, float]]


def passings(run: RecordedRun, *, walls_alone: bool = False) -> Iterator[Remark]:
    """Remarks about both, or about walls alone."""
    broken: dict[str, Number] = {}
    for steps in _looked(run):
        for k in steps.watched:
            if k < len(steps.mode.edges) and walls_alone:
                continue
            if k < len(steps.mode.edges):
                name = steps.mode.edges[k].name
                yield from (of_edge("passed", name, time) for each in _spans(steps, k) for time in _passed(*each, k))
            else:
                wall = wall_of(steps.mode, k)
                for time in (time for each in _spans(steps, k) for time in _beyond(*each, k)):
                    broken[wall] = min(time, broken.get(wall, time))
    yield from (Remark("beyond", wall, time) for wall, time in broken.items())


@dataclass(frozen=True)
class Looked:
    """Steps of a run in one mode, that begin at ``rows``."""

    run: RecordedRun
    index: int
    rows: NDArray[np.int64]

    @property
    def mode(self) -> ModeProgram:
        """The mode."""
        return self.run.problem.program.modes[self.index]

    @property
    def watched(self) -> list[int]:
        """The surfaces that are looked at: walls, and those that may be passed while an `if` is false."""
        edges, program = self.mode.edges, self.run.problem.program
        return [k for k in self.mode.surfaces if k >= len(edges) or may_be_passed(program, edges[k])]

    def at(self, share: Array | float) -> tuple[ModeKernel, list[Range]]:
        """The mode's routines over ranges, and time and states at a share of each step; its end is the row there."""
        execution, rows, n = self.run.execution, self.rows, len(self.mode.states)
        times = np.asarray(execution.times, dtype=float)
        data = [Range(column, column) for column in data_at(self.run, times[rows]).T]
        if np.ndim(share) == 0 and share in (0.0, END):
            states = np.asarray(execution.values[rows + int(share), :n], dtype=float)
        else:
            states, powers = pieces_at(execution, rows, n)
            moved = np.zeros_like(states)
            for m in reversed(range(powers.shape[1])):
                moved = (moved + powers[:, m]) * np.reshape(share, (-1, 1))
            states = states + moved
        columns = [times[rows] + share * (times[rows + 1] - times[rows]), *states.T]
        return self.run.problem.kernel.enclosing.bind(self.index, data), [Range(column, column) for column in columns]

    def values(self, share: Array | float, k: int) -> Array:
        """Surface k there, between the ends of what round-off makes of it."""
        kernel, point = self.at(share)
        return self._middle(kernel.surfaces(*point)[k])

    def rates(self, share: float, k: int) -> Array:
        """How fast surface k rises there."""
        kernel, point = self.at(share)
        return self._middle(kernel.rates[k](*point)[0])

    def _middle(self, value: Any) -> Array:
        found = as_range(value)
        return np.broadcast_to((found.low + found.high) / 2, len(self.rows))

    def noise(self, share: Array | float, k: int) -> Array:
        """Below this surface k is no more than round-off makes it there, by the largest sizes that states have had."""
        kernel, point = self.at(share)
        sizes = [np.abs(point[0].high), *(self.run.sizes[name] for name in self.mode.states)]
        total = as_range(kernel.magnitudes(*point)[k]).high
        for slope, size in zip(map(as_range, kernel.gradients[k](*point)), sizes, strict=True):
            total = total + np.maximum(np.abs(slope.low), np.abs(slope.high)) * size
        return BEYOND * ROUNDOFF_UNITS * max(float(self.run.arithmetic.unit), FLOAT64.unit) * total

    def take(self, which: NDArray[np.bool_]) -> Looked:
        """Some of the steps."""
        return replace(self, rows=self.rows[which])


def _looked(run: RecordedRun) -> Iterator[Looked]:
    for index, _, rows in rows_by_mode(run):
        for first in range(0, len(rows), MOST_PARTS):
            yield Looked(run, index, rows[first : first + MOST_PARTS])


def _spans(steps: Looked, k: int) -> Spans:
    """Steps with the shares between which they are looked at: whole, or by eighths where surface k turns back."""
    turns = (steps.rates(0.0, k) > 0) & (steps.rates(END, k) < 0)
    yield steps.take(~turns), 0.0, END
    if turns.any():
        turning = steps.take(turns)
        yield from ((turning, a, b) for a, b in pairwise(POINTS))


def _passed(steps: Looked, start: float, end: float, k: int) -> Iterator[Number]:
    """When surface k is passed while its `if` is false; not where a step ends by its own transition."""
    run = steps.run
    steps = steps.take(steps.values(end, k) > 0)
    if not len(steps.rows):
        return
    noise = steps.noise(start, k)
    rising = (steps.values(start, k) <= noise) & (steps.values(end, k) > steps.noise(end, k))
    if end == END:
        rising &= np.array([run.crossed.get(row + 1) != k for row in steps.rows.tolist()])
    steps, noise = steps.take(rising), noise[rising]
    if not len(steps.rows):
        return
    on = steps.values(start, k) >= -noise  # as where the mode was entered
    low, high = np.full(len(steps.rows), start), np.where(on, start, end)
    for _ in range(ROUNDS):
        middle = (low + high) / 2
        below = steps.values(middle, k) <= 0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    _, point = steps.at(high)
    bound: dict[Number, ModeKernel] = {}
    for t, *x in zip(*(column.low.tolist() for column in point), strict=True):
        segment = run.problem.timeline.at(t)
        if segment.start not in bound:
            bound[segment.start] = run.problem.kernel.bind(steps.index, segment.data)
        with suppress(*DOMAIN_ERRORS):
            if not bound[segment.start].conditions[k](t, *x)[0]:
                yield t


def _beyond(steps: Looked, start: float, end: float, k: int) -> Iterator[Number]:
    """The first time at which wall k does not hold at the beginning or the end of a span."""
    for share in (start, end):
        beyond = steps.take(steps.values(share, k) > 0)
        if len(beyond.rows):
            beyond = beyond.take(beyond.values(share, k) > beyond.noise(share, k))
            yield from beyond.at(share)[1][0].low.tolist()[:1]
