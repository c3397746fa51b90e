"""The distance between two executions: the largest distance, over time, of their points (Definition 22).

Between the breakpoints of both runs each is a polynomial, so the supremum comes with a certified upper bound: where
both are in one convex domain the difference is bounded by its Bernstein coefficients, elsewhere by the distance at the
ends of ever shorter parts and the length of the way between them. Cells are bounded, evaluated and cut, best first.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.metrics.interval import CERTIFIED, ZERO, Budget, Interval
from hsdsl.analysis.metrics.points import ModePoints, SpaceMetric
from hsdsl.analysis.metrics.trace import Cells, Side, merge, names_of, trace
from hsdsl.analysis.report.json_form import named
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.bernstein import UNIT, bernstein, largest_norm, length
from hsdsl.engine.execution import Array, Execution

GAP = 1e-6  # of the lower bound, at which refinement stops: so that what is printed is the distance
RESOLVED = 0.05  # a wider gap is explained in the note


@dataclass(frozen=True)
class CurveDistance:
    """A distance between two executions by the metric of a name, over a time span.

    ``time`` is where the lower bound is attained; None for a distance that is not a supremum over time. ``note`` holds
    a sentence for each thing a reader should know.
    """

    interval: Interval
    time: float | None
    metric: str
    span: tuple[float, float]
    note: str = ""

    @property
    def lower(self) -> float:
        """The distance is at least this."""
        return self.interval.lower

    @property
    def upper(self) -> float:
        """The distance is at most this."""
        return self.interval.upper

    @property
    def status(self) -> str:
        """The kind of proof of the interval (see :class:`Interval`)."""
        return self.interval.status

    @property
    def middle(self) -> float:
        return self.interval.middle

    @property
    def sentence(self) -> str:
        """What is known, for a person."""
        where = "" if self.time is None or self.upper == 0 else f", the lower end attained at t = {self.time:.10g}"
        found = f"{self.metric}: {self.upper:.10g}, in {self.interval} ({self.status}){where}"
        return found + (f"\n{self.note}" if self.note else "")

    def as_json(self) -> dict[str, Any]:
        """Return what ``hsdsl distance --json`` prints."""
        return named(self, "metric lower upper status time") | {"span": list(self.span), "note": self.note}


def rho(
    a: Execution, b: Execution, metric: SpaceMetric, *, relaxation: float | None = None, gap: float = GAP
) -> CurveDistance:
    """Return the supremum over the common time span of the distance between two executions (Def. 22).

    With a ``relaxation``, distances are those on the relaxed space of strips so deep; else a strip's point counts as
    the guard's. Bounds end up ``gap`` apart, relative to the lower one, or as near as rounding allows.

    Raises :class:`UsageError` without common time, for runs that are not finite, and for strips deeper than
    ``relaxation``.
    """
    cells = merged(a, b)
    if relaxation is not None:
        deepest = float(max(np.max(curve.depth) for curve in (cells.a, cells.b)))
        if deepest > relaxation * (1 + 1e-9):
            raise UsageError(
                f"a strip of these runs is {deepest:.3g} deep, and the relaxed space's strips only {relaxation:.3g}",
                f"relaxation {deepest:.3g}",
            )
    name = "quotient" if relaxation is None else "relaxed"
    if cells.same:
        return no_distance(cells, name)
    on = OnSpace(metric, relaxation is not None)
    found = Supremum(cells, on, gap, cells.rounding, metric.evaluations, metric.budget)
    return curve_distance(found, cells, name, gap, metric.budget, metric.status)


def merged(a: Execution, b: Execution) -> Cells:
    """Cut two executions at the breakpoints of both; refuse what is not finite."""
    names = names_of((a, b))
    cells = merge(trace(a, names), trace(b, names))
    for run, curve, pieces in ((a, cells.a, cells.piece_a), (b, cells.b, cells.piece_b)):
        used = slice(int(pieces[0]), int(pieces[-1]) + 1)
        finite = np.isfinite(curve.coefficients[used]).all(axis=(1, 2))
        if not finite.all():
            when = curve.start[used][int(np.argmin(finite))]
            raise UsageError(
                f"a run of {run.model} is not finite at t = {when:.10g}: no distance is defined there",
                "compare runs that end before that time",
            )
    return cells


def no_distance(cells: Cells, metric: str, status: str = CERTIFIED) -> CurveDistance:
    """Return the distance of a curve from itself."""
    return CurveDistance(ZERO.but(status), cells.span[0], metric, cells.span)


def curve_distance(
    found: Supremum, cells: Cells, metric: str, gap: float, budget: Budget, status: str = CERTIFIED
) -> CurveDistance:
    """Say what a supremum means."""
    notes = [cells.note]
    if found.upper > max(found.lower * (1 + max(gap, RESOLVED)), found.lower + cells.rounding):
        if budget.ran_out:
            cause = f"the {budget.seconds:g} seconds it was given were over after {found.evaluations} point distances"
        elif found.complete:
            cause = "the bounds on single point distances allow no less"
        else:
            cause = f"the search stopped after {found.evaluations} point distances"
        notes.append(f"Upper and lower bound differ: {cause}.")
    interval = Interval(found.lower, found.upper, status)
    return CurveDistance(interval, found.time, metric, cells.span, " ".join(filter(None, notes)))


class Labelled:
    """The distance D of states with modes; its methods are what a supremum asks of any distance of points."""

    def over(self, a: Side, b: Side) -> Array:
        """Bound the distance over each whole cell from above, cheaply; infinite where nothing is known. Shape (n,)."""
        return largest_norm(a.powers - b.powers) + (a.mode != b.mode) + a.rounding + b.rounding

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float) -> tuple[Array, Array]:
        """Bound the distance at the cells' left (0) or right (1) ends, from below and above.

        Upper bounds of at most ``enough`` need not be improved.
        """
        difference = a.at_end(end) - b.at_end(end)
        states = np.sqrt(np.sum(difference**2, axis=1))
        apart = states + (a.mode != b.mode)
        rounding = a.rounding + b.rounding + (difference.shape[1] + 4) * UNIT * states
        return np.maximum(0.0, apart - rounding), apart + rounding

    def motion(self, side: Side) -> Array:
        """Bound the length of one curve in each cell by that of its control polygon. Shape (n,)."""
        return length(side.powers) + side.stray


@dataclass(frozen=True)
class OnSpace(Labelled):
    """Distances on M, where a strip's point (z, tau) counts as z, or with ``strips`` on the relaxed space."""

    metric: SpaceMetric
    strips: bool

    def over(self, a: Side, b: Side) -> Array:
        """Bound by the difference of the two polynomials, where the straight lines between them stay in one domain."""
        bound = np.full(len(a.pieces), np.inf)
        inside = np.zeros(len(a.pieces), dtype=bool)
        for i, layout in enumerate(a.trace.modes):
            if layout not in b.trace.modes:
                continue
            other = b.trace.modes.index(layout)
            here = np.flatnonzero((a.trace.mode[a.pieces] == i) & (b.trace.mode[b.pieces] == other))
            if len(here):
                inside[here] = self.metric.contains(layout[0], *self._hull(a[here], b[here], list(layout[1])))
        same = np.flatnonzero(inside)
        if len(same):
            bound[same] = largest_norm(a.powers[same] - b.powers[same])
            if self.strips:
                apart = np.max(a.depth[same] + b.depth[same], axis=1)
                bound[same] += apart
        return bound + a.rounding + b.rounding

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float) -> tuple[Array, Array]:
        """Bound at single times, mode pair by mode pair."""
        lower, upper = np.zeros(len(a.pieces)), np.full(len(a.pieces), np.inf)
        x, y = a.at_end(end), b.at_end(end)
        pairs = np.stack([a.trace.mode[a.pieces], b.trace.mode[b.pieces]], axis=1)
        for i, j in np.unique(pairs, axis=0).tolist():
            here = np.flatnonzero((pairs[:, 0] == i) & (pairs[:, 1] == j))
            p = self._points(a[here], i, x[here], times[here], end)
            q = self._points(b[here], j, y[here], times[here], end)
            lower[here], upper[here] = self.metric.between(p, q, enough)
            enough = max(enough, float(lower[here].max()))
        rounding = a.rounding + b.rounding
        return np.maximum(0.0, lower - rounding), upper + rounding

    def motion(self, side: Side) -> Array:
        """Bound the way by the length of the control polygon, with the depth and the time where they count."""
        way = length(side.powers) + side.stray
        if self.strips:
            way += np.abs(side.depth[:, 1] - side.depth[:, 0])
        return way + side.duration if self.metric.timed else way

    def _points(self, side: Side, mode: int, x: Array, times: Array, end: int) -> ModePoints:
        name, columns = side.trace.modes[mode]
        edge = side.edge if self.strips else np.full(len(times), "")
        depth = side.depth[:, end] if self.strips else np.zeros(len(times))
        return ModePoints(name, x[:, list(columns)], times, edge, depth)

    def _hull(self, a: Side, b: Side, columns: list[int]) -> tuple[Array, Array]:
        """Boxes around both curves; with the time as last coordinate where it is one."""
        points = np.concatenate([bernstein(a.powers), bernstein(b.powers)], axis=1)[:, :, columns]
        low, high = points.min(axis=1), points.max(axis=1)
        if self.metric.timed:
            begin = a.trace.start[a.pieces]
            low, high = np.column_stack([low, begin]), np.column_stack([high, a.trace.end[a.pieces]])
        return low, high


