"""Executions as curves of float64: polynomial pieces, two curves cut at the breakpoints of both, and points of them.

Of several transitions at one instant only the last value counts, so arcs that take no time are left out, except for the
value at the very end, which is a last piece of no length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.bernstein import UNIT, degree_raised, length, restrict, sizes
from hsdsl.engine.execution import Array, Execution


@dataclass(frozen=True, eq=False)
class Trace:
    """An execution's n pieces in time order, the last of no length; each other one starts where the one before it ends.

    The w columns are ``names``: states of all modes of all compared curves; 0 where a mode lacks one. ``mode`` indexes
    ``modes``, each a name and the columns of its states. ``jump`` counts the transitions before a piece. ``strip`` is
    the index of the transition that ends a strip, -1 where the state flows, and ``edges`` names each transition's edge.
    ``coefficients`` (n, p + 1, w) are by powers of s in [0, 1]; ``depth`` (n, 2) is that in the strip at start and end.
    """

    names: tuple[str, ...]
    start: Array
    end: Array
    mode: Array
    modes: tuple[tuple[str, tuple[int, ...]], ...]
    jump: Array
    strip: Array
    edges: tuple[str, ...]
    coefficients: Array
    depth: Array

    def __len__(self) -> int:
        return len(self.start)

    def equals(self, other: Trace) -> bool:
        """Whether the two are one curve, number by number."""
        if (self.names, self.modes, len(self)) != (other.names, other.modes, len(other)):
            return False
        names = ("start", "end", "mode", "coefficients", "depth")
        same = (np.array_equal(getattr(self, name), getattr(other, name)) for name in names)
        return all(same) and self._strips() == other._strips()

    def _strips(self) -> list[str]:
        numbers: list[int] = self.strip.tolist()
        return [self.edges[k] if k >= 0 else "" for k in numbers]

    @cached_property
    def rounding(self) -> Array:
        """How far rounding may move any point of each piece that is computed from its coefficients.

        The share of a piece and the shifted polynomial take some 8 p roundings of numbers that add up to no more than
        the coefficients but the first, and p that are added to the first. Where nothing moves nothing is rounded.
        """
        first = np.sqrt(np.sum(self.coefficients[:, 0] ** 2, axis=1))
        added = (self.coefficients.shape[1] + 4) * UNIT * first
        return self.roughness + np.where(self.roughness > 0, added, 0.0)

    @cached_property
    def roughness(self) -> Array:
        """The same for differences of points, to which the first coefficient adds nothing."""
        return (8 * self.coefficients.shape[1] + 16) * UNIT * sizes(self.coefficients[:, 1:])

    def find(self, times: Array) -> Array:
        """Return the piece that begins at or holds each time, seen from the right."""
        return np.searchsorted(self.start, times, side="right") - 1

    def share(self, pieces: Array, times: Array) -> Array:
        """Return the position of each time within its piece, from 0 to 1."""
        length = self.end[pieces] - self.start[pieces]
        passed = times - self.start[pieces]
        return np.where(length > 0, passed / np.where(length > 0, length, 1.0), 0.0)

    def depths(self, pieces: Array, share: Array) -> Array:
        """Return the depth at a share of each piece."""
        ends: Array = self.depth[pieces]
        return ends[:, 0] * (1 - share) + ends[:, 1] * share


def names_of(executions: Sequence[Execution]) -> tuple[str, ...]:
    """Return the states of all executions, each name once."""
    return tuple(dict.fromkeys(name for execution in executions for name in execution.states))


def trace(execution: Execution, names: Sequence[str], instants: bool = False) -> Trace:
    """Make a curve of an execution; ``names`` are the columns, ``instants`` keeps the arcs that take no time."""
    table = execution.arc_table
    times = np.asarray(execution.times, dtype=float)
    arc_of = np.repeat(np.arange(len(execution.arcs)), [arc.last - arc.first + 1 for arc in execution.arcs])
    rows = np.flatnonzero((times[1:] > times[:-1]) & (arc_of[1:] == arc_of[:-1]))
    still = [arc.last for arc in execution.arcs[:-1] if instants and times[arc.first] == times[arc.last]]
    pieces = np.sort(np.concatenate([rows, np.array([*still, len(times) - 1], dtype=int)]))
    followers = pieces + np.isin(pieces, rows)
    arcs = arc_of[pieces]
    layouts = list(dict.fromkeys((arc.mode, arc.states) for arc in execution.arcs))
    mode_of = np.array([layouts.index((arc.mode, arc.states)) for arc in execution.arcs])[arcs]
    waits = table.kind[arcs] == "strip"
    columns = [tuple(names.index(state) for state in states) for _, states in layouts]
    depth = np.asarray(execution.depth, dtype=float)
    # Sort the recorded pieces into columns by name; a strip, and the last value, stay where they are
    degree = max(1, execution.coefficients.shape[1])
    sorted_by_name = np.zeros((len(pieces), degree + 1, len(names)))
    for number, places in enumerate(columns):
        here = np.flatnonzero(mode_of == number)
        moving = here[~waits[here] & (followers[here] > pieces[here])]
        for own, column in enumerate(places):
            values = np.asarray(execution.values[:, own], dtype=float)
            sorted_by_name[here, 0, column] = values[pieces[here]]
            if execution.coefficients.shape[1] == 0:
                sorted_by_name[moving, 1, column] = values[followers[moving]] - values[pieces[moving]]
            else:
                sorted_by_name[moving, 1:, column] = execution.coefficients[pieces[moving], :, own]
    return Trace(
        names=tuple(names),
        start=times[pieces],
        end=times[followers],
        mode=mode_of,
        modes=tuple((mode, place) for (mode, _), place in zip(layouts, columns, strict=True)),
        jump=table.jump[arcs],
        strip=np.where(waits, table.jump[arcs], -1),
        edges=tuple(transition.edge for transition in execution.transitions),
        coefficients=sorted_by_name,
        depth=np.stack([depth[pieces], depth[followers]], axis=1),
    )


ROUNDOFF = 64 * 2.0**-53  # times the largest state: two bounds need not be nearer


@dataclass(frozen=True, eq=False)
class Side:
    """One curve on n cells, each a part of a piece of ``trace``.

    ``powers`` (n, p + 1, w) are its polynomials by powers of u in [0, 1]; ``depth`` (n, 2) is the depth in the strip at
    the cells' ends, 0 where the state flows; ``rounding`` is how far rounding may have moved any point of the curve.
    """

    trace: Trace
    pieces: Array
    powers: Array
    depth: Array
    duration: Array
    rounding: Array

    @property
    def stray(self) -> Array:
        """How much of the length of the control polygon rounding may have hidden: its legs are short of the curve."""
        return 2 * self.powers.shape[1] * self.trace.roughness[self.pieces]

    @property
    def mode(self) -> Array:
        """Name of each cell's mode."""
        return np.array([name for name, _ in self.trace.modes])[self.trace.mode[self.pieces]]

    @property
    def edge(self) -> Array:
        """Edge of the strip that each cell is in, empty where the state flows."""
        return np.array([*self.trace.edges, ""])[self.trace.strip[self.pieces]]

    def at_end(self, end: int) -> Array:
        """Return the states at the cells' left (0) or right (1) ends, shape (n, w)."""
        return self.powers[:, 0] if end == 0 else np.sum(self.powers, axis=1)

    def __getitem__(self, chosen: Array) -> Side:
        arrays = (self.pieces, self.powers, self.depth, self.duration, self.rounding)
        return Side(self.trace, *(array[chosen] for array in arrays))


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of the common time span in which each curve is one polynomial; the ends of a cell belong to it.

    The left end of a cell compares values with values, its right end left limits with left limits. The last cell has no
    length: it compares the values at the very end.
    """

    a: Trace
    b: Trace
    piece_a: Array
    piece_b: Array
    begin: Array
    end: Array

    def __len__(self) -> int:
        return len(self.begin)

    @property
    def _arrays(self) -> tuple[Array, ...]:
        return self.piece_a, self.piece_b, self.begin, self.end

    def __getitem__(self, chosen: Array | slice) -> Cells:
        return Cells(self.a, self.b, *(array[chosen] for array in self._arrays))

    def joined(self, other: Cells) -> Cells:
        """These cells, then others of the same curves."""
        pairs = zip(self._arrays, other._arrays, strict=True)
        return Cells(self.a, self.b, *(np.concatenate(pair) for pair in pairs))

    def halved(self) -> Cells:
        """Cut each cell in two, first halves first."""
        middle = self.begin + (self.end - self.begin) / 2
        return replace(self, end=middle).joined(replace(self, begin=middle))

    @property
    def divisible(self) -> Array:
        """Whether there is a number between the ends of each cell."""
        middle = self.begin + (self.end - self.begin) / 2
        return (middle > self.begin) & (middle < self.end)

    @property
    def same(self) -> bool:
        """Whether both curves are one."""
        return self.a.equals(self.b)

    @cached_property
    def span(self) -> tuple[float, float]:
        """The time span that both curves cover."""
        return common_span(self.a, self.b)

    @property
    def note(self) -> str:
        """A sentence where a curve goes on beyond that."""
        begin, end = self.span
        whole = all((curve.start[0], curve.end[-1]) == self.span for curve in (self.a, self.b))
        return "" if whole else f"Compared from t = {begin:.10g} to {end:.10g}, which both cover."

    @cached_property
    def rounding(self) -> float:
        """How far apart bounds on the two curves may be for rounding alone."""
        return rounding_of(self.a, self.b)

    def sides(self) -> tuple[Side, Side]:
        """Return both curves on the cells, their polynomials of one degree."""
        degree = max(self.a.coefficients.shape[1], self.b.coefficients.shape[1]) - 1
        return self._side(self.a, self.piece_a, degree), self._side(self.b, self.piece_b, degree)

    def _side(self, trace: Trace, pieces: Array, degree: int) -> Side:
        first, last = trace.share(pieces, self.begin), trace.share(pieces, self.end)
        powers = degree_raised(restrict(trace.coefficients[pieces], first, last), degree)
        depth = np.stack([trace.depths(pieces, first), trace.depths(pieces, last)], axis=1)
        return Side(trace, pieces, powers, depth, self.end - self.begin, trace.rounding[pieces])


def rounding_of(*curves: Trace) -> float:
    """Return the largest difference of two bounds on curves that rounding alone explains."""
    largest = max(float(np.max(np.abs(curve.coefficients[:, 0]), initial=0.0)) for curve in curves)
    return ROUNDOFF * largest + 4 * sum(float(np.max(curve.rounding, initial=0.0)) for curve in curves)


def common_span(a: Trace, b: Trace) -> tuple[float, float]:
    """Return the time span that both curves cover; raise :class:`UsageError` without any."""
    begin, end = max(a.start[0], b.start[0]), min(a.end[-1], b.end[-1])
    if begin > end:
        raise UsageError(
            f"the runs have no time in common: one goes from {a.start[0]:.10g} to {a.end[-1]:.10g}, "
            f"the other from {b.start[0]:.10g} to {b.end[-1]:.10g}"
        )
    return float(begin), float(end)


def merge(a: Trace, b: Trace) -> Cells:
    """Cut the common time span of two curves at the breakpoints of both."""
    begin, end = common_span(a, b)
    breaks = np.union1d(a.start, b.start)
    breaks = np.union1d(breaks[(breaks > begin) & (breaks < end)], [begin, end])
    starts, ends = breaks, np.append(breaks[1:], end)
    return Cells(a, b, a.find(starts), b.find(starts), starts, ends)


@dataclass(frozen=True, eq=False)
class Polyline:
    """n points of a curve, the ends of all its continuous parts among them.

    ``label`` numbers the modes, alike for curves made together; ``jump`` counts the transitions before each point;
    ``jumps`` (n - 1,) tells whether the curve jumps to the next point; ``reach`` is the longest way, in time plus
    states, that it flows to a next point.
    """

    times: Array
    states: Array
    label: Array
    jump: Array
    jumps: Array
    reach: float

    def __len__(self) -> int:
        return len(self.times)

    def up_to(self, hybrid_time: float) -> Array:
        """Mark the points with t + j <= a hybrid time."""
        return self.times + self.jump <= hybrid_time


def polylines(
    curves: Sequence[Trace], spans: Sequence[tuple[float, float]], resolution: int, cuts: float | None = None
) -> list[Polyline]:
    """Choose about ``resolution`` points of each curve on a span, evenly along its way in time plus states.

    The ends of continuous parts are added, and the point at the hybrid time ``cuts``, if given.
    """
    numbers = {name: k for k, name in enumerate(dict.fromkeys(m for curve in curves for m, _ in curve.modes))}
    return [_polyline(c, span, resolution, cuts, numbers) for c, span in zip(curves, spans, strict=True)]


def _polyline(
    curve: Trace, span: tuple[float, float], resolution: int, cuts: float | None, numbers: dict[str, int]
) -> Polyline:
    pieces, begin, end, way = _parts(curve, span, resolution, cuts)
    jump = curve.jump[pieces]
    opens = np.append(True, jump[1:] != jump[:-1])  # first part of a continuous one
    total = float(np.sum(way))
    spacing = total / resolution if total > 0 else 1.0
    done = np.cumsum(way)
    group = np.floor((done - way) / spacing)
    first = opens | np.append(True, group[1:] != group[:-1])
    firsts = np.flatnonzero(first)
    lasts = np.append(firsts[1:] - 1, len(pieces) - 1)
    ways = done[lasts] - done[firsts] + way[firsts]
    closes = np.append(opens[1:], True)[lasts]
    order = np.argsort(np.concatenate([np.arange(len(firsts)) * 2, np.flatnonzero(closes) * 2 + 1]), kind="stable")
    at = np.concatenate([firsts, lasts[closes]])[order]
    share = np.concatenate([begin[firsts], end[lasts[closes]]])[order]
    piece = pieces[at]
    powers = restrict(curve.coefficients[piece], np.zeros_like(share), share)
    label = np.array([numbers[name] for name, _ in curve.modes])[curve.mode[piece]]
    jumps = curve.jump[piece]
    return Polyline(
        times=curve.start[piece] + share * (curve.end[piece] - curve.start[piece]),
        states=np.sum(powers, axis=1),
        label=label,
        jump=jumps,
        jumps=jumps[1:] != jumps[:-1],
        reach=float(np.max(ways)),
    )


def _parts(curve: Trace, span: tuple[float, float], resolution: int, cuts: float | None) -> tuple[Array, ...]:
    """Cut the pieces within a span so that none is much longer than a way's share: pieces, ends as shares, ways."""
    whole = np.flatnonzero((curve.end >= span[0]) & (curve.start <= span[1]))
    begin = curve.share(whole, np.maximum(curve.start[whole], span[0]))
    end = np.where(curve.end[whole] > curve.start[whole], curve.share(whole, np.minimum(curve.end[whole], span[1])), 0)
    kept = (end > begin) | (curve.end[whole] == curve.start[whole]) | (curve.start[whole] == span[1])
    whole, begin, end = whole[kept], begin[kept], end[kept]
    way = _way(curve, whole, begin, end)
    count = np.maximum(1, np.ceil(way * resolution / max(float(np.sum(way)), 1e-300))).astype(int)
    if cuts is not None:
        at = curve.share(whole, cuts - curve.jump[whole])
        inside = np.flatnonzero((at > begin) & (at < end))
        whole, begin, end, count = (
            np.insert(whole, inside, whole[inside]),
            np.insert(begin, inside + 1, at[inside]),
            np.insert(end, inside, at[inside]),
            np.insert(count, inside, count[inside]),
        )
    piece = np.repeat(whole, count)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    width, many = np.repeat(end - begin, count), np.repeat(count, count)
    starts, low = np.repeat(begin, count), number / many
    high = (number + 1) / many
    ends = np.where(number + 1 == many, np.repeat(end, count), starts + width * high)
    return piece, starts + width * low, ends, _way(curve, piece, starts + width * low, ends)


def _way(curve: Trace, piece: Array, begin: Array, end: Array) -> Array:
    lasts = (end - begin) * (curve.end[piece] - curve.start[piece])
    return lasts + length(restrict(curve.coefficients[piece], begin, end))
