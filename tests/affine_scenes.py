"""Random affine models in exact numbers, ways to write each in other units, and distances on them by brute force.

Nothing is shared with `hsdsl.analysis.metrics`: guards are clipped in rationals, paths are searched for on a graph of sampled
guard points and then drawn tight, window by window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

SAMPLES = 40  # of a guard
Vector = tuple[Fraction, ...]
Row = tuple[Vector, Fraction]  # normal . x <= level


@dataclass(frozen=True)
class Edge:
    """A guard normal . x = level, where ``conditions`` hold, glued by x -> matrix x + offset."""

    source: int
    target: int
    normal: Vector
    level: Fraction
    conditions: tuple[Row, ...]
    matrix: tuple[Vector, ...]
    offset: Vector


@dataclass(frozen=True)
class Scene:
    """Modes of some sizes inside walls, and the edges between them."""

    sizes: tuple[int, ...]
    walls: tuple[tuple[Row, ...], ...]
    edges: tuple[Edge, ...]

    def rows(self, mode: int) -> list[Row]:
        """What holds in a domain: walls, and surfaces without conditions."""
        own = [(e.normal, e.level) for e in self.edges if e.source == mode and not e.conditions]
        return [*self.walls[mode], *own]


def dot(a, b):
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def rational(rng, low, high, denominator=60):
    return Fraction(int(rng.integers(round(low * denominator), round(high * denominator) + 1)), denominator)


def direction(rng, size):
    while True:
        found = tuple(rational(rng, -1, 1, 7) for _ in range(size))
        if any(found):
            return found


def random_scene(rng, dimensions=(1, 2), modes=3, edges=4, conditions=0.3, walled=0.8) -> Scene:
    """Boxes of half width 2 to 4 as domains, cut by guards near their middle; some domains have no walls."""
    sizes = tuple(int(n) for n in rng.choice(dimensions, size=int(rng.integers(1, modes + 1))))
    walls = []
    for size in sizes:
        box = []
        if rng.random() < walled:
            for i in range(size):
                unit = tuple(Fraction(int(i == j)) for j in range(size))
                box.append((unit, rational(rng, 2, 4)))
                box.append((tuple(-v for v in unit), rational(rng, 2, 4)))
        walls.append(tuple(box))
    made = []
    for _ in range(int(rng.integers(1, edges + 1))):
        source, target = (int(k) for k in rng.integers(len(sizes), size=2))
        n, m = sizes[source], sizes[target]
        given = ()
        if rng.random() < conditions:
            given = ((direction(rng, n), rational(rng, 0, 1)),)
        scale = rational(rng, 0.2, 2)
        if n == m and rng.random() < 0.5:
            matrix = tuple(tuple(scale * (i == j) for j in range(n)) for i in range(m))
        else:
            matrix = tuple(tuple(rational(rng, -1, 1, 5) for _ in range(n)) for _ in range(m))
        offset = tuple(rational(rng, -1, 1) for _ in range(m))
        made.append(Edge(source, target, direction(rng, n), rational(rng, 0.1, 2), given, matrix, offset))
    return Scene(sizes, tuple(walls), tuple(made))


REACH = 4  # half width of glued boxes
STRETCHES = {"contracting": (0.3, 0.9), "isometric": (1, 1), "expanding": (1.1, 1.9)}


def glued_boxes(rng, modes: int, stretch: str) -> Scene:
    """Boxes in the plane, a segment on the right side of each glued onto a line x = const of some box."""
    one, zero = Fraction(1), Fraction(0)
    sides = tuple(((x, y), Fraction(REACH)) for x, y in ((-one, zero), (zero, one), (zero, -one)))
    made = []
    for source in range(modes):
        low, high = sorted(rational(rng, -2, 2) for _ in range(2))
        factor = rational(rng, *STRETCHES[stretch]) * int(rng.choice((-1, 1)))
        target = int(rng.integers(modes)) if source else int(modes > 1)
        given = (((zero, one), high), ((zero, -one), -low))
        matrix, offset = ((zero, zero), (zero, factor)), (rational(rng, -3, 3), zero)
        made.append(Edge(source, target, (one, zero), Fraction(REACH), given, matrix, offset))
    return Scene((2,) * modes, (sides,) * modes, tuple(made))


def random_point(rng, scene):
    """A mode and a point of its domain (the middle 0 always is one)."""
    mode = int(rng.integers(len(scene.sizes)))
    for _ in range(50):
        x = tuple(rational(rng, -3, 3, 997) for _ in range(scene.sizes[mode]))
        if all(dot(n, x) <= d for n, d in scene.rows(mode)):
            return mode, x
    return mode, (Fraction(0),) * scene.sizes[mode]


@dataclass(frozen=True)
class Units:
    """A way to write a scene: lengths times ``length``, modes moved by ``shift``, inequalities times ``factors``."""

    length: Fraction = Fraction(1)
    shift: Fraction = Fraction(0)
    factors: tuple[Fraction, ...] = (Fraction(1),)

    def moved(self, scene: Scene, mode: int) -> Vector:
        """Where a mode's origin goes: another way in every coordinate."""
        return tuple(self.shift * Fraction(2 * (i + mode) % 5 - 2, 1 + i) for i in range(scene.sizes[mode]))

    def point(self, scene: Scene, mode: int, x: Vector) -> Vector:
        return tuple(self.length * v + d for v, d in zip(x, self.moved(scene, mode), strict=True))

    def row(self, scene: Scene, mode: int, row: Row, number: int) -> Row:
        normal, level = row
        factor = self.factors[number % len(self.factors)]
        level = self.length * level + dot(normal, self.moved(scene, mode))
        return tuple(factor * v for v in normal), factor * level

    def write(self, scene: Scene) -> Scene:
        walls = tuple(
            tuple(self.row(scene, mode, row, i) for i, row in enumerate(rows)) for mode, rows in enumerate(scene.walls)
        )
        edges = []
        for number, e in enumerate(scene.edges):
            normal, level = self.row(scene, e.source, (e.normal, e.level), number)
            given = tuple(self.row(scene, e.source, row, number + 1) for row in e.conditions)
            back = self.moved(scene, e.source)
            onto = self.moved(scene, e.target)
            offset = tuple(
                self.length * b + d - dot(row, back) for row, b, d in zip(e.matrix, e.offset, onto, strict=True)
            )
            edges.append(replace(e, normal=normal, level=level, conditions=given, offset=offset))
        return Scene(scene.sizes, walls, tuple(edges))