CHUNK = 65_536  # cells whose polynomials are held at once
FIRST_BATCH, LARGEST_BATCH = 32, 4096
ROUGH, FEW = 0.01, 0.1  # within so much of the lower bound, spend only so much of the evaluations allowed


class _Frontier(NamedTuple):
    """Cells not yet decided: upper bounds over each, and at both ends where those are known (else not a number)."""

    cells: Cells
    bound: Array
    ends: Array

    def take(self, chosen: Array) -> _Frontier:
        return _Frontier(self.cells[chosen], self.bound[chosen], self.ends[chosen])

    def joined(self, other: _Frontier) -> _Frontier:
        cells = self.cells.joined(other.cells)
        return _Frontier(cells, np.concatenate([self.bound, other.bound]), np.concatenate([self.ends, other.ends]))


def _bounds(cells: Cells, distance: Labelled) -> Array:
    return np.concatenate([distance.over(*sides) for sides in _chunks(cells)])


def _chunks(cells: Cells) -> Iterator[tuple[Side, Side]]:
    """Both curves on some cells after the other."""
    return (cells[k : k + CHUNK].sides() for k in range(0, len(cells), CHUNK))


class Supremum:
    """The supremum of a distance over all cells: it lies in [lower, upper], and ``lower`` is reached at ``time``.

    The search stops when ``upper - lower <= max(gap * lower, floor)``, when bounds at single times allow no less, after
    about ``most`` evaluations, or when the budget is spent. ``points`` is the largest upper bound at any single time,
    ``evaluations`` how many times were examined.
    """

    def __init__(self, cells: Cells, distance: Labelled, gap: float, floor: float, most: int, budget: Budget) -> None:
        self.distance, self.gap, self.floor, self.most, self.budget = distance, gap, floor, most, budget
        self.time = float(cells.begin[0])
        self.lower = self.upper = self.points = 0.0
        self.evaluations, self.complete = 0, True
        bounds = _bounds(cells, distance)
        known = np.isfinite(bounds)
        frontier = _Frontier(cells, bounds, np.full((len(cells), 2), np.nan))
        # Those with the largest bounds settle most of the others.
        order = np.flatnonzero(known)
        order = order[_largest(bounds[order], LARGEST_BATCH)]
        likely, others = order[:LARGEST_BATCH], order[LARGEST_BATCH:]
        self.best_first(frontier.take(likely))
        self.best_first(frontier.take(others[self.undecided(bounds[others])]))
        self.best_first(self.coarse_to_fine(frontier, np.flatnonzero(~known)))
        self.upper = max(self.upper, self.points)

    def accepted(self, gap: float) -> float:
        """What an upper bound may be."""
        least = max(self.lower, self.points)
        return max(least * (1 + gap), least + self.floor)

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
        jumps = [curve.jump[piece] for curve, piece in ((cells.a, cells.piece_a), (cells.b, cells.piece_b))]
        opens = np.append(True, (np.diff(chosen) > 1) | (np.diff(jumps[0]) != 0) | (np.diff(jumps[1]) != 0))
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
        decided = bound <= self.accepted(self.gap)
        if decided.any():
            self.upper = max(self.upper, float(np.max(bound[decided])))
        return np.flatnonzero(~decided)

    def _spent(self, bound: Array) -> bool:
        highest = float(np.max(bound))
        self.budget.tell(self.lower, max(highest, self.points))
        over = self.evaluations > 0 and self.budget.spent()  # the first pairs are always examined
        near = highest <= self.accepted(max(self.gap, ROUGH))
        if self.evaluations < self.most * (FEW if near else 1) and not over:
            return False
        self.complete = False
        self.upper = max(self.upper, highest)
        return True

    def _refined(self, batch: _Frontier) -> _Frontier:
        """Evaluate a batch at the ends of its cells, then cut those in two that may still hold the supremum."""
        every = np.arange(len(batch.cells))
        for end in (0, 1):
            self._evaluate(batch.cells, batch.ends, every, end)
        reached = (batch.ends[:, 0] + batch.ends[:, 1] + _ways(batch.cells, self.distance)) / 2
        batch = batch._replace(bound=np.minimum(batch.bound, reached))
        batch = batch.take(self.undecided(batch.bound))
        stuck = ~batch.cells.divisible
        if stuck.any():
            self.upper = max(self.upper, float(np.max(batch.bound[stuck])))
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
        enough = self.accepted(self.gap)
        lower, upper = self.distance.at(*undecided.sides(), end, times, enough)
        ends[unknown, end] = upper
        self.evaluations += len(unknown)
        best = int(np.argmax(lower))
        if lower[best] > self.lower:
            self.lower, self.time = float(lower[best]), float(times[best])
        self.upper = max(self.upper, float(np.max(upper)))
        # What was accepted before it was improved, or has no bound, must not raise what is accepted next.
        self.points = max(self.points, float(np.max(upper[(upper > enough) & np.isfinite(upper)], initial=0.0)))


def _largest(bound: Array, size: int) -> Array:
    """Order bounds so that the largest ``size`` come first."""
    return np.argpartition(-bound, size - 1) if size < len(bound) else np.arange(len(bound))


def _ways(cells: Cells, distance: Labelled) -> Array:
    """Bound the sum of the lengths of both curves in each cell."""
    return np.concatenate([distance.motion(a) + distance.motion(b) for a, b in _chunks(cells)])
