"""How far apart are two points of the hybrid quotient space, or of the relaxed one, and which path attains it?

The distance is the length of the shortest connected curve (Def. 4, 5, 12 and 19): straight pieces inside domains, free
passage between a guard point and its reset image in either direction; on the relaxed space every passage costs the
relaxation and a strip has the metric of Def. 15.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import gate_sequence
from hsdsl.analysis.metrics.geometry import Space
from hsdsl.analysis.metrics.guard_clearance import highest
from hsdsl.analysis.metrics.interval import (
    CERTIFIED,
    INFINITE,
    SAMPLED,
    SEARCHED,
    ZERO,
    Budget,
    Interval,
    up_to_hops,
    weakest,
)
from hsdsl.analysis.metrics.local import Neighbours, Route, search_nonaffine
from hsdsl.analysis.metrics.search import TOLERANCE, End, Query, SearchResult, search
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods
from hsdsl.engine.execution import Array

__all__ = ["PathPiece", "PointDistance", "SpacePoint", "coordinates", "distance", "distances"]

QUICK, SLOW = 50_000, 20_000


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
    strip = (
        np.inf
        if relaxation is None or p.edge is None or (p.edge, p.mode) != (q.edge, q.mode)
        else float(np.linalg.norm(a.x - b.x)) + abs(p.depth - q.depth)
    )
    query = Query(space, starts, ends, relaxation or 0.0, hops, budget or Budget(), strip)
    return answer(space, search(query) if space.affine else search_nonaffine(query), query.most)


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
        query = Query(space, [start], [end], toll, hops, budget)
        result = search(query)
        found = np.minimum(result.lower, result.cut), result.upper, status_of(result, query.most)
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


class ModePoints(NamedTuple):
    """n points of one mode: states (n, d), times, and the edge (else empty) and depth of a strip they are in."""

    mode: str
    x: Array
    t: Array
    edge: Array
    depth: Array


@dataclass(frozen=True)
class SpaceMetric:
    """The distance on M or, with a ``relaxation``, on the relaxed space."""

    space: Space
    relaxation: float | None = None
    budget: Budget = field(default_factory=Budget)
    hops: int | None = None
    _statuses: set[str] = field(default_factory=set[str], repr=False)

    @property
    def status(self) -> str:
        """What all bounds given so far rest on."""
        return weakest(*self._statuses)

    @property
    def timed(self) -> bool:
        """Whether time is a coordinate of the domains."""
        return self.space.timed

    @property
    def evaluations(self) -> int:
        """How many distances a search may take: they are quick where everything is affine, and slow elsewhere."""
        return QUICK if self.space.affine else SLOW

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self.space, self.relaxation or 0.0, self.budget, self.hops)

    def contains(self, mode: str, low: Array, high: Array) -> Array:
        """Whether whole boxes are known to be in a mode's domain, or that domain to be convex."""
        domain = self.space.domains[self.space.mode_index(self._named(mode))]
        inside = np.ones(len(low), dtype=bool)
        for formula in domain.curved:
            inside &= highest(formula, low, high) <= 0
        return inside

    def between(self, p: ModePoints, q: ModePoints, enough: float = 0.0) -> tuple[Array, Array]:
        """Bound the distances of pairs from below and above; bounds of at most ``enough`` need not be close."""
        lower, upper = np.zeros(len(p.t)), np.full(len(p.t), np.inf)
        waits = (p.edge != "") | (q.edge != "")
        flows = np.flatnonzero(~waits)
        if len(flows):
            lower[flows], upper[flows] = self._flowing(p, q, flows, enough)
        for k in np.flatnonzero(waits).tolist():
            ends = self._place(p, k), self._place(q, k)
            found = distance(self.space, *ends, self.relaxation, self.hops, self.budget)
            lower[k], upper[k] = found.interval.lower, found.interval.upper
            self._statuses.add(found.status)
        return lower, upper

    def _flowing(self, p: ModePoints, q: ModePoints, chosen: Array, enough: float) -> tuple[Array, Array]:
        (mode_p, x), (mode_q, y) = ((self._named(e.mode), self._coordinates(e, chosen)) for e in (p, q))
        known = None if self.space.affine else self._neighbours
        where = self.space, mode_p, x, mode_q, y, self.relaxation
        lower, upper, status = distances(*where, known, enough, self.hops, self.budget)
        self._statuses.add(status)
        return lower, upper

    def _named(self, mode: str) -> str:
        if mode not in self.space.modes:
            raise UsageError(f"the model has no mode '{mode}', which a run is in")
        return mode

    def _coordinates(self, points: ModePoints, chosen: Array) -> Array:
        x = points.x[chosen]
        return np.column_stack([x, points.t[chosen]]) if self.timed else x

    def _place(self, points: ModePoints, k: int) -> SpacePoint:
        x, edge = tuple(points.x[k].tolist()), str(points.edge[k]) or None
        depth = min(float(points.depth[k]), self.relaxation or 0.0)
        return SpacePoint(points.mode, x, edge, depth, float(points.t[k]) if self.timed else None)


ROUNDING = 16 * 2.0**-53  # of a few sums, relative to themselves
CLOSED = 1e-9  # relative: such a gap counts as none


@checks_methods
@dataclass(frozen=True)
class SpacePoint:
    """A point of a mode's domain, or, with ``edge``, of that edge's strip at a depth from 0 to the relaxation.

    ``x`` has the mode's states in file order; in a strip, those of the guard point. ``t`` is the time, if it is a
    coordinate.
    """

    mode: str
    x: tuple[float, ...]
    edge: str | None = None
    depth: float = 0.0
    t: float | None = None


