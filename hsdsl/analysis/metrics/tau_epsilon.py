"""(tau, epsilon)-closeness of hybrid arcs (Goebel, Sanfelice, Teel, *Hybrid Dynamical Systems*, 2012, Sec. 5.3).

Two hybrid arcs are (tau, epsilon)-close when for every (t, j) of one with t + j <= tau there is (s, j) of the other,
with the same j, |t - s| < epsilon and D < epsilon, and the other way round; D is the distance of states with modes
(:mod:`hsdsl.analysis.metrics.labelled_sup`), the mode being one of the state's components there.
"""

from __future__ import annotations

import numpy as np

from hsdsl.analysis.metrics.curves import CurveDistance
from hsdsl.analysis.metrics.interval import INFINITE, Interval
from hsdsl.analysis.metrics.merge import ROUNDOFF, rounding_of
from hsdsl.analysis.metrics.polyline import Polyline, polylines
from hsdsl.analysis.metrics.trace import Array, Trace, names_of, trace
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution

RESOLUTION = 2000
PAIRS = 4_000_000  # distances held at once


def tau_epsilon(a: Execution, b: Execution, tau: float | None = None, resolution: int = RESOLUTION) -> CurveDistance:
    """Return the infimum of the epsilons for which two runs are (tau, epsilon)-close.

    Infinite where one run makes a transition, with t + j <= tau, that the other never makes. Symmetric, but no metric:
    the cut at tau breaks the triangle inequality. About ``resolution`` points of each run are compared; the interval
    allows for what lies between them. By default tau is as far as both runs go.
    """
    names = names_of((a, b))
    curves = trace(a, names, instants=True), trace(b, names, instants=True)
    for run, curve in zip((a, b), curves, strict=True):
        if not np.isfinite(curve.coefficients).all():
            raise UsageError(f"a run of {run.model} is not finite: no distance is defined")
    tau = min(_last_hybrid_time(curve) for curve in curves) if tau is None else tau
    spans = [(float(curve.start[0]), float(curve.end[-1])) for curve in curves]
    p, q = polylines(curves, spans, resolution, cuts=tau)
    found, labels = max(one_way(p, q, tau), one_way(q, p, tau)), other_modes(p, q, tau)
    rounding = rounding_of(*curves) + ROUNDOFF * max(abs(time) for span in spans for time in span)
    reach = max(p.reach, q.reach) / 2 + rounding
    interval = INFINITE if found == np.inf else Interval(max(found - reach, labels, 0.0), max(found + reach, labels))
    note = f"For t + j up to {tau:.10g}, runs by {len(p)} and {len(q)} points, up to {2 * reach:.2g} apart."
    return CurveDistance(interval, None, "tau-epsilon", (0.0, tau), note)


def _last_hybrid_time(curve: Trace) -> float:
    return float(np.max(curve.end + curve.jump))


def one_way(p: Polyline, q: Polyline, tau: float) -> float:
    """Return the largest, over the points (t, j) of p, of the least max(|t - s|, D) over points (s, j) of q."""
    rows = np.flatnonzero(p.up_to(tau))
    jumps = p.jump[rows]
    largest = 0.0
    for j in np.unique(jumps).tolist():
        here = rows[slice(*np.searchsorted(jumps, [j, j + 1]).tolist())]
        there = slice(*np.searchsorted(q.jump, [j, j + 1]).tolist())
        if there.start == there.stop:
            return np.inf
        step = max(1, PAIRS // (there.stop - there.start))
        for k in range(0, len(here), step):
            largest = max(largest, float(np.max(_nearest(p, here[k : k + step], q, there))))
    return largest


def _nearest(p: Polyline, here: Array, q: Polyline, there: slice) -> Array:
    squares = np.zeros((len(here), there.stop - there.start))
    for column in range(p.states.shape[1]):
        squares += np.subtract.outer(p.states[here, column], q.states[there, column]) ** 2
    apart = np.sqrt(squares) + np.not_equal.outer(p.label[here], q.label[there])
    return np.min(np.maximum(apart, np.abs(np.subtract.outer(p.times[here], q.times[there]))), axis=1)


def other_modes(p: Polyline, q: Polyline, tau: float) -> float:
    """Return 1 where for some j, t + j <= tau, the two are in different modes (each j has one mode), else 0."""
    for one, other in ((p, q), (q, p)):
        jumps, first = np.unique(one.jump[one.up_to(tau)], return_index=True)
        modes = one.label[one.up_to(tau)][first]
        found = np.searchsorted(other.jump, jumps)
        present = (found < len(other)) & (other.jump[np.minimum(found, len(other) - 1)] == jumps)
        if (other.label[found[present]] != modes[present]).any():
            return 1.0
    return 0.0
