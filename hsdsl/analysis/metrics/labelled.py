"""Distances on the space of trajectories, for comparison: they see the mode, and stay away from zero at a jump.

All of them take the states of a hybrid system with the discrete metric on modes (Tavernini 1987; Gokhman 2008):

    D((i, x), (j, y)) = |x - y| + [i != j],

states compared by name, one that a mode lacks counting as 0 there: D is a metric also where modes have different
states. A strip's point (z, tau) counts as z in its mode.

========================= =============================================================================================
`sup_norm`                the supremum of D over time
`rho_hat`                 the largest difference of positions at the times one run was sampled at (Burden et al. 2013,
                          Sec. V-B); the paper takes it from Janin and Lamarque to compare with a method that computes
                          no velocities
`skorokhod`               inf over increasing bijections r of the span of max(sup |r(t) - t|, sup D(x(t), y(r(t)))), on
                          right-continuous curves: of several transitions at one instant only the last value counts
                          (Gokhman 2008; Majumdar and Prabhu, HSCC 2015, without a bound on the retiming's slope)
`tau_epsilon`             closeness of hybrid arcs (Goebel, Sanfelice, Teel, *Hybrid Dynamical Systems*, 2012, Section
                          5.3): for every (t, j) of one with t + j <= tau there is (s, j) of the other, with the same j,
                          |t - s| < epsilon and D < epsilon, and the other way round
`profiles`                D and the distance of points as functions of time, for pictures
========================= =============================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsdsl.analysis.metrics.curves import (
    GAP,
    CurveDistance,
    Labelled,
    OnSpace,
    Supremum,
    curve_distance,
    merged,
    no_distance,
)
from hsdsl.analysis.metrics.interval import INFINITE, SAMPLED, Budget, Interval
from hsdsl.analysis.metrics.points import SpaceMetric
from hsdsl.analysis.metrics.trace import ROUNDOFF, Polyline, Trace, names_of, polylines, rounding_of, trace
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine.execution import Array, Execution

EVALUATIONS = 50_000


def sup_norm(a: Execution, b: Execution, gap: float = GAP) -> CurveDistance:
    """Return the supremum over the common time span of D between two runs at the same time, to a relative gap."""
    cells = merged(a, b)
    if cells.same:
        return no_distance(cells, "sup")
    budget = Budget()
    found = Supremum(cells, Labelled(), gap, cells.rounding, EVALUATIONS, budget)
    return curve_distance(found, cells, "sup", gap, budget)


def rho_hat(a: Execution, b: Execution, coordinates: Sequence[str] | None = None) -> CurveDistance:
    """Return the largest |a(t_k) - b(t_k)| over the times t_k of the first run's rows.

    Where either run jumps, left limits are compared with left limits and values with values. ``coordinates`` are the
    position; by default all states that every visited mode has.
    """
    cells = merged(a, b)
    names = cells.a.names
    everywhere = [name for i, name in enumerate(names) if _in_all(cells.a, i) and _in_all(cells.b, i)]
    if coordinates is None:
        if not everywhere:
            raise UsageError("rho-hat compares states that every mode visited has, and these runs have none")
        coordinates = everywhere
    if not coordinates:
        raise UsageError("rho-hat: no coordinates are given", did_you_mean("", everywhere))
    for name in coordinates:
        if name not in names:
            raise UsageError(f"rho-hat: the runs have no state '{name}'", did_you_mean(name, names))
        if name not in everywhere:
            raise UsageError(f"rho-hat: not every mode visited has the state '{name}'")
    columns = np.array([names.index(name) for name in coordinates])
    first, second = cells.sides()
    ours = np.isin(cells.begin, cells.a.start), np.isin(cells.end, cells.a.end)
    if cells.same:
        return no_distance(cells, "rho-hat", SAMPLED)
    largest, time = 0.0, float(cells.begin[0])
    for end, times, chosen in ((0, cells.begin, ours[0]), (1, cells.end, ours[1])):
        difference = (first.at_end(end) - second.at_end(end))[chosen][:, columns]
        apart = np.sqrt(np.sum(difference**2, axis=1))
        if len(apart) and apart.max() > largest:
            largest, time = float(apart.max()), float(times[chosen][int(np.argmax(apart))])
    rounding = float(np.max(first.rounding + second.rounding)) + ROUNDOFF * largest
    interval = Interval(max(0.0, largest - rounding), largest + rounding, SAMPLED)
    return CurveDistance(interval, time, "rho-hat", cells.span, cells.note)


def _in_all(curve: Trace, column: int) -> bool:
    return all(column in columns for _, columns in curve.modes)


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
    # Bound the distance from below by the modes: 1 for other sequences, else the time between switches, at most
    # 1. A retiming that costs less than 1 takes every change of mode to the same change of mode
    (modes_a, times_a), (modes_b, times_b) = _switches(cells.a, span), _switches(cells.b, span)
    lower = max(
        coupled - max(p.reach, q.reach) / 2 - rounding,
        1.0 if modes_a != modes_b else min(1.0, float(np.max(np.abs(times_a - times_b), initial=0.0))),
        0.0,
    )
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


def _switches(curve: Trace, span: tuple[float, float]) -> tuple[list[str], Array]:
    first, last = curve.find(np.array(span))
    modes = np.array([name for name, _ in curve.modes])[curve.mode[first : last + 1]]
    changes = np.flatnonzero(modes[1:] != modes[:-1]) + 1
    return modes[np.append(0, changes)].tolist(), curve.start[first : last + 1][changes]


ARC_RESOLUTION = 2000
PAIRS = 4_000_000  # distances held at once


def tau_epsilon(
    a: Execution, b: Execution, tau: float | None = None, resolution: int = ARC_RESOLUTION
) -> CurveDistance:
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
    tau = min(float(np.max(curve.end + curve.jump)) for curve in curves) if tau is None else tau
    spans = [(float(curve.start[0]), float(curve.end[-1])) for curve in curves]
    p, q = polylines(curves, spans, resolution, cuts=tau)
    found, labels = max(one_way(p, q, tau), one_way(q, p, tau)), other_modes(p, q, tau)
    rounding = rounding_of(*curves) + ROUNDOFF * max(abs(time) for span in spans for time in span)
    reach = max(p.reach, q.reach) / 2 + rounding
    interval = INFINITE if found == np.inf else Interval(max(found - reach, labels, 0.0), max(found + reach, labels))
    note = f"For t + j up to {tau:.10g}, runs by {len(p)} and {len(q)} points, up to {2 * reach:.2g} apart."
    return CurveDistance(interval, None, "tau-epsilon", (0.0, tau), note)


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


POINTS = 1500


class Profile(NamedTuple):
    """Bounds on a distance at n times, two at each breakpoint: of the left limits and of the values."""

    times: Array
    lower: Array
    upper: Array


def profiles(
    a: Execution, b: Execution, metric: SpaceMetric, relaxation: float | None = None, points: int = POINTS
) -> dict[str, Profile]:
    """Return the distance of points and that of states with modes over time, at about ``points`` of the breakpoints.

    Breakpoints next to a transition of either run are always among them.
    """
    cells = merged(a, b)
    jumps = [np.diff(curve.jump[piece]) != 0 for curve, piece in ((cells.a, cells.piece_a), (cells.b, cells.piece_b))]
    near = np.append(jumps[0] | jumps[1], True)
    near[1:] |= near[:-1]
    regular = np.arange(len(cells)) % max(1, len(cells) // points) == 0
    chosen = cells[np.flatnonzero(near | regular)]
    first, second = chosen.sides()
    times = np.stack([chosen.begin, chosen.end], axis=1).ravel()
    found: dict[str, Profile] = {}
    kinds: dict[str, Labelled] = {"rho": OnSpace(metric, relaxation is not None), "sup": Labelled()}
    for name, kind in kinds.items():
        ends = [kind.at(first, second, end, (chosen.begin, chosen.end)[end], 0.0) for end in (0, 1)]
        lower, upper = (np.stack([ends[0][k], ends[1][k]], axis=1).ravel() for k in (0, 1))
        found[name] = Profile(times, lower, upper)
    return found
