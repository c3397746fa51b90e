"""The supremum over time of a distance between two curves, to a certified gap: bound, evaluate, cut, best first."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.merge import Cells, Side
from hsdsl.engine.execution import Array

CHUNK = 65_536  # cells whose polynomials are held at once
FIRST_BATCH, LARGEST_BATCH = 32, 4096
ROUGH, FEW = 0.01, 0.1  # within so much of the lower bound, spend only so much of the evaluations allowed


class CellDistance(Protocol):
    """A distance between points that can be bounded over cells."""

    def over(self, a: Side, b: Side) -> Array:
        """Bound the distance over each whole cell from above, cheaply; infinite where nothing is known. Shape (n,)."""
        ...

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float) -> tuple[Array, Array]:
        """Bound the distance at the cells' left (0) or right (1) ends, from below and above.

        Upper bounds of at most ``enough`` need not be improved.
        """
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
        cells = self.cells.joined(other.cells)
        return _Frontier(cells, np.concatenate([self.bound, other.bound]), np.concatenate([self.ends, other.ends]))


def supremum(cells: Cells, distance: CellDistance, gap: float, floor: float, most: int, budget: Budget) -> Supremum:
    """Find the supremum of a distance over all cells.

    Stops when ``upper - lower <= max(gap * lower, floor)``, when bounds at single times allow no less, after about
    ``most`` evaluations, or when the budget is spent.
    """
    found = Supremum(float(cells.begin[0]))
    search = _Search(distance, found, gap, floor, most, budget)
    bounds = _bounds(cells, distance)
    known = np.isfinite(bounds)
    frontier = _Frontier(cells, bounds, np.full((len(cells), 2), np.nan))
    likely, others = _largest_first(bounds, np.flatnonzero(known))
    search.best_first(frontier.take(likely))
    search.best_first(frontier.take(others[search.undecided(bounds[others])]))
    search.best_first(search.coarse_to_fine(frontier, np.flatnonzero(~known)))
    found.upper = max(found.upper, found.points)
    return found


def _bounds(cells: Cells, distance: CellDistance) -> Array:
    return np.concatenate([distance.over(*sides) for sides in _chunks(cells)])


def _chunks(cells: Cells) -> Iterator[tuple[Side, Side]]:
    """Both curves on some cells after the other."""
    return (cells[k : k + CHUNK].sides() for k in range(0, len(cells), CHUNK))


@dataclass
class _Search:
    """Refines until what is left cannot matter."""

    distance: CellDistance
    found: Supremum
    gap: float
    floor: float
    most: int
    budget: Budget

    def best_first(self, frontier: _Frontier) -> None:
        """Evaluate and cut the cells with the largest bounds until all are decided."""
        size = FIRST_BATCH
        while True:
            frontier = frontier.take(self.undecided(frontier.bound))
            if not len(frontier.cells) or self._spent(frontier.bound):
                return
            order = _largest(frontier.bound, size)
            batch, frontier = frontier.take(order[:size]), frontier.take(order[size:])
            size = min(2 * size, LARGEST_BATCH)
            frontier = frontier.joined(self._refined(batch))

    def coarse_to_fine(self, frontier: _Frontier, chosen: Array) -> _Frontier:
        """Bound stretches of consecutive cells by the distance at their ends and the way between; return what is left.

        Stretches end at the transitions of either curve. What remains undecided is cut down to single cells.
        """
        if not len(chosen):
            return frontier.take(chosen)
        cells = frontier.cells[chosen]
        way = np.concatenate([[0.0], np.cumsum(_ways(cells, self.distance))])
        opens = np.append(True, _breaks(cells, chosen))
        first = np.flatnonzero(opens)
        last = np.append(first[1:], len(cells)) - 1
        ends = np.full((len(cells), 2), np.nan)
        bound = np.full(len(first), np.inf)
        single: list[Array] = []
        size = FIRST_BATCH
        while True:
            open_ = self.undecided(bound)
            first, last, bound = first[open_], last[open_], bound[open_]
            if not len(first) or self._spent(bound):
                break
            order = _largest(bound, size)
            now, later = order[:size], order[size:]
            size = min(2 * size, LARGEST_BATCH)
            self._evaluate(cells, ends, first[now], 0)
            self._evaluate(cells, ends, last[now], 1)
            f, g = first[now], last[now]
            reached = np.minimum(bound[now], (ends[f, 0] + ends[g, 1] + way[g + 1] - way[f]) / 2)
            left = self.undecided(reached)
            f, g, reached = f[left], g[left], reached[left]
            single.append(f[f == g])
            f, g, reached = f[f < g], g[f < g], reached[f < g]
            middle = (f + g) // 2
            first = np.concatenate([first[later], f, middle + 1])
            last = np.concatenate([last[later], middle, g])
            bound = np.concatenate([bound[later], reached, reached])
        rest = np.concatenate(single) if single else np.zeros(0, dtype=int)
        return _Frontier(cells[rest], np.full(len(rest), np.inf), ends[rest])

    def undecided(self, bound: Array) -> Array:
        """Return which bounds may still matter, keeping the largest of the others."""
        decided = bound <= self.found.accepted(self.gap, self.floor)
        if decided.any():
            self.found.upper = max(self.found.upper, float(np.max(bound[decided])))
        return np.flatnonzero(~decided)

    def _spent(self, bound: Array) -> bool:
        highest = float(np.max(bound))
        self.budget.tell(self.found.lower, max(highest, self.found.points))
        over = self.found.evaluations > 0 and self.budget.spent()  # a first look is always taken
        near = highest <= self.found.accepted(max(self.gap, ROUGH), self.floor)
        if self.found.evaluations < self.most * (FEW if near else 1) and not over:
            return False
        self.found.complete = False
        self.found.upper = max(self.found.upper, highest)
        return True

    def _refined(self, batch: _Frontier) -> _Frontier:
        """Evaluate a batch at the ends of its cells, then cut those in two that may still hold the supremum."""
        every = np.arange(len(batch.cells))
        for end in (0, 1):
            self._evaluate(batch.cells, batch.ends, every, end)
        reached = (batch.ends[:, 0] + batch.ends[:, 1] + _ways(batch.cells, self.distance)) / 2
        batch.bound = np.minimum(batch.bound, reached)
        batch = batch.take(self.undecided(batch.bound))
        stuck = ~batch.cells.divisible
        if stuck.any():
            self.found.upper = max(self.found.upper, float(np.max(batch.bound[stuck])))
            batch = batch.take(np.flatnonzero(~stuck))
        if not len(batch.cells):
            return batch
        halves = batch.cells.halved()
        unknown = np.full(len(batch.cells), np.nan)
        ends = np.concatenate([np.stack([batch.ends[:, 0], unknown], 1), np.stack([unknown, batch.ends[:, 1]], 1)])
        bound = np.minimum(np.concatenate([batch.bound, batch.bound]), _bounds(halves, self.distance))
        return _Frontier(halves, bound, ends)

    def _evaluate(self, cells: Cells, ends: Array, chosen: Array, end: int) -> None:
        """Fill in the upper bounds at one end of some cells, where they are not known."""
        unknown = chosen[np.isnan(ends[chosen, end])]
        if not len(unknown):
            return
        undecided = cells[unknown]
        times = (undecided.begin, undecided.end)[end]
        found, enough = self.found, self.found.accepted(self.gap, self.floor)
        lower, upper = self.distance.at(*undecided.sides(), end, times, enough)
        ends[unknown, end] = upper
        found.evaluations += len(unknown)
        best = int(np.argmax(lower))
        if lower[best] > found.lower:
            found.lower, found.time = float(lower[best]), float(times[best])
        found.upper = max(found.upper, float(np.max(upper)))
        # What was accepted before it was improved, or has no bound, must not raise what is accepted next.
        found.points = max(found.points, float(np.max(upper[(upper > enough) & np.isfinite(upper)], initial=0.0)))


def _largest_first(bound: Array, chosen: Array) -> tuple[Array, Array]:
    """Part the cells with the largest bounds, which settle most of the others, from the rest."""
    order = chosen[_largest(bound[chosen], LARGEST_BATCH)]
    return order[:LARGEST_BATCH], order[LARGEST_BATCH:]


def _largest(bound: Array, size: int) -> Array:
    """Order bounds so that the largest ``size`` come first."""
    return np.argpartition(-bound, size - 1) if size < len(bound) else np.arange(len(bound))


def _ways(cells: Cells, distance: CellDistance) -> Array:
    """Bound how far both curves together move in each cell."""
    return np.concatenate([distance.motion(a) + distance.motion(b) for a, b in _chunks(cells)])


def _breaks(cells: Cells, number: Array) -> Array:
    """Say, for each cell but the first, whether a curve jumps before it or it does not follow the cell before it."""
    jumps = [curve.jump[piece] for curve, piece in ((cells.a, cells.piece_a), (cells.b, cells.piece_b))]
    return (np.diff(number) > 1) | (np.diff(jumps[0]) != 0) | (np.diff(jumps[1]) != 0)
