"""Steps of a run, many at once, as polynomials over [0, 1] in Bernstein form, and parts of them cut in halves.

A polynomial lies between the least and the largest of its Bernstein coefficients, so a part of a step lies in a box.
Routines over interval arithmetic then enclose what a surface or the flow is anywhere on that part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.numbers.bernstein import Array, from_powers, halving
from hsdsl.base.numbers.enclosures import Range, as_range
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.verdict.errors import Errors
from hsdsl.engine.simulate.verdict.run_view import MOST_PARTS, RunView

COLUMNS = ("row", "start", "width", "time", "length", "bernstein", "error")  # one entry for each part
CUTTING = 2.0**-48  # of the largest coefficient: what cutting and changing the basis may add


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of steps in one mode: N of them."""

    mode: int
    row: NDArray[np.int64]  # at which each step begins
    start: Array  # which share of the step each part is: from where,
    width: Array  # and how much
    time: Array  # when the step begins,
    length: Array  # and how long it takes
    bernstein: Array  # (N, n, degree + 1): the states along the part
    error: Array  # (N, n): how wrong the states may be, as often as a margin must be
    data: Array  # (N or 1, numbers): parameters and input segments; one row where they are the same for all

    def __len__(self) -> int:
        return len(self.row)

    def take(self, which: Any) -> Parts:
        """Some of them."""
        data = self.data if len(self.data) == 1 else self.data[which]
        return Parts(self.mode, **{name: getattr(self, name)[which] for name in COLUMNS}, data=data)

    def halves(self) -> Parts:
        """Both halves of each, the first ones before the second ones."""
        left, right = (self.bernstein @ half for half in halving(self.bernstein.shape[2] - 1))
        both = replace(self, bernstein=left, width=self.width / 2)
        return joined([both, replace(both, bernstein=right, start=self.start + both.width)])

    @property
    def times(self) -> Range:
        """The times of each part."""
        low, high = self.time + self.start * self.length, self.time + (self.start + self.width) * self.length
        return Range(np.where(low == 0, 0.0, np.nextafter(low, -np.inf)), np.nextafter(high, np.inf))  # 0 is exact

    def states(self, wider: float = 0.0) -> list[Range]:
        """The states along each part, ``wider`` times the error either way."""
        low, high = self.bernstein.min(axis=2), self.bernstein.max(axis=2)
        more = wider * self.error + CUTTING * np.maximum(np.abs(low), np.abs(high))
        return [Range(low[:, i] - more[:, i], high[:, i] + more[:, i]) for i in range(low.shape[1])]

    def ends(self) -> tuple[list[Range], list[Range]]:
        """Time and states at the first and at the last point of each part."""
        first, last = self.time + self.start * self.length, self.time + (self.start + self.width) * self.length
        states = self.bernstein[:, :, 0], self.bernstein[:, :, -1]
        both = ((first, states[0]), (last, states[1]))
        one, other = ([Range(t, t), *(Range(column, column) for column in x.T)] for t, x in both)
        return one, other

    def moved(self, states: Sequence[Range]) -> list[Range]:
        """States and all that are no further away than the error."""
        return [Range(x.low - e, x.high + e) for x, e in zip(states, self.error.T, strict=True)]

    @property
    def bound_data(self) -> list[Range]:
        """The data as a kernel over intervals takes them."""
        return [Range(column, column) for column in self.data.T]

    def bound(self, run: RunView) -> ModeKernel:
        """The mode's routines over intervals, with the data of these parts."""
        return run.problem.kernel.enclosing.bind(self.mode, self.bound_data)


def steps_of(run: RunView, places: int | None = None, marked: str = "") -> Iterator[Parts]:
    """Give the steps of all arcs of flow, or about ``places`` of a mode; those of a mode together, as memory allows.

    With ``marked``, a column of the screen's marks, only those that it leaves undecided are given.
    """
    marks = run.screen.marked(marked) if marked and run.screen else None
    if marks is not None and not marks.any():
        return
    times = np.asarray(run.execution.times, dtype=float)
    for mode, states, rows in run.rows_by_mode():
        rows = rows[times[rows] <= run.reliable_until]
        rows = rows if marks is None else rows[marks[rows] != 0]
        rows = rows[:: max(1, len(rows) // places)] if places else rows
        for first in range(0, len(rows), MOST_PARTS):
            yield parts_at(run, mode, states, rows[first : first + MOST_PARTS], run.errors)


def parts_at(
    run: RunView, mode: int, states: Sequence[str], rows: NDArray[np.int64], errors: Errors | None = None
) -> Parts:
    """The steps that begin at rows of a mode, with the errors of their states, if they are given."""
    n, times = len(states), np.asarray(run.execution.times, dtype=float)
    values, powers = run.pieces_at(rows, n)
    whole = np.concatenate([values[:, None, :], powers], axis=1).transpose(0, 2, 1)
    error = np.zeros((len(rows), n))
    if errors is not None:
        error = errors.by_row[rows + 1][:, [errors.columns[name] for name in states]]
    one = np.ones(len(rows))
    data = run.data_at(times[rows])
    length = times[rows + 1] - times[rows]
    return Parts(mode, rows, 0 * one, one, times[rows], length, whole @ from_powers(whole.shape[2] - 1), error, data)


def joined(parts: Sequence[Parts]) -> Parts:
    """Parts in one mode together."""
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS}
    data = parts[0].data
    if any(len(part.data) > 1 or not np.array_equal(part.data, data) for part in parts):
        data = np.concatenate([np.broadcast_to(part.data, (len(part), data.shape[1])) for part in parts])
    return Parts(mode=parts[0].mode, **joined, data=data)


def undecided(
    parts: Parts, decides: Callable[[Parts], NDArray[np.bool_]], halvings: int
) -> tuple[Parts, NDArray[np.bool_]]:
    """Cut parts in halves until a test decides them, or so many times; return what is left, and what is open there.

    ``decides`` gives for each part which of its questions are still open, shape (N, questions); once decided for a
    part, a question is decided for its halves.
    """
    open_ = decides(parts)
    for _ in range(halvings):
        left = open_.any(axis=1)
        if not left.any() or left.sum() > MOST_PARTS // 2:
            break
        parts = parts.take(left).halves()
        open_ = np.concatenate([open_[left]] * 2) & decides(parts)
    left = open_.any(axis=1)
    return parts.take(left), open_[left]


def high(value: Any, count: int) -> Array:
    """The upper end of a range, for so many parts."""
    return np.broadcast_to(as_range(value).high, (count,))


def low(value: Any, count: int) -> Array:
    """The lower end of a range, for so many parts."""
    return np.broadcast_to(as_range(value).low, (count,))
