"""Surfaces passed while an `if` was false, and walls that do not hold, at the rows of a run and a few points between.

This is for runs whose verdict needs no closer look along the steps, as of those that are outside the theorem.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hsdsl.arithmetic import DOMAIN_ERRORS, FLOAT64, Number
from hsdsl.bernstein import Array
from hsdsl.enclosures import Range, as_range
from hsdsl.kernel import ModeKernel
from hsdsl.program import ModeProgram
from hsdsl.simulate.remarks import Remark, of_edge, wall_of
from hsdsl.simulate.surfaces import ROUNDOFF_UNITS
from hsdsl.simulate.verdict.near_surface import ROUNDS
from hsdsl.simulate.verdict.recorded_run import RecordedRun
from hsdsl.simulate.verdict.remarked import BEYOND
from hsdsl.simulate.verdict.steps import MOST_PARTS, data_at, pieces_at, rows_by_mode

END = 1.0
POINTS = (*(i / 8 for i in range(8)), END)  # of a step, that are looked at


def passings(run: RecordedRun) -> Iterator[Remark]:
    """Remarks about both."""
    yield from _passed(run)
    yield from _walls(run)


@dataclass(frozen=True)
class Looked:
    """Steps of a run in one mode, that begin at ``rows``, and the mode's routines over ranges for them."""

    run: RecordedRun
    index: int
    rows: NDArray[np.int64]

    @property
    def mode(self) -> ModeProgram:
        """The mode."""
        return self.run.problem.program.modes[self.index]

    def at(self, share: Array | float) -> tuple[ModeKernel, list[Range]]:
        """The routines, and time and states at a share of each step; its end is the row there."""
        execution, rows, n = self.run.execution, self.rows, len(self.mode.states)
        times = np.asarray(execution.times, dtype=float)
        data = [Range(column, column) for column in data_at(self.run, times[rows]).T]
        values, powers = pieces_at(execution, rows, n)
        moved = np.zeros_like(values)
        for m in reversed(range(powers.shape[1])):
            moved = (moved + powers[:, m]) * np.reshape(share, (-1, 1))
        states = (
            np.asarray(execution.values[rows + 1, :n], dtype=float)
            if np.ndim(share) == 0 and share == END
            else values + moved
        )
        columns = [times[rows] + share * (times[rows + 1] - times[rows]), *states.T]
        return self.run.problem.kernel.enclosing.bind(self.index, data), [Range(column, column) for column in columns]

    def values(self, share: Array | float, k: int) -> Array:
        """Surface k there, between the ends of what round-off makes of it."""
        kernel, point = self.at(share)
        found = as_range(kernel.surfaces(*point)[k])
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


def _passed(run: RecordedRun) -> Iterator[Remark]:
    """Where surfaces rise through zero, from one point that is looked at to the next, while their `if` is false."""
    for steps in _looked(run):
        for k, edge in enumerate(steps.mode.edges):
            if edge.conditional and not edge.of_event:
                times = (time for a, b in pairwise(POINTS) for time in _passings(steps, k, a, b))
                yield from (of_edge("passed", edge.name, time) for time in times)


def _passings(steps: Looked, k: int, start: float, end: float) -> Iterator[Number]:
    """When surface k is passed between two shares of steps; not where a step ends by its own transition."""
    run = steps.run
    steps = steps.take(steps.values(end, k) > 0)
    if not len(steps.rows):
        return
    rising = (steps.values(start, k) <= steps.noise(start, k)) & (steps.values(end, k) > steps.noise(end, k))
    if end == END:
        rising &= np.array([run.crossed.get(row + 1) != k for row in steps.rows.tolist()])
    steps = steps.take(rising)
    on = steps.values(start, k) >= -steps.noise(start, k)  # as where the mode was entered
    low, high = np.full(len(steps.rows), start), np.where(on, start, end)
    for _ in range(ROUNDS if len(steps.rows) else 0):
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


def _walls(run: RecordedRun) -> Iterator[Remark]:
    """The first point of each wall at which it does not hold, among the rows and a few points between."""
    found: dict[tuple[int, int], float] = {}
    for steps in _looked(run):
        for k in range(len(steps.mode.edges), len(steps.mode.surfaces)):
            for share in POINTS:
                values = steps.values(share, k)
                if (values > 0).any():
                    beyond = steps.take(values > steps.noise(share, k))
                    times = beyond.at(share)[1][0].low
                    at = steps.index, k
                    found[at] = min([found.get(at, np.inf), *times[:1].tolist()])
    for (index, k), time in found.items():
        if time < np.inf:
            yield Remark("beyond", wall_of(run.problem.program.modes[index], k), time)