TEN = Fraction(10)
UNITS = (
    Units(),
    Units(length=TEN**-12),
    Units(length=TEN**12, factors=(TEN**-6, TEN**3)),
    Units(length=TEN**-9, factors=(TEN**5,)),
    Units(factors=(TEN**-13, TEN**-15)),
    Units(factors=(TEN**9, TEN**-9, Fraction(1, 3))),
    Units(shift=TEN**6 * 2 + Fraction(1, 3), factors=(Fraction(1), TEN**5)),
    Units(length=TEN**-6, shift=TEN**-3, factors=(TEN**7, Fraction(3, 7))),
)


def text_of(scene: Scene) -> str:
    """The model as a file; the flow is an input's, so that no condition follows from it."""
    lines = ["hsdsl: 1", "inputs: {u: sin(t)}", "modes:"]
    for mode, size in enumerate(scene.sizes):
        lines.append(f"  m{mode}:")
        lines.append(f"    flow: {{{', '.join(f'x{i}: u' for i in range(size))}}}")
        if scene.walls[mode]:
            lines.append("    domain:")
            lines += [f"      - {_sum(normal)} <= {level}" for normal, level in scene.walls[mode]]
        own = [(k, e) for k, e in enumerate(scene.edges) if e.source == mode]
        if own:
            lines.append("    transitions:")
        for k, e in own:
            lines += [f"      - name: e{k}", f"        when: {_sum(e.normal)} >= {e.level}", f"        to: m{e.target}"]
            if e.conditions:
                lines.append("        if: " + " and ".join(f"{_sum(n)} <= {d}" for n, d in e.conditions))
            lines.append("        reset:")
            lines += [
                f"          x{i}: {_sum(row)} + {b}" for i, (row, b) in enumerate(zip(e.matrix, e.offset, strict=True))
            ]
    start = ", ".join(f"x{i}: 0" for i in range(scene.sizes[0]))
    return "\n".join([*lines, f"initial: {{mode: m0, {start}}}", "experiment: {until: 1}", ""])


