"""The supremum over time of a distance between two curves, to a certified gap: bound, evaluate, cut, best first."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from hsdsl.metrics.merge import Cells, Side

Array = npt.NDArray[Any]

CHUNK = 65_536  # cells whose polynomials are held at once
FIRST_BATCH, LARGEST_BATCH = 32, 4096
EVALUATIONS = 400_000


class CellDistance(Protocol):
    """A distance between points that can be bounded over cells."""

    def over(self, a: Side, b: Side) -> Array:
        """Bound the distance over each whole cell from above, cheaply; infinite where nothing is known. Shape (n,)."""
        ...

    def at(self, a: Side, b: Side, end: int, times: Array) -> tuple[Array, Array]:
        """Bound the distance at the cells' left (0) or right (1) ends, from below and above."""
        ...

    def motion(self, side: Side) -> Array:
        """Bound how far one curve moves in each cell. Shape (n,)."""
        ...


@dataclass
class Supremum:
    """What is known of a supremum: it lies in [lower, upper], and ``lower`` is reached at ``time``.

    ``points`` is the largest upper bound at any single time, ``evaluations`` how many times were looked at.
    """

    time: float
    lower: float = 0.0
    upper: float = 0.0
    points: float = 0.0
    evaluations: int = 0
    complete: bool = True

    def accepted(self, gap: float, floor: float) -> float:
        """Return what an upper bound may be."""
        least = max(self.lower, self.points)
        return max(least * (1 + gap), least + floor)


@dataclass
class _Frontier:
    """Cells not yet decided: upper bounds over each, and at both ends where those are known (else not a number)."""

    cells: Cells
    bound: Array
    ends: Array = field(repr=False)

    def take(self, chosen: Array) -> _Frontier:
        return _Frontier(self.cells[chosen], self.bound[chosen], self.ends[chosen])

    def joined(self, other: _Frontier) -> _Frontier:
        own, more = self.cells, other.cells
        cells = Cells(
            own.a,
            own.b,
            np.concatenate([own.piece_a, more.piece_a]),
            np.concatenate([own.piece_b, more.piece_b]),
            np.concatenate([own.begin, more.begin]),
            np.concatenate([own.end, more.end]),
        )
        return _Frontier(cells, np.concatenate([self.bound, other.bound]), np.concatenate([self.ends, other.ends]))


def supremum(cells: Cells, distance: CellDistance, gap: float, floor: float, most: int = EVALUATIONS) -> Supremum:
    """Find the supremum over all cells.

    Parameters
    ----------
    cells : Cells
        The common time span.
    distance : CellDistance
        What to take the supremum of.
    gap, floor : float
        Stop when ``upper - lower <= max(gap * lower, floor)``, or when the bounds at single times allow no less.
    most : int
        Evaluate the distance at no more times than about this.

    Returns
    -------
    Supremum
    """
    found = Supremum(float(cells.begin[0]))
    frontier = _Frontier(cells, _bounds(cells, distance), np.full((len(cells), 2), np.nan))
    size = FIRST_BATCH
    while True:
        frontier = _undecided(frontier, found, gap, floor)
        if not len(frontier.cells):
            break
        if found.evaluations >= most:
            found.complete = False
            found.upper = max(found.upper, float(np.max(frontier.bound)))
            break
        n = len(frontier.cells)
        order = np.argpartition(-frontier.bound, size - 1) if size < n else np.arange(n)
        batch, frontier = frontier.take(order[:size]), frontier.take(order[size:])
        size = min(2 * size, LARGEST_BATCH)
        frontier = frontier.joined(_refined(batch, found, distance, gap, floor))
    found.upper = max(found.upper, found.points, found.lower)
    return found


def _bounds(cells: Cells, distance: CellDistance) -> Array:
    parts = [distance.over(*cells[k : k + CHUNK].sides()) for k in range(0, len(cells), CHUNK)]
    return np.concatenate(parts)


def _undecided(frontier: _Frontier, found: Supremum, gap: float, floor: float) -> _Frontier:
    """Drop the cells that cannot matter, keeping the largest of their bounds."""
    decided = frontier.bound <= found.accepted(gap, floor)
    if decided.any():
        found.upper = max(found.upper, float(np.max(frontier.bound[decided])))
        frontier = frontier.take(np.flatnonzero(~decided))
    return frontier


def _refined(batch: _Frontier, found: Supremum, distance: CellDistance, gap: float, floor: float) -> _Frontier:
    """Evaluate a batch at the ends of its cells, then cut those in two that may still hold the supremum."""
    a, b = batch.cells.sides()
    for end in (0, 1):
        _evaluate(batch, found, distance, a, b, end)
    reached = (batch.ends[:, 0] + batch.ends[:, 1] + distance.motion(a) + distance.motion(b)) / 2
    batch.bound = np.minimum(batch.bound, reached)
    batch = _undecided(batch, found, gap, floor)
    stuck = ~batch.cells.divisible
    if stuck.any():
        found.upper = max(found.upper, float(np.max(batch.bound[stuck])))
        batch = batch.take(np.flatnonzero(~stuck))
    if not len(batch.cells):
        return batch
    halves = batch.cells.halved()
    unknown = np.full(len(batch.cells), np.nan)
    ends = np.concatenate([np.stack([batch.ends[:, 0], unknown], 1), np.stack([unknown, batch.ends[:, 1]], 1)])
    bound = np.minimum(np.concatenate([batch.bound, batch.bound]), _bounds(halves, distance))
    return _Frontier(halves, bound, ends)


def _evaluate(batch: _Frontier, found: Supremum, distance: CellDistance, a: Side, b: Side, end: int) -> None:
    unknown = np.flatnonzero(np.isnan(batch.ends[:, end]))
    if not len(unknown):
        return
    times = (batch.cells.begin, batch.cells.end)[end][unknown]
    lower, upper = distance.at(a[unknown], b[unknown], end, times)
    batch.ends[unknown, end] = upper
    found.evaluations += len(unknown)
    best = int(np.argmax(lower))
    if lower[best] > found.lower:
        found.lower, found.time = float(lower[best]), float(times[best])
    found.points = max(found.points, float(np.max(upper)))
