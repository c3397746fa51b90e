"""The Skorokhod distance: how far apart two runs are when one may be retimed, at the price of the retiming.

    inf over increasing bijections r of the common span of  max(sup |r(t) - t|, sup D(x(t), y(r(t))))

with D the distance of states with modes (:mod:`hsdsl.metrics.rivals`), on right-continuous curves: of several
transitions at one instant only the last value counts. This is the variant of Gokhman (2008) and of Majumdar and Prabhu
(HSCC 2015), without a bound on the retiming's slope.
"""

from __future__ import annotations

import numpy as np

from hsdsl.execution import Execution
from hsdsl.metrics.curves import CurveDistance, merged, span_note
from hsdsl.metrics.interval import Interval
from hsdsl.metrics.merge import common_span
from hsdsl.metrics.polyline import Polyline, polylines
from hsdsl.metrics.rivals import sup_norm
from hsdsl.metrics.trace import Array, Trace

RESOLUTION = 1000


def skorokhod(a: Execution, b: Execution, resolution: int = RESOLUTION) -> CurveDistance:
    """Return the Skorokhod distance of two runs over their common time span.

    The best coupling of n and m points of the two curves is found exactly by dynamic programming in O(n m), within the
    band of times that it needs; it differs from the distance by no more than the way between neighbouring points.

    Parameters
    ----------
    a, b : Execution
    resolution : int
        About how many points of each curve are coupled.

    Raises
    ------
    UsageError
        The runs have no time in common, or one is not finite there.
    """
    cells = merged(a, b)
    span = common_span(cells.a, cells.b)
    p, q = polylines((cells.a, cells.b), (span, span), resolution)
    coupled = coupling(p, q)
    same_time = sup_norm(a, b).upper
    upper = min(coupled + (p.reach + q.reach) / 2, same_time)
    lower = max(coupled - max(p.reach, q.reach) / 2, switches_apart(cells.a, cells.b, span), 0.0)
    note = f"Curves by {len(p)} and {len(q)} points, up to {max(p.reach, q.reach):.2g} apart."
    notes = " ".join(filter(None, (span_note(a, b, span), note)))
    return CurveDistance(Interval(min(lower, upper), upper), None, "skorokhod", span, notes)


def coupling(p: Polyline, q: Polyline) -> float:
    """Return the least, over couplings in order, of the largest max(|t - s|, D) over coupled points."""
    longest = float(max(p.times[-1], q.times[-1]) - min(p.times[0], q.times[0]))
    band = 4 * max(p.reach, q.reach)
    while True:
        found = _coupling(p, q, band)
        if found <= band or band >= longest:
            return found
        band = max(2 * band, min(found, longest)) if np.isfinite(found) else 2 * band


def _coupling(p: Polyline, q: Polyline, band: float) -> float:
    """Couple only points whose times differ by at most ``band``, diagonal by diagonal of the table."""
    n, m = len(p), len(q)
    before, last = np.full(n, np.inf), np.full(n, np.inf)
    low, high = 0, 0
    for s in range(n + m - 1):
        low, high = max(low, s - m + 1), min(n - 1, s)
        while low < high and p.times[low] - q.times[s - low] < -band:
            low += 1
        while high > low and p.times[high] - q.times[s - high] > band:
            high -= 1
        i = np.arange(low, high + 1)
        j = s - i
        apart = np.abs(p.times[i] - q.times[j])
        states = np.sqrt(np.sum((p.states[i] - q.states[j]) ** 2, axis=1)) + (p.label[i] != q.label[j])
        cost = np.where(apart <= band, np.maximum(apart, states), np.inf)
        now = np.full(n, np.inf)
        now[low : high + 1] = np.maximum(cost, _reached(p, q, i, j, last, before)) if s else cost
        before, last = last, now
    return float(last[n - 1])


def _reached(p: Polyline, q: Polyline, i: Array, j: Array, last: Array, before: Array) -> Array:
    """Return the best way into pairs (i, j): from the left, from below, or from both where both flow or both jump."""
    back_i, back_j = np.maximum(i - 1, 0), np.maximum(j - 1, 0)
    best = np.minimum(np.where(i > 0, last[back_i], np.inf), np.where(j > 0, last[i], np.inf))
    if len(p) > 1 and len(q) > 1:
        together = (i > 0) & (j > 0) & (p.jumps[back_i] == q.jumps[back_j])
        best = np.minimum(best, np.where(together, before[back_i], np.inf))
    return best


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