def _sum(row: Vector) -> str:
    return " + ".join(f"({v})*x{i}" for i, v in enumerate(row))


def guard_of(scene: Scene, e: Edge) -> tuple[np.ndarray, np.ndarray] | None:
    """A guard of a mode of one or two states as a segment's two ends, None where empty; cut at 20 if it has no end."""
    image = [
        (tuple(dot(n, column) for column in zip(*e.matrix, strict=True)), d - dot(n, e.offset))
        for n, d in scene.rows(e.target)
    ]
    size = dot(e.normal, e.normal)
    if not size:
        return None
    base = tuple(v * e.level / size for v in e.normal)
    along = () if len(base) == 1 else (-e.normal[1], e.normal[0])
    low, high = Fraction(-20), Fraction(20)
    for normal, level in [*scene.rows(e.source), *e.conditions, *image]:
        slope, rest = (dot(normal, along) if along else Fraction(0)), level - dot(normal, base)
        if not slope:
            if rest < 0:
                return None
        elif slope > 0:
            high = min(high, rest / slope)
        else:
            low = max(low, rest / slope)
    if low > high:
        return None
    ends = [tuple(b + (t * a if along else 0) for b, a in zip(base, along or base, strict=True)) for t in (low, high)]
    return np.array(ends[0], dtype=float), np.array(ends[1], dtype=float)


class BruteForce:
    """The graph of a scene's guards, made once."""

    def __init__(self, scene: Scene, samples: int = SAMPLES) -> None:
        self.scene = scene
        self.guards = [(e, ends) for e in scene.edges if (ends := guard_of(scene, e)) is not None]
        self.samples = samples

    def side(self, k: int, image: bool, t: np.ndarray) -> tuple[int, np.ndarray]:
        """Points of a guard, or of its image, at shares t."""
        e, (a, b) = self.guards[k]
        x = a + t[:, None] * (b - a)
        if not image:
            return e.source, x
        return e.target, x @ np.array(e.matrix, dtype=float).T + np.array(e.offset, dtype=float)

    def distance(self, p, q, toll: float = 0.0) -> float:
        """The length of the shortest path found: at least the distance, by next to nothing."""
        nodes = [(p[0], np.array([p[1]], dtype=float)), (q[0], np.array([q[1]], dtype=float))]
        labels: list[tuple[int, bool, float]] = [(-1, False, 0.0), (-2, False, 0.0)]
        for k in range(len(self.guards)):
            t = np.linspace(0, 1, self.samples)
            for image in (False, True):
                nodes.append(self.side(k, image, t))
                labels += [(k, image, share) for share in t.tolist()]
        route = self._route(nodes, labels, toll)
        return np.inf if route is None else self._tight(p, q, route, toll)

    def _route(self, nodes, labels, toll):
        count = len(labels)
        weights = np.full((count, count), np.inf)
        starts = np.cumsum([0, *(len(x) for _, x in nodes)])
        for i, (mode, x) in enumerate(nodes):
            for j, (other, y) in enumerate(nodes):
                if mode == other:
                    apart = np.linalg.norm(x[:, None] - y[None], axis=2)
                    weights[starts[i] : starts[i + 1], starts[j] : starts[j + 1]] = apart
        for i in range(2, len(nodes), 2):
            own, other = np.arange(starts[i], starts[i + 1]), np.arange(starts[i + 1], starts[i + 2])
            weights[own, other] = weights[other, own] = np.minimum(weights[own, other], toll)
        rows, columns = np.nonzero(np.isfinite(weights))
        graph = csr_array((np.maximum(weights[rows, columns], 1e-14), (rows, columns)), shape=weights.shape)
        lengths, before = dijkstra(graph, indices=0, return_predecessors=True)
        if not np.isfinite(lengths[1]):
            return None
        path = [1]
        while path[-1] != 0:
            path.append(int(before[path[-1]]))
        return [labels[k] for k in path[::-1]][1:-1]

    def _tight(self, p, q, route, toll):
        """Move the points of a path to where it is shortest, all windows together."""
        points = []  # (guard, share, sides in order)
        for k, image, t in route:
            if points and points[-1][0] == k and points[-1][2][-1] != image and points[-1][1] == t:
                points[-1][2].append(image)
            else:
                points.append([k, t, [image]])
        shares, width = np.array([t for _, t, _ in points]), 1.5 / self.samples
        best = np.inf
        for _ in range(60):
            grids = [np.clip(t + width * np.linspace(-1, 1, 21), 0, 1) for t in shares]
            best, shares = self._best_of(p, q, points, grids)
            width *= 0.7
        passed = sum(len(sides) - 1 for _, _, sides in points)
        return best + toll * passed

    def _best_of(self, p, q, points, grids):
        value, at, chosen = np.zeros(1), np.array([p[1]], dtype=float), []
        for (k, _, sides), grid in zip(points, grids, strict=True):
            _, enter = self.side(k, sides[0], grid)
            _, leave = self.side(k, sides[-1], grid)
            total = value[:, None] + np.linalg.norm(at[:, None] - enter[None], axis=2)
            chosen.append(np.argmin(total, axis=0))
            value, at = np.min(total, axis=0), leave
        total = value + np.linalg.norm(at - np.array(q[1], dtype=float), axis=1)
        index, shares = int(np.argmin(total)), []
        for grid, back in zip(grids[::-1], chosen[::-1], strict=True):
            shares.append(grid[index])
            index = int(back[index])
        return float(np.min(total)), np.array(shares[::-1])


