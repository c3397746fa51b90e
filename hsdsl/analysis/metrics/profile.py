"""A distance of curves as a function of time, at the breakpoints of both: what a picture shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.metrics.curves import merged
from hsdsl.analysis.metrics.labelled_sup import Labelled
from hsdsl.analysis.metrics.on_space import OnSpace
from hsdsl.analysis.metrics.points import SpaceMetric
from hsdsl.analysis.metrics.supremum import CellDistance
from hsdsl.engine.execution import Array, Execution

POINTS = 1500


@dataclass(frozen=True, eq=False)
class Profile:
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
    kinds: dict[str, CellDistance] = {"rho": OnSpace(metric, relaxation is not None), "sup": Labelled()}
    for name, kind in kinds.items():
        ends = [kind.at(first, second, end, (chosen.begin, chosen.end)[end], 0.0) for end in (0, 1)]
        lower, upper = (np.stack([ends[0][k], ends[1][k]], axis=1).ravel() for k in (0, 1))
        found[name] = Profile(times, lower, upper)
    return found
