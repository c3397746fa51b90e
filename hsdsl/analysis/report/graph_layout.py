"""Places for the boxes and lines of a directed graph: columns by distance from the first box, few crossings in between.

The method is that of Sugiyama, Tagawa and Toda (1981, doi:10.1109/TSMC.1981.4308636): ranks, waypoints where a line
passes a column, and orders within columns by the mean place of neighbours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

GAP, PASSAGE, PORT = 26.0, 18.0, 22.0  # between boxes above each other; height of a passing line; between line ends
CHANNEL, STUB = 90.0, 40.0  # between columns, at least, and how far an arc goes beyond its side
SWEEPS = 12


@dataclass(frozen=True)
class Box:
    """Where a box is: its left upper corner, and its size."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Line:
    """A line from box to box: its points from left or right sides, and whether it arcs back to the side it left."""

    points: tuple[tuple[float, float], ...]
    arc: bool


@dataclass(frozen=True)
class Layout:
    """Boxes and lines in the order given, and the size of the picture."""

    boxes: tuple[Box, ...]
    lines: tuple[Line, ...]
    width: float
    height: float


def laid_out(sizes: Sequence[tuple[float, float]], edges: Sequence[tuple[int, int]], first: int) -> Layout:
    """Place boxes of given (width, height), and a line for each (from, to); ``first`` is in the first column."""
    ranks = _ranks(len(sizes), edges, first)
    paths, columns = _with_waypoints(ranks, edges)
    _order(columns, paths)
    ends = _ends(ranks, edges)
    heights = {v: max(h, PORT * (_most_ends(ends, v) + 1)) for v, (_, h) in enumerate(sizes)}
    tallest = max(sum(heights.get(v, PASSAGE) + GAP for v in column) for column in columns)
    middle: dict[int, float] = {}
    left: dict[int, float] = {}
    x = STUB
    for rank, column in enumerate(columns):
        width = max((sizes[v][0] for v in column if v < len(sizes)), default=0.0)
        y = (tallest - sum(heights.get(v, PASSAGE) + GAP for v in column) + GAP) / 2
        for v in column:
            height = heights.get(v, PASSAGE)
            middle[v], left[v] = y + height / 2, x + (width - sizes[v][0] if v < len(sizes) else width) / 2
            y += height + GAP
        x += width + CHANNEL + 8.0 * sum(min(ranks[a], ranks[b]) == rank for a, b in edges)
    boxes = [Box(left[v], middle[v] - heights[v] / 2, w, heights[v]) for v, (w, _) in enumerate(sizes)]
    lines = _lines(boxes, edges, ranks, paths, middle, left)
    return Layout(tuple(boxes), lines, max(b.x + b.width for b in boxes) + CHANNEL, tallest + GAP)


def _ranks(count: int, edges: Sequence[tuple[int, int]], first: int) -> list[int]:
    """The distance of each box from the first; those that cannot be reached are beyond the last."""
    rank = {first: 0}
    waiting = [first]
    while len(rank) < count:
        while waiting:
            v = waiting.pop(0)
            for a, b in edges:
                if a == v and b not in rank:
                    rank[b] = rank[v] + 1
                    waiting.append(b)
        lost = next((v for v in range(count) if v not in rank), None)
        if lost is not None:
            rank[lost] = max(rank.values()) + 1
            waiting.append(lost)
    return [rank[v] for v in range(count)]


def _with_waypoints(ranks: list[int], edges: Sequence[tuple[int, int]]) -> tuple[list[list[int]], list[list[int]]]:
    """The path of each edge with a waypoint in each column that it passes, and all columns."""
    columns: list[list[int]] = [[] for _ in range(max(ranks) + 1)]
    for v, rank in enumerate(ranks):
        columns[rank].append(v)
    number, paths = len(ranks), list[list[int]]()
    for a, b in edges:
        step = 1 if ranks[b] > ranks[a] else -1
        between = range(ranks[a] + step, ranks[b], step) if ranks[a] != ranks[b] else range(0)
        path = [a]
        for rank in between:
            columns[rank].append(number)
            path.append(number)
            number += 1
        paths.append([*path, b])
    return paths, columns


def _order(columns: list[list[int]], paths: list[list[int]]) -> None:
    """Order each column by the mean place of the neighbours in the column before, and then in the one behind it."""
    neighbours: dict[int, set[int]] = {}
    for path in paths:
        for a, b in pairwise(path):
            neighbours.setdefault(a, set()).add(b)
            neighbours.setdefault(b, set()).add(a)
    for sweep in range(SWEEPS):
        order = range(1, len(columns)) if sweep % 2 == 0 else range(len(columns) - 2, -1, -1)
        for rank in order:
            beside = columns[rank - 1 if sweep % 2 == 0 else rank + 1]
            place = {v: (i + 0.5) / len(beside) for i, v in enumerate(beside)}
            own = {v: (i + 0.5) / len(columns[rank]) for i, v in enumerate(columns[rank])}

            def mean(v: int, place: dict[int, float] = place, own: dict[int, float] = own) -> float:
                near = [place[u] for u in neighbours.get(v, ()) if u in place]
                return sum(near) / len(near) if near else own[v]

            columns[rank].sort(key=mean)


def _ends(ranks: list[int], edges: Sequence[tuple[int, int]]) -> dict[tuple[int, int], int]:
    """How many lines end at each side (-1 left, 1 right) of each box."""
    ends: dict[tuple[int, int], int] = {}
    for a, b in edges:
        for v, side in zip((a, b), _sides(ranks, a, b), strict=True):
            ends[v, side] = ends.get((v, side), 0) + 1
    return ends


def _most_ends(ends: dict[tuple[int, int], int], v: int) -> int:
    return max(ends.get((v, -1), 0), ends.get((v, 1), 0))


def _sides(ranks: list[int], a: int, b: int) -> tuple[int, int]:
    if ranks[a] == ranks[b]:
        return 1, 1
    return (1, -1) if ranks[a] < ranks[b] else (-1, 1)


def _lines(
    boxes: Sequence[Box],
    edges: Sequence[tuple[int, int]],
    ranks: list[int],
    paths: list[list[int]],
    middle: dict[int, float],
    left: dict[int, float],
) -> tuple[Line, ...]:
    """The points of each line: its ends are spread over the sides of boxes, in the order of where they lead."""
    at_side: dict[tuple[int, int], list[tuple[float, int, int]]] = {}
    for k, (a, b) in enumerate(edges):
        sides = _sides(ranks, a, b)
        for end, (v, side) in enumerate(zip((a, b), sides, strict=True)):
            leads_to = paths[k][1 if end == 0 else -2]
            at_side.setdefault((v, side), []).append((middle[leads_to], k, end))
    port: dict[tuple[int, int], tuple[float, float]] = {}
    for (v, side), found in at_side.items():
        box = boxes[v]
        for i, (_, k, end) in enumerate(sorted(found)):
            y = box.y + box.height * (i + 1) / (len(found) + 1)
            port[k, end] = (box.x + (box.width if side > 0 else 0.0), y)
    lines: list[Line] = []
    for k, (a, b) in enumerate(edges):
        passed = [(left[v], middle[v]) for v in paths[k][1:-1]]
        lines.append(Line((port[k, 0], *passed, port[k, 1]), ranks[a] == ranks[b]))
    return tuple(lines)
