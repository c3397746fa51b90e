"""How far apart are two points of the hybrid quotient space, or of the relaxed one?

The distance is the length of the shortest connected curve (Def. 4, 5, 12 and 19): straight pieces inside domains, free
passage between a guard point and its reset image in either direction; on the relaxed space every passage costs the
relaxation and a strip has the metric of Def. 15.
"""

from __future__ import annotations

import numpy as np

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.interval import CERTIFIED, INFINITE, ZERO, Interval
from hsdsl.metrics.neighbours import Neighbours
from hsdsl.metrics.nonaffine import search_nonaffine
from hsdsl.metrics.paths import PathPiece, PointDistance, SpacePoint, answer, coordinates, ends_of, status_of
from hsdsl.metrics.search import End, most_hops, search

__all__ = ["PathPiece", "PointDistance", "SpacePoint", "coordinates", "distance", "distances"]


def distance(
    space: Space,
    p: SpacePoint,
    q: SpacePoint,
    relaxation: float | None = None,
    hops: int | None = None,
    budget: Budget | None = None,
) -> PointDistance:
    """The distance between two points of a space, or with a ``relaxation`` (Def. 19) of its relaxed one.

    Without it a point of a strip counts as its guard point. ``hops`` caps the passages of the compared paths; by
    default at eight more than the fewest that connect the modes. The lower end holds for paths with more, too. When the
    budget is spent, the best that is known is returned.

    Raises ValueError for a place that does not fit: unknown mode or edge, wrong number of states, missing time,
    impossible depth.
    """
    starts, ends = ends_of(space, p, relaxation, False), ends_of(space, q, relaxation, True)
    if p == q:
        return PointDistance(ZERO, (), "certified")
    a, b = starts[0], ends[0]
    if b.mode not in space.fewest(a.mode):
        return PointDistance(INFINITE, (), "certified: no edges connect the modes")
    strip = _along_strip(p, q, a, b, relaxation)
    most, toll, budget = most_hops(space, a.mode, b.mode, hops), relaxation or 0.0, budget or Budget()
    found = search(space, starts, ends, toll, most, strip, budget)
    if not space.affine:
        found = search_nonaffine(space, starts, ends, toll, most, strip, found, budget)
    return answer(space, found, most)


def distances(
    space: Space,
    mode_p: str,
    p: Array,
    mode_q: str,
    q: Array,
    relaxation: float | None = None,
    neighbours: Neighbours | None = None,
    enough: float = 0.0,
    hops: int | None = None,
    budget: Budget | None = None,
) -> tuple[Array, Array, str]:
    """Lower and upper bounds of the distances of N pairs, rows of p and q, in two modes' domains; and their status.

    Columns are the mode's states and, where ``space.timed``, time. Where something is not affine, ``neighbours`` are
    paths of earlier pairs to begin with, and bounds of at most ``enough`` need not be close.
    """
    start, end = _rows(space, mode_p, p, len(p)), _rows(space, mode_q, q, len(p))
    toll, budget = relaxation or 0.0, budget or Budget()
    if end.mode not in space.fewest(start.mode):
        infinite = np.full(len(start.x), np.inf)
        return infinite, infinite, CERTIFIED
    if not space.affine:
        found = (neighbours or Neighbours(space, toll, budget, hops)).bound(start, end, enough)
    else:
        most = most_hops(space, start.mode, end.mode, hops)
        result = search(space, [start], [end], toll, most, np.inf, budget)
        found = np.minimum(result.lower, result.cut), result.upper, status_of(result, most)
    for ends in zip(*(x[found[0] > found[1]] for x in found[:2]), strict=True):
        Interval(*ends)  # which they contradict
    return found


def _rows(space: Space, name: str, x: Array, count: int) -> End:
    try:
        mode = space.mode_index(name)
    except KeyError as error:
        raise ValueError(f"there is no mode {error}") from None
    x, names = np.asarray(x, dtype=float), space.domains[mode].coordinates
    if x.shape != (count, len(names)):
        raise ValueError(f"mode {name}: expected rows of {', '.join(names)}, got shape {x.shape}")
    return End(mode, x)


def _along_strip(p: SpacePoint, q: SpacePoint, a: End, b: End, relaxation: float | None) -> float:
    """The distance inside one strip (Def. 15), inf where the two are not in one."""
    if relaxation is None or p.edge is None or (p.edge, p.mode) != (q.edge, q.mode):
        return np.inf
    return float(np.linalg.norm(a.x - b.x)) + abs(p.depth - q.depth)
