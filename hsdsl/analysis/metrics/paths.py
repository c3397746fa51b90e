"""What a distance between points is of, and what it is: places, and the path that attains the upper end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import gate_sequence
from hsdsl.analysis.metrics.geometry import Array, Space
from hsdsl.analysis.metrics.interval import CERTIFIED, INFINITE, SAMPLED, SEARCHED, Interval, up_to_hops
from hsdsl.analysis.metrics.routes import Route
from hsdsl.analysis.metrics.search import TOLERANCE, End, SearchResult
from hsdsl.base.names import checks_methods

ROUNDING = 16 * 2.0**-53  # of a few sums, relative to themselves
CLOSED = 1e-9  # relative: such a gap counts as none


@checks_methods
@dataclass(frozen=True)
class SpacePoint:
    """A point: of a mode's domain or, with ``edge``, of that edge's strip at a depth from 0 to the relaxation.

    ``x`` are the mode's states in file order; in a strip, the guard point's. ``t`` where time is a coordinate.
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
    """A distance with the path that attains its upper end, and what is certified of it, in words."""

    interval: Interval
    path: tuple[PathPiece, ...]
    certified: str

    @property
    def status(self) -> str:
        """What the interval rests on, see :class:`Interval`."""
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
    """The answer to a search for one distance."""
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
        return _of_local_solves(found)
    early = ", with a wide gap: the search ended early" if found.ended_early else ""
    return f"certified{early}" if status == CERTIFIED else f"certified {status}{early}"


def _of_local_solves(found: SearchResult) -> str:
    if found.upper == np.inf:
        return "lower end certified; no path was found, though one may exist"
    unproved = "" if found.proved else "; that it stays in its domains was looked at in points, not proved"
    if found.upper > found.lower * (1 + CLOSED):
        early = ", ended early for want of time" if found.ended_early else ""
        return f"upper end: the best path that local solves found{early}; lower end certified, not tight{unproved}"
    return f"certified{unproved}"


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
