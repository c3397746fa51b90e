"""rho-hat: the largest difference of positions at the times one run was sampled at (Burden et al. 2013, Sec. V-B).

The paper takes it from Janin and Lamarque to compare with a method that computes no velocities.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hsdsl.errors import UsageError
from hsdsl.execution import Execution
from hsdsl.metrics.curves import ROUNDOFF, CurveDistance, merged, no_distance, span_note
from hsdsl.metrics.interval import SAMPLED, Interval
from hsdsl.metrics.merge import Cells, common_span
from hsdsl.metrics.trace import Array, Trace
from hsdsl.names import did_you_mean


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
    span = common_span(cells.a, cells.b)
    doubt = float(np.max(first.doubt + second.doubt)) + ROUNDOFF * largest
    interval = Interval(max(0.0, largest - doubt), largest + doubt, SAMPLED)
    return CurveDistance(interval, time, "rho-hat", span, span_note(a, b, span))


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
