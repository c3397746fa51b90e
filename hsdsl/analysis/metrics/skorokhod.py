"""The Skorokhod distance: how far apart two runs are when one may be retimed, at the price of the retiming.

    inf over increasing bijections r of the common span of  max(sup |r(t) - t|, sup D(x(t), y(r(t))))

with D the distance of states with modes (:mod:`hsdsl.analysis.metrics.labelled_sup`), on right-continuous curves: of several
transitions at one instant only the last value counts. This is the variant of Gokhman (2008) and of Majumdar and Prabhu
(HSCC 2015), without a bound on the retiming's slope.
"""

from __future__ import annotations

import numpy as np

from hsdsl.analysis.metrics.curves import CurveDistance, merged, no_distance
from hsdsl.analysis.metrics.interval import Interval
from hsdsl.analysis.metrics.labelled_sup import sup_norm
from hsdsl.analysis.metrics.merge import ROUNDOFF
from hsdsl.analysis.metrics.polyline import Polyline, polylines
from hsdsl.analysis.metrics.trace import Array, Trace
from hsdsl.engine.execution import Execution

RESOLUTION = 1000


def skorokhod(a: Execution, b: Execution, resolution: int = RESOLUTION) -> CurveDistance:
    """Return the Skorokhod distance of two runs over their common time span.

    The best coupling of about ``resolution`` points of each curve is found exactly, by dynamic programming among points
    that are near enough. It differs from the distance by no more than the way between neighbouring points.
    """
    cells = merged(a, b)
    span = cells.span
    if cells.same:
        return no_distance(cells, "skorokhod")
    p, q = polylines((cells.a, cells.b), (span, span), resolution)
    coupled, rounding = coupling(p, q), cells.rounding + ROUNDOFF * max(map(abs, span))
    same_time = sup_norm(a, b).upper
    upper = min(coupled + (p.reach + q.reach) / 2 + rounding, same_time)
    lower = max(coupled - max(p.reach, q.reach) / 2 - rounding, switches_apart(cells.a, cells.b, span), 0.0)
    note = f"Curves by {len(p)} and {len(q)} points, up to {max(p.reach, q.reach):.2g} apart."
    notes = " ".join(filter(None, (cells.note, note)))
    return CurveDistance(Interval(lower, upper), None, "skorokhod", span, notes)


def coupling(p: Polyline, q: Polyline) -> float:
    """Return the least, over couplings in order, of the largest max(|t - s|, D) over coupled points.

    Limits are tried, doubled until a coupling within one exists: that one is the best. Below 1 no two modes are
    coupled.
    """
    largest = max(_cost(p, q, np.arange(len(p)), np.zeros(len(p), dtype=int)).max(), 1.0)
    # Ends are coupled with ends; without them, curves of no length would begin at a limit that doubling never raises.
    ends = _cost(p, q, np.array([0, len(p) - 1]), np.array([0, len(q) - 1]))
    visits = [one.label[np.append(True, np.diff(one.label) != 0)].tolist() for one in (p, q)]
    limit = max(4 * max(p.reach, q.reach), float(ends.max()), float(visits[0] != visits[1]))
    while True:
        found = _within(p, q, limit)
        if found < np.inf or limit == np.inf:
            return found
        limit = 2 * limit if 0 < limit < 8 * largest else np.inf


def _within(p: Polyline, q: Polyline, limit: float) -> float:
    """Couple only points that are at most ``limit`` apart, diagonal by diagonal of the table; inf where none does."""
    n, m = len(p), len(q)
    jumps_p, jumps_q = np.append(p.jumps, False), np.append(q.jumps, False)
    before, last = np.full(n + 1, np.inf), np.full(n + 1, np.inf)  # a last entry that is never reached, also as -1
    reach = (0, 0), (0, -1)  # of the last two diagonals, the indices that were reached
    for s in range(n + m - 1):
        low = max(min(a for a, b in reach if a <= b), s - m + 1)
        high = min(max(b for a, b in reach if a <= b) + 1, n - 1, s)
        i = np.arange(low, high + 1)
        j = s - i
        # From the left, from below, or from both where both flow or both jump.
        together = np.where(jumps_p[i - 1] == jumps_q[j - 1], before[i - 1], np.inf)
        reached = np.minimum(np.minimum(last[i - 1], last[i]), together) if s else 0.0
        value = np.maximum(_cost(p, q, i, j), reached)
        now = np.full(n + 1, np.inf)
        now[i] = np.where(value <= limit, value, np.inf)
        hit = np.flatnonzero(now[i] < np.inf)
        reach = ((low + int(hit[0]), low + int(hit[-1])) if len(hit) else (0, -1)), reach[0]
        if reach[0] == reach[1] == (0, -1):
            return np.inf
        before, last = last, now
    return float(last[n - 1])


def _cost(p: Polyline, q: Polyline, i: Array, j: Array) -> Array:
    states = np.sqrt(np.sum((p.states[i] - q.states[j]) ** 2, axis=1)) + (p.label[i] != q.label[j])
    return np.maximum(np.abs(p.times[i] - q.times[j]), states)


def switches_apart(a: Trace, b: Trace, span: tuple[float, float]) -> float:
    """Bound the distance from below by the modes: 1 for other sequences, else the time between switches, at most 1.

    A retiming that costs less than 1 takes every change of mode to the same change of mode.
    """
    (modes_a, times_a), (modes_b, times_b) = _switches(a, span), _switches(b, span)
    if modes_a != modes_b:
        return 1.0
    return min(1.0, float(np.max(np.abs(times_a - times_b), initial=0.0)))


def _switches(curve: Trace, span: tuple[float, float]) -> tuple[list[str], Array]:
    first, last = curve.find(np.array(span))
    modes = np.array([name for name, _ in curve.modes])[curve.mode[first : last + 1]]
    changes = np.flatnonzero(modes[1:] != modes[:-1]) + 1
    return modes[np.append(0, changes)].tolist(), curve.start[first : last + 1][changes]
