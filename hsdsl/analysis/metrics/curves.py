"""The distance between two executions: the largest distance, over time, of their points (Definition 22).

Between the breakpoints of both runs each is a polynomial, so the supremum comes with a certified upper bound: where
both are in one convex domain the difference is bounded by its Bernstein coefficients, elsewhere by the distance at the
ends of ever shorter parts and the length of the way between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.interval import CERTIFIED, ZERO, Interval
from hsdsl.analysis.metrics.merge import Cells, merge
from hsdsl.analysis.metrics.on_space import OnSpace
from hsdsl.analysis.metrics.points import SpaceMetric
from hsdsl.analysis.metrics.supremum import Supremum, supremum
from hsdsl.analysis.metrics.trace import names_of, trace
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution

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
        """What the interval rests on, see :class:`Interval`."""
        return self.interval.status

    @property
    def middle(self) -> float:
        """Middle of the interval."""
        return self.interval.middle

    @property
    def sentence(self) -> str:
        """What is known, for a person."""
        where = "" if self.time is None or self.upper == 0 else f", the lower end attained at t = {self.time:.10g}"
        found = f"{self.metric}: {self.upper:.10g}, in {self.interval} ({self.status}){where}"
        return found + (f"\n{self.note}" if self.note else "")

    def as_json(self) -> dict[str, Any]:
        """Return what ``hsdsl distance --json`` prints."""
        return {
            "metric": self.metric,
            "lower": self.lower,
            "upper": self.upper,
            "status": self.status,
            "time": self.time,
            "span": list(self.span),
            "note": self.note,
        }


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
        _check_depth(cells, relaxation)
    name = "quotient" if relaxation is None else "relaxed"
    if cells.same:
        return no_distance(cells, name)
    on = OnSpace(metric, relaxation is not None)
    found = supremum(cells, on, gap, cells.rounding, metric.evaluations, metric.budget)
    return curve_distance(found, cells, name, gap, metric.budget, metric.status)


def _check_depth(cells: Cells, relaxation: float) -> None:
    deepest = float(max(np.max(curve.depth) for curve in (cells.a, cells.b)))
    if deepest > relaxation * (1 + 1e-9):
        raise UsageError(
            f"a strip of these runs is {deepest:.3g} deep, and the relaxed space's strips only {relaxation:.3g}",
            f"relaxation {deepest:.3g}",
        )


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