def path_fault(scene: Scene, p, q, pieces, upper: float, toll: float = 0.0) -> str | None:
    """What is wrong with a path that is to prove an upper end; None where it is a path and no longer.

    Points may be off what they have to be on by rounding, 1e-13 of the coordinates' size.
    """
    before = (p[0], tuple(map(Fraction, p[1])))
    total = 0.0
    for piece in pieces:
        mode = int(piece.mode[1:])
        start, end = (tuple(map(Fraction, x)) for x in (piece.start, piece.end))
        if mode != before[0] or _off(start, before[1]) > 1e-13:
            return f"begins at {piece.start} of m{mode}, not at {before}"
        if any(_beyond(row, end) > 1e-13 for row in scene.rows(mode)):
            return f"{piece.end} is outside m{mode}"
        total += float(np.linalg.norm(np.array(piece.end) - np.array(piece.start)))
        before = mode, end
        if piece.edge is None:
            continue
        e = scene.edges[int(piece.edge[1:])]
        following = pieces[pieces.index(piece) + 1]
        other = tuple(map(Fraction, following.start))
        guard, image = (end, other) if piece.forward else (other, end)
        if (mode, int(following.mode[1:])) != ((e.source, e.target) if piece.forward else (e.target, e.source)):
            return f"{piece.edge} does not lead from m{mode} to {following.mode}"
        if abs(_beyond((e.normal, e.level), guard)) > 1e-13 or any(_beyond(r, guard) > 1e-13 for r in e.conditions):
            return f"{piece.edge} is not passed on its guard: {guard}"
        size = float(sum(map(abs, guard))) * max(1.0, *(float(abs(v)) for row in e.matrix for v in row))
        made = tuple(dot(row, guard) + b for row, b in zip(e.matrix, e.offset, strict=True))
        if float(max(map(abs, (a - b for a, b in zip(made, image, strict=True))), default=0)) > 1e-13 * (
            size + float(sum(map(abs, image))) + float(sum(map(abs, e.offset)))
        ):
            return f"{piece.edge} does not reset {guard} to {image}"
        total += toll
        before = int(following.mode[1:]), other
    if before[0] != q[0] or _off(before[1], tuple(map(Fraction, q[1]))) > 1e-13:
        return f"ends at {before}"
    return f"is {total} long, not {upper}" if total > upper * (1 + 1e-15) else None


def _off(a: Vector, b: Vector) -> float:
    size = float(sum(map(abs, a)) + sum(map(abs, b)))
    return float(max((abs(x - y) for x, y in zip(a, b, strict=True)), default=0)) / size if size else 0.0


def _beyond(row: Row, x: Vector) -> float:
    """How far a point is beyond an inequality, relative to the size of its coordinates and of the level."""
    normal, level = row
    length = np.sqrt(float(dot(normal, normal)))
    size = float(sum(map(abs, x))) + float(abs(level)) / length if length else 1.0
    return float(dot(normal, x) - level) / length / size if length and size else 0.0
