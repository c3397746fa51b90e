"""A curve by points on it, close enough to say how far it strays between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.metrics.bernstein import length, restrict
from hsdsl.analysis.metrics.trace import Array, Trace


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


@dataclass(frozen=True, eq=False)
class _Parts:
    piece: Array
    begin: Array  # share of the piece
    end: Array
    way: Array


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
    parts = _parts(curve, span, resolution, cuts)
    jump = curve.jump[parts.piece]
    opens = np.append(True, jump[1:] != jump[:-1])  # first part of a continuous one
    total = float(np.sum(parts.way))
    spacing = total / resolution if total > 0 else 1.0
    done = np.cumsum(parts.way)
    group = np.floor((done - parts.way) / spacing)
    first = opens | np.append(True, group[1:] != group[:-1])
    firsts = np.flatnonzero(first)
    lasts = np.append(firsts[1:] - 1, len(parts.piece) - 1)
    ways = done[lasts] - done[firsts] + parts.way[firsts]
    closes = np.append(opens[1:], True)[lasts]
    order = np.argsort(np.concatenate([np.arange(len(firsts)) * 2, np.flatnonzero(closes) * 2 + 1]), kind="stable")
    at = np.concatenate([firsts, lasts[closes]])[order]
    share = np.concatenate([parts.begin[firsts], parts.end[lasts[closes]]])[order]
    piece = parts.piece[at]
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


def _parts(curve: Trace, span: tuple[float, float], resolution: int, cuts: float | None) -> _Parts:
    """Cut the pieces within a span so that none is much longer than a way's share."""
    whole = np.flatnonzero((curve.end >= span[0]) & (curve.start <= span[1]))
    begin = curve.share(whole, np.maximum(curve.start[whole], span[0]))
    end = np.where(curve.end[whole] > curve.start[whole], curve.share(whole, np.minimum(curve.end[whole], span[1])), 0)
    kept = (end > begin) | (curve.end[whole] == curve.start[whole]) | (curve.start[whole] == span[1])
    whole, begin, end = whole[kept], begin[kept], end[kept]
    way = _way(curve, whole, begin, end)
    count = np.maximum(1, np.ceil(way * resolution / max(float(np.sum(way)), 1e-300))).astype(int)
    if cuts is not None:
        whole, begin, end, count = _cut(curve, whole, begin, end, count, cuts)
    piece = np.repeat(whole, count)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    width, many = np.repeat(end - begin, count), np.repeat(count, count)
    starts, low = np.repeat(begin, count), number / many
    high = (number + 1) / many
    ends = np.where(number + 1 == many, np.repeat(end, count), starts + width * high)
    return _Parts(piece, starts + width * low, ends, _way(curve, piece, starts + width * low, ends))


def _cut(
    curve: Trace, whole: Array, begin: Array, end: Array, count: Array, cuts: float
) -> tuple[Array, Array, Array, Array]:
    """Cut the pieces that hold a hybrid time in two there."""
    at = curve.share(whole, cuts - curve.jump[whole])
    inside = np.flatnonzero((at > begin) & (at < end))
    return (
        np.insert(whole, inside, whole[inside]),
        np.insert(begin, inside + 1, at[inside]),
        np.insert(end, inside, at[inside]),
        np.insert(count, inside, count[inside]),
    )


def _way(curve: Trace, piece: Array, begin: Array, end: Array) -> Array:
    lasts = (end - begin) * (curve.end[piece] - curve.start[piece])
    return lasts + length(restrict(curve.coefficients[piece], begin, end))
