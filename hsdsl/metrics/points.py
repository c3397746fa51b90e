"""How far apart are two points of the hybrid quotient space, or of the relaxed one?

The distance is the length of the shortest connected curve (Def. 4, 5, 12 and 19): straight pieces inside domains, free
passage between a guard point and its reset image in either direction; on the relaxed space every passage costs the
relaxation and a strip has the metric of Def. 15.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsdsl.metrics.chain import chain_of
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.interval import INFINITE, ZERO, Interval
from hsdsl.metrics.local import search_locally
from hsdsl.metrics.many import Pairs, around_guards, search_many
from hsdsl.metrics.routes import straight_inside
from hsdsl.metrics.search import HOPS, End, Found, search

ROUNDING = 16 * 2.0**-53  # relative to the size of the numbers


@dataclass(frozen=True)
class Place:
    """A point: of a mode's domain or, with ``edge``, of that edge's strip at a depth from 0 to the relaxation.

    ``x`` are the mode's states in file order; in a strip, the guard point's. ``t`` where time is a coordinate.
    """

    mode: str
    x: tuple[float, ...]
    edge: str | None = None
    depth: float = 0.0
    t: float | None = None


@dataclass(frozen=True)
class Piece:
    """A straight piece of a path inside one mode, and the passage after it (``edge``, or None at the end)."""

    mode: str
    start: tuple[float, ...]
    end: tuple[float, ...]
    edge: str | None = None
    forward: bool = True


@dataclass(frozen=True)
class PointDistance:
    """A distance with the path that attains its upper end, and what is certified of it, in words."""

    interval: Interval
    path: tuple[Piece, ...]
    certified: str

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


def distance(
    space: Space, p: Place, q: Place, relaxation: float | None = None, hops: int | None = None
) -> PointDistance:
    """The distance between two points.

    Parameters
    ----------
    space : Space
        The model's.
    p, q : Place
        The points; both of the same kind of space.
    relaxation : float, optional
        The relaxed metric's (Def. 19); without it, the quotient metric's (Def. 12), in which a point of a strip counts
        as its guard point.
    hops : int, optional
        The most passages of the paths compared.

    Raises
    ------
    ValueError
        A place does not fit the space: unknown mode or edge, wrong number of states, missing time, impossible depth.
    """
    starts, ends = ends_of(space, p, relaxation, False), ends_of(space, q, relaxation, True)
    if p == q:
        return PointDistance(ZERO, (), "certified")
    a, b = starts[0], ends[0]
    if space.components[a.mode] != space.components[b.mode]:
        return PointDistance(INFINITE, (), "certified: no edges connect the modes")
    strip = _along_strip(p, q, a, b, relaxation)
    most, toll = HOPS if hops is None else hops, relaxation or 0.0
    found = search(space, starts, ends, toll, most, strip)
    if not space.affine:
        found = _beyond_affine(space, starts, ends, toll, most, strip, found)
    return _answer(space, found, a, b, most)


def distances(
    space: Space, mode_p: str, p: Array, mode_q: str, q: Array, relaxation: float | None = None
) -> tuple[Array, Array]:
    """The distances of many pairs of points in the same two modes' domains.

    Parameters
    ----------
    space : Space
        The model's.
    mode_p, mode_q : str
        The modes.
    p, q : (N, n) arrays
        The pairs, a row each; the columns are the mode's states and, where ``space.timed``, time.
    relaxation : float, optional
        The relaxed metric's.

    Returns
    -------
    lower, upper : (N,) arrays
        Bounds; of paths with up to eight passages where no cap can be proved.
    """
    pairs = _pairs(space, mode_p, p, mode_q, q, relaxation)
    if space.components[pairs.source] != space.components[pairs.target]:
        pairs.lower = pairs.upper = np.full(len(pairs.p), np.inf)
    elif space.affine:
        search_many(pairs, HOPS)
    else:
        _one_by_one(pairs, relaxation)
    return pairs.widened()


def _one_by_one(pairs: Pairs, relaxation: float | None) -> None:
    names = pairs.space.modes[pairs.source], pairs.space.modes[pairs.target]
    least = pairs.least()
    for k, (p, q) in enumerate(zip(pairs.p.tolist(), pairs.q.tolist(), strict=True)):
        if pairs.source == pairs.target and straight_inside(pairs.space, pairs.source, pairs.p[k], pairs.q[k]):
            pairs.lower[k] = least[k]  # the straight line is a path; what shortens it is not looked for here
            continue
        found = distance(pairs.space, _place(pairs.space, names[0], p), _place(pairs.space, names[1], q), relaxation)
        pairs.lower[k], pairs.upper[k] = found.interval.lower, found.interval.upper


def _place(space: Space, mode: str, values: list[float]) -> Place:
    return Place(mode, tuple(values[:-1]), t=values[-1]) if space.timed else Place(mode, tuple(values))


def quick_bounds(
    space: Space, mode_p: str, p: Array, mode_q: str, q: Array, relaxation: float | None = None
) -> tuple[Array, Array]:
    """Cheap valid bounds on :func:`distances`, with the same parameters.

    Above: the straight line in a convex domain. Below: what no passage changes, and the way to the nearest guards.
    """
    pairs = _pairs(space, mode_p, p, mode_q, q, relaxation)
    if space.components[pairs.source] != space.components[pairs.target]:
        pairs.lower = pairs.upper = np.full(len(pairs.p), np.inf)
        return pairs.lower, pairs.upper
    pairs.lower = np.maximum(pairs.least(), np.minimum(pairs.lower, around_guards(pairs)))
    if not space.domains[pairs.source].convex:
        pairs.upper = np.full(len(pairs.p), np.inf)
    return pairs.widened()


def _pairs(space: Space, mode_p: str, p: Array, mode_q: str, q: Array, relaxation: float | None) -> Pairs:
    try:
        source, target = space.mode_index(mode_p), space.mode_index(mode_q)
    except KeyError as error:
        raise ValueError(f"there is no mode {error}") from None
    p, q = np.asarray(p, dtype=float), np.asarray(q, dtype=float)
    for values, mode in ((p, source), (q, target)):
        names = space.domains[mode].coordinates
        if values.shape != (len(p), len(names)):
            raise ValueError(f"mode {space.modes[mode]}: rows of {', '.join(names)} are wanted, not {values.shape}")
    return Pairs.of(space, source, p, target, q, relaxation)


def ends_of(space: Space, place: Place, relaxation: float | None, is_end: bool) -> list[End]:
    """The ways a path can end at a place: in its domain, or bound to go on through its strip."""
    mode, x = coordinates(space, place)
    if place.edge is None or relaxation is None:
        return [End(mode, x)]
    if not 0 <= place.depth <= relaxation:
        raise ValueError(f"the depth in a strip lies between 0 and {relaxation}, not {place.depth}")
    gates = [i for i, g in enumerate(space.gates) if g.edge == place.edge and g.source == mode]
    if not gates and not any(c.edge == place.edge and c.source == mode for c in space.curved_gates):
        raise ValueError(f"mode {place.mode} has no edge '{place.edge}' with a guard")
    on = [End(mode, x, -place.depth, 2 * i + is_end) for i in gates]
    return [End(mode, x, place.depth), *on]


def coordinates(space: Space, place: Place) -> tuple[int, Array]:
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


def _along_strip(p: Place, q: Place, a: End, b: End, relaxation: float | None) -> float:
    """The distance inside one strip (Def. 15), inf where the two are not in one."""
    if relaxation is None or p.edge is None or (p.edge, p.mode) != (q.edge, q.mode):
        return np.inf
    return float(np.linalg.norm(a.x - b.x)) + abs(p.depth - q.depth)


def _beyond_affine(
    space: Space, starts: list[End], ends: list[End], toll: float, hops: int, strip: float, outer: Found
) -> Found:
    """Keep what the affine part bounds from below, and find a path.

    The search through polyhedra is a relaxation of every path without a curved guard; paths through one are bounded by
    what no passage changes.
    """
    lower = min(outer.lower, outer.upper, outer.cut)
    if space.curved_gates:
        least = min(
            unchanged(space, a.mode, a.x, b.mode, b.x) + max(0.0, a.cost + b.cost) for a in starts for b in ends
        )
        lower = min(lower, least + (0.0 if any(a.bound is not None for a in (*starts, *ends)) else toll))
    found = search_locally(space, starts, ends, toll, hops, strip, lower)
    found.lower, found.local = lower, True
    return found


def unchanged(space: Space, mode_p: int, p: Array, mode_q: int, q: Array) -> float:
    """The distance in the coordinates that no passage changes."""
    if space.kept is None:
        return 0.0
    return float(np.linalg.norm(p[list(space.kept[mode_p])] - q[list(space.kept[mode_q])]))


def _answer(space: Space, found: Found, a: End, b: End, hops: int) -> PointDistance:
    upper, lower = found.upper, min(found.lower, found.upper)
    if upper == np.inf and not found.local and found.cut == np.inf and not found.ended_early:
        return PointDistance(INFINITE, (), "certified: no path of passages connects the two")
    rounding = ROUNDING * float(np.abs(a.x).sum() + np.abs(b.x).sum() + 2 * (0 if upper == np.inf else upper))
    interval = Interval(max(0.0, lower - rounding), upper + rounding)
    return PointDistance(interval, _path(space, found), _sentence(found, hops))


def _sentence(found: Found, hops: int) -> str:
    if found.local and found.upper == np.inf:
        return "lower end certified; no path was found, though one may exist"
    if found.local and found.upper > found.lower * (1 + 1e-9):
        return "upper end: the best path that local solves found; lower end certified, not tight"
    if found.ended_early:
        return "certified, with a wide gap: the search ended early"
    if found.cut < np.inf:
        return f"certified up to {hops} hops"
    return "certified"


def _path(space: Space, found: Found) -> tuple[Piece, ...]:
    if found.start is None or found.end is None:
        return ()
    if found.legs:
        passed = [*found.route, (None, True)]
        return tuple(_piece(space, *leg, *by) for leg, by in zip(found.legs, passed, strict=True))
    at, mode = found.start.x, found.start.mode
    pieces: list[Piece] = []
    if found.sequence:
        chain = chain_of(space, found.sequence)
        for passage, (enter, leave) in zip(chain.passages, chain.sides(found.unknowns), strict=True):
            pieces.append(_piece(space, mode, at, enter, passage.gate.edge, passage.forward))
            at, mode = leave, passage.target
    return (*pieces, _piece(space, mode, at, found.end.x))


def _piece(space: Space, mode: int, start: Array, end: Array, edge: str | None = None, forward: bool = True) -> Piece:
    return Piece(space.modes[mode], tuple(start.tolist()), tuple(end.tolist()), edge, forward)
