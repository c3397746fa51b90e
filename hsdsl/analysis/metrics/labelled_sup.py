"""Distances on the space of trajectories, for comparison: they see the mode, and stay away from zero at a jump.

All of them take the states of a hybrid system with the discrete metric on modes (Tavernini 1987; Gokhman 2008):

    D((i, x), (j, y)) = |x - y| + [i != j],

states compared by name, one that a mode lacks counting as 0 there: D is a metric also where modes have different
states. A strip's point (z, tau) counts as z in its mode. rho-hat is the largest difference of positions at the times
one run was sampled at (Burden et al. 2013, Sec. V-B); the paper takes it from Janin and Lamarque to compare with a
method that computes no velocities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.metrics.bernstein import largest_norm, length
from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.curves import GAP, CurveDistance, curve_distance, merged, no_distance
from hsdsl.analysis.metrics.interval import SAMPLED, Interval
from hsdsl.analysis.metrics.merge import ROUNDOFF, Cells, Side
from hsdsl.analysis.metrics.rounding import UNIT
from hsdsl.analysis.metrics.supremum import supremum
from hsdsl.analysis.metrics.trace import Array, Trace
from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine.execution import Execution

EVALUATIONS = 50_000


@dataclass(frozen=True)
class Labelled:
    """The distance D of states with modes."""

    def over(self, a: Side, b: Side) -> Array:
        """Bound by the difference of the two polynomials."""
        return largest_norm(a.powers - b.powers) + (a.mode != b.mode) + a.rounding + b.rounding

    def at(self, a: Side, b: Side, end: int, times: Array, enough: float = 0.0) -> tuple[Array, Array]:
        """Return D, less or more than rounding."""
        difference = a.at_end(end) - b.at_end(end)
        states = np.sqrt(np.sum(difference**2, axis=1))
        apart = states + (a.mode != b.mode)
        rounding = a.rounding + b.rounding + (difference.shape[1] + 4) * UNIT * states
        return np.maximum(0.0, apart - rounding), apart + rounding

    def motion(self, side: Side) -> Array:
        """Bound the way by the length of the control polygon."""
        return length(side.powers) + side.stray


def sup_norm(a: Execution, b: Execution, gap: float = GAP) -> CurveDistance:
    """Return the supremum over the common time span of D between two runs at the same time, to a relative gap."""
    cells = merged(a, b)
    if cells.same:
        return no_distance(cells, "sup")
    budget = Budget()
    found = supremum(cells, Labelled(), gap, cells.rounding, EVALUATIONS, budget)
    return curve_distance(found, cells, "sup", gap, budget)


def rho_hat(a: Execution, b: Execution, coordinates: Sequence[str] | None = None) -> CurveDistance:
    """Return the largest |a(t_k) - b(t_k)| over the times t_k of the first run's rows.

    Where either run jumps, left limits are compared with left limits and values with values. ``coordinates`` are the
    position; by default all states that every visited mode has.
    """
    cells = merged(a, b)
    columns = _columns(cells, coordinates)
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


def _columns(cells: Cells, coordinates: Sequence[str] | None) -> Array:
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
    return np.array([names.index(name) for name in coordinates])


def _in_all(curve: Trace, column: int) -> bool:
    return all(column in columns for _, columns in curve.modes)