@dataclass(frozen=True)
class PathPiece:
    """A straight piece of a path in one mode, and the passage after it (``edge``; None at the end and at a bend)."""

    mode: str
    start: tuple[float, ...]
    end: tuple[float, ...]
    edge: str | None = None
    forward: bool = True


@dataclass(frozen=True)
class PointDistance:
    """A distance with the path that attains its upper end, and a sentence about its certified part."""

    interval: Interval
    path: tuple[PathPiece, ...]
    certified: str

    @property
    def status(self) -> str:
        """The kind of proof of the interval (see :class:`Interval`)."""
        return self.interval.status

    @property
    def sentence(self) -> str:
        """The distance and its path, for a person."""
        if self.interval.lower == np.inf:
            return f"inf ({self.certified})"
        lines = [f"{self.interval.upper:.10g}, in {self.interval} ({self.certified})"]
        for piece in self.path:
            start, end = (", ".join(f"{v:.6g}" for v in x) for x in (piece.start, piece.end))
            backwards = "" if piece.forward else " backwards"
            passage = "" if piece.edge is None else f", then {piece.edge}{backwards}"
            lines.append(f"  {piece.mode}: ({start}) to ({end}){passage}")
        return "\n".join(lines)


def ends_of(space: Space, place: SpacePoint, relaxation: float | None, is_end: bool) -> list[End]:
    """The ways a path can end at a place: in its domain, or bound to go on through its strip."""
    mode, values = coordinates(space, place)
    x = values[None]
    if place.edge is None or relaxation is None:
        return [End(mode, x)]
    if not 0 <= place.depth <= relaxation:
        raise ValueError(f"the depth in a strip lies between 0 and {relaxation}, not {place.depth}")
    gates = [i for i, g in enumerate(space.gates) if g.edge == place.edge and g.source == mode]
    if not gates and not any(c.edge == place.edge and c.source == mode for c in space.curved_gates):
        raise ValueError(f"mode {place.mode} has no edge '{place.edge}' with a guard")
    on = [End(mode, x, -place.depth, 2 * i + is_end) for i in gates]
    return [End(mode, x, place.depth), *on]


def coordinates(space: Space, place: SpacePoint) -> tuple[int, Array]:
    """A place's mode and coordinates."""
    try:
        mode = space.mode_index(place.mode)
    except KeyError:
        raise ValueError(f"there is no mode '{place.mode}'") from None
    values = tuple(place.x)
    if space.timed:
        if place.t is None:
            raise ValueError("time is a coordinate here (a guard or reset depends on it): give t")
        values += (place.t,)
    names = space.domains[mode].coordinates
    if len(values) != len(names):
        raise ValueError(f"mode {place.mode} has the coordinates {', '.join(names)}, not {len(values)} numbers")
    return mode, np.array(values, dtype=float)


def answer(space: Space, found: SearchResult, hops: int) -> PointDistance:
    lower, upper = float(np.max(np.minimum(found.lower, found.cut))), float(np.max(found.upper))
    if lower == upper == np.inf and not found.local:
        return PointDistance(INFINITE, (), "certified: no path of passages connects the two")
    status = status_of(found, hops)
    interval = Interval(lower * (1 - ROUNDING), upper * (1 + ROUNDING), status)
    return PointDistance(interval, _path(space, found), _sentence(found, status))


def status_of(found: SearchResult, hops: int) -> str:
    """What the bounds of a search rest on."""
    if not found.local:
        return up_to_hops(hops) if np.any(found.cut < found.upper * (1 - TOLERANCE)) else CERTIFIED
    if found.upper > found.lower * (1 + CLOSED):
        return SEARCHED
    return CERTIFIED if found.proved else SAMPLED


def _sentence(found: SearchResult, status: str) -> str:
    if found.local:
        if found.upper == np.inf:
            return "lower end certified; no path was found, though one may exist"
        unproved = "" if found.proved else "; that it stays in its domains was examined in points, not proved"
        if found.upper > found.lower * (1 + CLOSED):
            early = ", ended early for want of time" if found.ended_early else ""
            return f"upper end: the best path that local solves found{early}; lower end certified, not tight{unproved}"
        return f"certified{unproved}"
    early = ", with a wide gap: the search ended early" if found.ended_early else ""
    return f"certified{early}" if status == CERTIFIED else f"certified {status}{early}"


def _path(space: Space, found: SearchResult) -> tuple[PathPiece, ...]:
    if found.through is not None:
        route: Route = found.through
        passed = [(c.edge, c.forward) for c in route.sequence]
        legs = zip(route.legs(found.unknowns), [*passed, (None, True)], strict=True)
        return tuple(_piece(space, *leg, *by) for leg, by in legs)
    if found.start is None or found.end is None:
        return ()
    at, mode = found.start.x[0], found.start.mode
    pieces: list[PathPiece] = []
    if found.sequence:
        chain = gate_sequence(space, found.sequence)
        for passage, (enter, leave) in zip(chain.passages, chain.sides(found.unknowns), strict=True):
            pieces.append(_piece(space, mode, at, enter, passage.gate.edge, passage.forward))
            at, mode = leave, passage.target
    return (*pieces, _piece(space, mode, at, found.end.x[0]))


def _piece(
    space: Space, mode: int, start: Array, end: Array, edge: str | None = None, forward: bool = True
) -> PathPiece:
    return PathPiece(space.modes[mode], tuple(start.tolist()), tuple(end.tolist()), edge, forward)
