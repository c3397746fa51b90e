"""Distances where guards, resets or domains are not affine: proved bounds below, the best path of local solves above.

A path that is found is one of the space, so its length is an upper bound; whether its straight pieces stay in curved
domains is proved where enclosures can (`guard_clearance`). Bounds from below come from there, and from the affine part
of the model.

Pairs that follow each other in time have almost the same shortest path. The guard points of paths that were found are
moved with the pair (linearly between two known pairs), put back onto the guards, and give an upper bound without a
search.

A `Route` is a path through guards and domains that are not affine: its length, what must hold on it, all derivatives.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from hsdsl.analysis.metrics.gate_sequence import norm, one_thread
from hsdsl.analysis.metrics.geometry import TOLERANCE, Array, CurvedGate, Domain, Formula, Gate, Space, affine, stacked
from hsdsl.analysis.metrics.guard_clearance import CERTAIN, OUTSIDE, UNDECIDED, segments_inside, to_passages
from hsdsl.analysis.metrics.interval import CERTIFIED, SAMPLED, SEARCHED, Budget
from hsdsl.analysis.metrics.search import ROUNDING, End, Indices, Query, SearchResult, search, unchanged

MOST_SEQUENCES = 6
MORE_HOPS = 1  # than the shortest sequence has
STARTS = 3
ITERATIONS = 250
MANY = 14  # unknowns, from which on one start and fewer iterations must do
ITERATIONS_OF_MANY = 100
# Room for inequalities: a reset may land on a boundary everywhere, and no solver bears that as a constraint.
MARGINS = (1e-8, 1e-10)
STILL = 2.0**-52  # relative: a step so short is the last
STEPS = 12  # of Newton's method back onto a surface
FAR = 1e3  # times a guess's size: farther out a solve ran away
SMOOTHING = 1e-9  # of the length where a leg shrinks to nothing, relative to the points' distance
DEPTH = 0.05  # how deep inside a bent path is held, relative to how far outside the straight one was
BENDS = 2  # put into a path whose straight pieces leave their domains, at most so often


def search_locally(query: Query, enough: float) -> SearchResult:
    """The best path found; stops where it is as short as ``enough``."""
    found = SearchResult(upper=query.limit, lower=0.0)
    with one_thread():
        for start in query.starts:
            for end in query.ends:
                for number, sequence in enumerate(_sequences(query.space, start, end, query.most)):
                    if found.upper <= enough or (number and query.budget.spent()):
                        return found
                    route = Route(query.space, sequence, (start.mode, start.x[0]), (end.mode, end.x[0]))
                    _try(route, start.cost + end.cost + query.toll * len(sequence), found, query.budget)
    return found


def improve(route: Route, guess: Array, relaxation: float, budget: Budget) -> tuple[float, Route, Array] | None:
    """The shortest path near a guess through a given sequence: length with tolls, route, unknowns."""
    found = SearchResult()
    with one_thread():
        _try_from(route, guess, relaxation * route.passages, found, budget)
    return None if found.upper == np.inf else (found.upper, found.through, found.unknowns)


def _sequences(space: Space, start: End, end: End, hops: int) -> Iterator[tuple[Crossing, ...]]:
    """Sequences from mode to mode, shortest first, never straight back through the guard just passed."""
    waiting: deque[tuple[Crossing, ...]] = deque([()])
    given, most = 0, hops
    while waiting and given < MOST_SEQUENCES:
        sequence = waiting.popleft()
        mode = sequence[-1].target if sequence else start.mode
        if mode == end.mode and start.bound is None and end.bound is None:
            given += 1
            most = min(most, len(sequence) + MORE_HOPS)
            yield sequence
        if len(sequence) < most:
            last = sequence[-1] if sequence else None
            for c in crossings(space):
                back = last is not None and last.surface is c.surface and last.forward != c.forward
                if c.source == mode and not back:
                    waiting.append((*sequence, c))


def _try(route: Route, toll: float, found: SearchResult, budget: Budget) -> None:
    p, q = route.start[1], route.end[1]
    if not route.sequence:
        verdict = int(segments_inside(route.space, route.start[0], p[None], q[None])[0])
        if verdict != OUTSIDE:
            _keep(found, float(np.linalg.norm(p - q)) + toll, route, np.zeros(0), verdict)
        else:
            _try_from(_bent(route, np.zeros(0), [0]), (p + q) / 2, toll, found, budget, BENDS - 1)
    for guess in _guesses(route) if route.sequence else ():
        _try_from(route, guess, toll, found, budget)


def _try_from(route: Route, guess: Array, toll: float, found: SearchResult, budget: Budget, bends: int = BENDS) -> None:
    """Solve from a guess; where straight pieces leave their domains, let them bend and solve again."""
    size = FAR * (route.size(guess) or np.inf)
    for margin in MARGINS:
        s = _solve(route, guess, margin, budget)
        # A solve that ran away: so far out its rounding alone would pass for a path.
        if s is None or not np.abs(s).max(initial=0) <= size or not route.allowed(s):
            continue
        value = route.charged(s) + toll
        if value >= found.upper:
            return
        verdicts = route.judged(s)
        outside = [k for k, verdict in enumerate(verdicts) if verdict == OUTSIDE]
        if not outside:
            _keep(found, value, route, s, min(verdicts))
        elif bends:
            bent = _bent(route, s, outside)
            points = [*route.points(s), np.zeros(0)]
            parts: list[Array] = []
            for k, (_, a, b) in enumerate(route.legs(s)):
                parts += [(a + b) / 2] * (k in outside)
                parts.append(points[k])
            _try_from(bent, np.concatenate(parts), toll, found, budget, bends - 1)
        return


def _bent(route: Route, s: Array, legs: Sequence[int]) -> Route:
    """The same route with a bend in some of its legs, whose halves are held in their domains."""
    held, depths = dict(route.held), dict[int, float]()
    sequence: list[Crossing] = []
    for k, (mode, a, b) in enumerate(route.legs(s)):
        if k in legs:
            depth = max(DEPTH * beyond(route.space, mode, a, b), held.get(k, 0.0))
            depths |= {len(sequence): depth, len(sequence) + 1: depth}
            sequence.append(bend(route.space, mode))
        elif k in held:
            depths[len(sequence)] = held[k]
        sequence += route.sequence[k : k + 1]
    return replace(route, sequence=tuple(sequence), held=tuple(depths.items()))


def _keep(found: SearchResult, value: float, route: Route, s: Array, verdict: int) -> None:
    if value < found.upper:
        found.upper, found.unknowns, found.through, found.proved = value, s, route, verdict == CERTAIN


def _guesses(route: Route) -> list[Array]:
    """Guard points between p and q, by the names of their coordinates; then some near them."""
    domains, (source, p), (target, q) = route.space.domains, route.start, route.end
    from_p = dict(zip(domains[source].coordinates, p.tolist(), strict=True))
    from_q = dict(zip(domains[target].coordinates, q.tolist(), strict=True))
    middle: list[float] = []
    for k, crossing in enumerate(route.sequence):
        share = (k + 1) / (len(route.sequence) + 1)
        for name in domains[crossing.guard_mode].coordinates:
            a = from_p.get(name, from_q.get(name, 0.0))
            middle.append(a + share * (from_q.get(name, a) - a))
    guess = np.array(middle)
    spread = np.random.default_rng(0).normal(size=((STARTS - 1) * (len(guess) < MANY), len(guess)))
    ends = np.abs(np.concatenate([p, q])).max(initial=0.0)
    width = 0.1 * (float(np.abs(guess).max(initial=ends)) or 1.0)
    return [guess, *(guess + width * row for row in spread)]


class _TimeOver(Exception):
    """Raised within a solve when the budget is spent."""


def _solve(route: Route, guess: Array, margin: float, budget: Budget) -> Array | None:
    """Solve in units of the path's own size, each constraint in units of its slope; None without a result in time."""
    minimise: Any = import_module("scipy.optimize").minimize
    unit = max(route.length(guess), 1e-3 * route.size(guess)) or 1.0
    on, in_ = (1 / (unit * _slopes(rows)) for rows in (route.surface_slopes(guess), route.room_slopes(guess)))
    clear = margin * max(1.0, route.size(guess) / unit)

    def length(x: Array) -> tuple[float, Array]:
        if budget.spent():
            raise _TimeOver
        value, slope = route.smooth_length(unit * x, SMOOTHING * unit)
        return value / unit, slope

    constraints = [
        _constraint("eq", route.surfaces, route.surface_slopes, unit, on, 0.0),
        _constraint("ineq", route.room, route.room_slopes, unit, in_, clear),
    ]
    most = ITERATIONS if len(guess) < MANY else ITERATIONS_OF_MANY
    options = {"maxiter": most, "ftol": 1e-11}
    with np.errstate(all="ignore"):
        try:
            first = guess / unit
            answer: Any = minimise(length, first, jac=True, method="SLSQP", constraints=constraints, options=options)
        except (_TimeOver, ValueError, np.linalg.LinAlgError):
            return None
        return onto(route, unit * np.array(answer.x, dtype=float))


def _constraint(
    kind: str,
    value: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    unit: float,
    factors: Array,
    more: float,
) -> dict[str, Any]:
    """A constraint as the solver takes it, of unknowns in a unit, each row times a factor."""

    def scaled(x: Array) -> Array:
        return factors * value(unit * x) + more

    def scaled_slopes(x: Array) -> Array:
        return (unit * factors)[:, None] * slopes(unit * x)

    return {"type": kind, "fun": scaled, "jac": scaled_slopes}


def _slopes(rows: Array) -> Array:
    """How steep functions are; 1 where they are not, or not known to be."""
    steep = np.linalg.norm(rows, axis=1)
    return np.where(np.isfinite(steep) & (steep > 0), steep, 1.0)


def onto(route: Route, s: Array) -> Array:
    """Newton's method onto the surfaces, along their gradients."""
    for _ in range(STEPS):
        residual = route.surfaces(s)
        if not residual.any() or not np.all(np.isfinite(residual)):
            break
        jacobian = route.surface_slopes(s)
        if not np.all(np.isfinite(jacobian)):
            break
        step = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        s = s - step
        if np.abs(step).max() <= STILL * np.abs(s).max():
            break
    return s


CLOSE = 1e-9  # relative: a path so near to the lower end is not improved


def search_nonaffine(query: Query, enough: float = 0.0) -> SearchResult:
    """Bound a distance from below by the affine part, and find a path.

    The search through polyhedra is a relaxation of every path without a curved guard. Every path with one goes from its
    beginning to some guard or image, from another to its end, and through the coordinates that no passage changes. A
    path as short as ``enough`` is not improved.
    """
    outer, space = search(query), query.space
    lower = min(float(end[0]) for end in (outer.lower, outer.upper, outer.cut))
    if space.curved_gates:
        bound = any(a.bound is not None for a in (*query.starts, *query.ends))
        passing = min(least_with_passages(space, a, b) for a in query.starts for b in query.ends)
        lower = min(lower, passing + (0.0 if bound else query.toll))
    found = search_locally(query, max(enough, lower * (1 + CLOSE)))
    found.lower, found.local, found.ended_early = lower, True, query.budget.ran_out
    return found


def least_with_passages(space: Space, a: End, b: End) -> float:
    """The least that a path with passages between two ends can have, without tolls."""
    around = sum(float(to_passages(space, e.mode, e.x)[0]) for e in (a, b) if e.bound is None)
    return max(float(unchanged(space, a.mode, a.x, b.mode, b.x)[0]), around) + max(0.0, a.cost + b.cost)


CLOSED = 0.005  # relative: a narrower gap is not worth a search among many pairs
FIRST = 5  # pairs that are searched from nothing, spread over all
WRONG_WAY = 10  # times the lower bound: a path so long that it may take the wrong way
AGAIN = 16  # pairs improved before paths are carried over anew


class KnownPath(NamedTuple):
    """A path that was found: its ends as one vector, the route, and its guard points."""

    at: Array
    route: Route
    points: Array

    @property
    def passed(self) -> tuple[tuple[str | None, bool], ...]:
        """The route by name."""
        return tuple((c.edge, c.forward) for c in self.route.sequence)


@dataclass
class Neighbours:
    """Distances of pairs, and the paths found for earlier ones by their modes."""

    space: Space
    toll: float
    budget: Budget
    hops: int | None = None
    known: dict[tuple[int, int], list[KnownPath]] = field(default_factory=dict[tuple[int, int], list[KnownPath]])

    def bound(self, start: End, end: End, enough: float) -> tuple[Array, Array, str]:
        """Bound the distances of pairs, and say what bounds rest on; those at most ``enough`` need not be close."""
        pool = self.known.setdefault((start.mode, end.mode), [])
        search = _Batch(self, start, end, pool)
        if len(open_ := search.open(enough)) and not self.budget.spent():
            search.around(open_)
        if not pool and len(open_ := search.open(enough)):
            for k in np.unique(open_[np.linspace(0, len(open_) - 1, FIRST).astype(int)]).tolist():
                if not self.budget.spent():
                    search.from_nothing(k, enough)
        while len(open_ := search.open(enough)) and not self.budget.spent():
            search.carry(open_)
            open_ = search.open(enough)
            for k in open_[np.argsort(-search.upper[open_], kind="stable")][:AGAIN].tolist():
                if search.upper[k] > enough and not self.budget.spent():
                    search.improve(k, enough)
                    enough = max(enough, float(search.upper[k]) if np.isfinite(search.upper[k]) else 0.0)
        if len(search.open(enough)):
            self.budget.spent()
        return search.lower, search.upper, search.status()


class _Batch:
    """One call's pairs: their bounds, which are done, and the best guess for each that is not."""

    def __init__(self, owner: Neighbours, start: End, end: End, pool: list[KnownPath]) -> None:
        self.owner, self.start, self.end, self.pool = owner, start, end, pool
        self.done, self.shortened, self.looked_at = np.zeros((3, len(start.x)), dtype=bool)
        self.guess: dict[int, KnownPath] = {}
        self.at = np.hstack([start.x, end.x])
        space, mode = owner.space, start.mode
        self.straight = norm(start.x - end.x) if mode == end.mode else np.full(len(start.x), np.inf)
        self.upper, self.straight = self.straight * (1 + ROUNDING), self.straight * (1 - ROUNDING)
        self.lower = np.minimum(self.straight, unchanged(space, mode, start.x, end.mode, end.x) + owner.toll)
        if mode == end.mode and not space.domains[mode].convex:
            verdicts = segments_inside(space, mode, start.x, end.x)
            self.upper = np.where(verdicts == OUTSIDE, np.inf, self.upper)
            self.looked_at = verdicts == UNDECIDED

    def status(self) -> str:
        """What the bounds rest on: local solves, straight lines examined at points, or proofs alone."""
        apart = self.upper > self.lower * (1 + CLOSED)
        if np.any(apart & (self.done | self.shortened)):
            return SEARCHED
        return SAMPLED if np.any(self.looked_at) else CERTIFIED

    def around(self, chosen: Indices) -> None:
        """The way to the nearest guard and from one, which every path takes that is not straight."""
        ways = sum(to_passages(self.owner.space, end.mode, end.x[chosen]) for end in (self.start, self.end))
        passing = np.minimum(self.straight[chosen], (ways + self.owner.toll) * (1 - ROUNDING))
        self.lower[chosen] = np.maximum(self.lower[chosen], passing)

    def open(self, enough: float) -> Indices:
        """The pairs not yet examined that may matter and whose bounds are apart."""
        return np.flatnonzero(~self.done & (self.upper > np.maximum(enough, self.lower * (1 + CLOSED) + 1e-300)))

    def carry(self, chosen: Indices) -> None:
        """Give pairs upper bounds by the paths of known pairs nearby."""
        by_route: dict[tuple[tuple[str | None, bool], ...], list[KnownPath]] = {}
        for known in self.pool:
            by_route.setdefault(known.passed, []).append(known)
        for alike in by_route.values():
            places = np.array([known.at for known in alike])
            moved = [(k, found) for k in chosen.tolist() if (found := self._moved(k, alike, places)) is not None]
            self._judge(moved)

    def _moved(self, k: int, alike: list[KnownPath], places: Array) -> KnownPath | None:
        apart = np.linalg.norm(places - self.at[k], axis=1)
        nearest: list[int] = np.argsort(apart, kind="stable")[:2].tolist()
        first, others = nearest[0], nearest[1:]
        ends = (self.start.mode, self.start.x[k]), (self.end.mode, self.end.x[k])
        points, route = alike[first].points, replace(alike[first].route, start=ends[0], end=ends[1])
        if others:
            way = places[others[0]] - places[first]
            share = float((self.at[k] - places[first]) @ way / max(float(way @ way), 1e-300))
            points = points + min(max(share, -0.5), 1.0) * (alike[others[0]].points - points)
        with np.errstate(all="ignore"):
            points = onto(route, points)
            if not np.all(np.isfinite(points)):
                return None
            if k not in self.guess:
                self.guess[k] = KnownPath(self.at[k], route, points)
            return KnownPath(self.at[k], route, points) if route.allowed(points) else None

    def _judge(self, moved: list[tuple[int, KnownPath]]) -> None:
        """Keep the paths whose straight pieces stay in their domains, where they are shorter."""
        if not moved:
            return
        legs = [found.route.legs(found.points) for _, found in moved]
        holds = np.ones(len(moved), dtype=bool)
        for pieces in zip(*legs, strict=True):
            a, b = np.array([piece[1] for piece in pieces]), np.array([piece[2] for piece in pieces])
            holds &= segments_inside(self.owner.space, pieces[0][0], a, b) != OUTSIDE
        for (k, found), good in zip(moved, holds.tolist(), strict=True):
            if good:
                self._shorter(k, found.route.charged(found.points) + self.owner.toll * found.route.passages, found)

    def improve(self, k: int, enough: float) -> None:
        """Search from the best guess, or from nothing where there is none, or another way may be much shorter."""
        guess = self.guess.get(k)
        found = None if guess is None else improve(guess.route, guess.points, self.owner.toll, self.owner.budget)
        if found is not None:
            value, route, points = found
            self.pool.append(KnownPath(self.at[k], route, points))
            self._shorter(k, value, self.pool[-1])
            self.done[k] = True
        if self.upper[k] > WRONG_WAY * self.lower[k]:
            self.from_nothing(k, enough)
        self.done[k] = True

    def from_nothing(self, k: int, enough: float) -> None:
        """Search as for a single pair."""
        owner = self.owner
        starts, ends = ([end._replace(x=end.x[k : k + 1])] for end in (self.start, self.end))
        query = Query(owner.space, starts, ends, owner.toll, owner.hops, owner.budget)
        found = search_nonaffine(query, max(enough, float(self.lower[k]) * (1 + CLOSED)))
        self.lower[k] = max(self.lower[k], found.lower * (1 - ROUNDING))
        self.upper[k] = min(self.upper[k], found.upper)
        self.done[k] = True
        if found.through is not None and found.through.sequence:
            self.pool.append(KnownPath(self.at[k], found.through, found.unknowns))

    def _shorter(self, k: int, value: float, found: KnownPath) -> None:
        if value < self.upper[k]:
            self.upper[k], self.guess[k], self.shortened[k] = value, found, True


# Where a leg that is held is held: dense towards its ends, at which it may leave a boundary it begins on.
SHARES = (0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999)


@dataclass(frozen=True, eq=False)
class Crossing:
    """A guard passed in one direction, any guard: the unknown is the point x on it.

    ``room`` are functions of the image that are at most 0 in its domain. A crossing without an edge is a bend: a point
    of a domain at which a path turns.
    """

    edge: str | None
    source: int
    target: int
    guard_mode: int
    forward: bool
    surface: Formula
    conditions: Formula
    reset: Formula
    room: Formula

    def sides(self, x: Array) -> tuple[Array, Array]:
        """Where the passage is entered and left."""
        image = self.reset.value(x)
        return (x, image) if self.forward else (image, x)

    def slopes(self, x: Array) -> tuple[Array, Array]:
        """The derivatives of both sides."""
        own, image = np.eye(len(x)), self.reset.jacobian(x)
        return (own, image) if self.forward else (image, own)


def crossings(space: Space) -> tuple[Crossing, ...]:
    """Every guard in both directions."""
    return space.remembered("crossings", lambda: tuple(_crossings(space)))


def _crossings(space: Space) -> Iterator[Crossing]:
    for gate in (*space.gates, *space.curved_gates):
        curved = isinstance(gate, CurvedGate)
        what = (gate.surface, gate.conditions, gate.reset) if curved else _as_formulas(gate)
        room = inequalities(space.domains[gate.target])
        yield Crossing(gate.edge, gate.source, gate.target, gate.source, True, *what, room)
        yield Crossing(gate.edge, gate.target, gate.source, gate.source, False, *what, room)


def inequalities(domain: Domain) -> Formula:
    """All of a domain's inequalities, as functions that are at most 0."""
    return stacked([affine(domain.normals, -domain.levels), *domain.curved])


def bend(space: Space, mode: int) -> Crossing:
    """A point of a domain at which a path turns."""
    n = len(space.domains[mode].coordinates)
    nothing, identity = affine(np.zeros((0, n)), np.zeros(0)), affine(np.eye(n), np.zeros(n))
    return Crossing(None, mode, mode, mode, True, nothing, nothing, identity, inequalities(space.domains[mode]))


def _as_formulas(gate: Gate) -> tuple[Formula, Formula, Formula]:
    """Surface, conditions and reset of an affine guard, in the coordinates of its mode."""
    (base, frame), (image_base, image_frame) = ((side[:, 0], side[:, 1:]) for side in gate.sides)
    normal = np.linalg.svd(frame.T)[2][-1:] if gate.size else np.ones((1, len(base)))
    along, image = gate.normals @ frame.T, image_frame @ frame.T
    conditions = affine(along, -along @ base - gate.levels)
    reset = affine(image, image_base - image @ base)
    return affine(normal, -normal @ base), stacked([conditions, *gate.curved]), reset


@dataclass(frozen=True, eq=False)
class Route:
    """A sequence of crossings between p and q; unknowns are the guard points, one after the other.

    ``held`` are legs that are made to stay in their domains, and by how much in their middle (a quarter of that).
    """

    space: Space
    sequence: tuple[Crossing, ...]
    start: tuple[int, Array]
    end: tuple[int, Array]
    held: tuple[tuple[int, float], ...] = ()

    @property
    def passages(self) -> int:
        """How many guards it passes; bends do not count."""
        return sum(c.edge is not None for c in self.sequence)

    def points(self, unknowns: Array) -> list[Array]:
        """The guard points."""
        return [unknowns[where] for where in self._slices]

    @cached_property
    def _slices(self) -> list[slice]:
        ends = list(accumulate((len(self.space.domains[c.guard_mode].coordinates) for c in self.sequence), initial=0))
        return [slice(a, b) for a, b in pairwise(ends)]

    def legs(self, unknowns: Array) -> list[tuple[int, Array, Array]]:
        """The straight pieces: mode, start and end."""
        at, mode = self.start[1], self.start[0]
        found: list[tuple[int, Array, Array]] = []
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            enter, leave = crossing.sides(x)
            found.append((mode, at, enter))
            at, mode = leave, crossing.target
        return [*found, (mode, at, self.end[1])]

    def _crossed(self, unknowns: Array) -> Iterator[tuple[Crossing, Array, Callable[[Array], Array]]]:
        """The crossings with their guard points, and what takes derivatives by these to those by all unknowns."""

        def wide(block: Array, where: slice) -> Array:
            found = np.zeros((len(block), len(unknowns)))
            found[:, where] = block
            return found

        for crossing, where in zip(self.sequence, self._slices, strict=True):
            yield crossing, unknowns[where], partial(wide, where=where)

    def leg_slopes(self, unknowns: Array) -> list[tuple[Array, Array]]:
        """The derivatives of each leg's start and end by all unknowns."""
        fixed = [np.zeros((len(end[1]), len(unknowns))) for end in (self.start, self.end)]
        sides = [wide(side) for c, x, wide in self._crossed(unknowns) for side in c.slopes(x)]
        ends = [fixed[0], *sides, fixed[1]]
        return list(zip(ends[::2], ends[1::2], strict=True))

    def length(self, unknowns: Array) -> float:
        """The path's length."""
        return float(sum(np.linalg.norm(b - a) for _, a, b in self.legs(unknowns)))

    def smooth_length(self, unknowns: Array, rounding: float) -> tuple[float, Array]:
        """The sum of sqrt(|leg|^2 + rounding^2), which has derivatives everywhere, and those."""
        total, gradient = 0.0, np.zeros(len(unknowns))
        for (_, a, b), (da, db) in zip(self.legs(unknowns), self.leg_slopes(unknowns), strict=True):
            size = float(np.sqrt((b - a) @ (b - a) + rounding**2))
            total += size
            gradient += (b - a) @ (db - da) / size
        return total, gradient

    def surfaces(self, unknowns: Array) -> Array:
        """What must be 0."""
        parts = [c.surface.value(x) for c, x in zip(self.sequence, self.points(unknowns), strict=True)]
        return np.concatenate([np.zeros(0), *parts])

    def surface_slopes(self, unknowns: Array) -> Array:
        """Its derivatives."""
        rows = [wide(c.surface.jacobian(x)) for c, x, wide in self._crossed(unknowns)]
        return np.vstack([np.zeros((0, len(unknowns))), *rows])

    def room(self, unknowns: Array) -> Array:
        """What must not be negative: guards' conditions, and images inside their domains."""
        parts: list[Array] = [np.zeros(0)]
        for crossing, x in zip(self.sequence, self.points(unknowns), strict=True):
            parts += [-crossing.conditions.value(x), -crossing.room.value(crossing.reset.value(x))]
        legs = self.legs(unknowns) if self.held else []
        for k, depth in self.held:
            mode, a, b = legs[k]
            for share in SHARES:
                at = a + share * (b - a)
                parts += [-f.value(at) - depth * share * (1 - share) for f in self.space.domains[mode].curved]
        return np.concatenate(parts)

    def room_slopes(self, unknowns: Array) -> Array:
        """Its derivatives."""
        rows = [np.zeros((0, len(unknowns)))]
        for c, x, wide in self._crossed(unknowns):
            image = c.room.jacobian(c.reset.value(x)) @ c.reset.jacobian(x)
            rows += [-wide(c.conditions.jacobian(x)), -wide(image)]
        legs, slopes = (self.legs(unknowns), self.leg_slopes(unknowns)) if self.held else ([], [])
        for k, _ in self.held:
            (mode, a, b), (da, db) = legs[k], slopes[k]
            for share in SHARES:
                at, moves = a + share * (b - a), da + share * (db - da)
                rows += [-f.jacobian(at) @ moves for f in self.space.domains[mode].curved]
        return np.vstack(rows)

    def excess(self, unknowns: Array) -> float:
        """How far the guard points are, to first order, from where surfaces and inequalities let them be."""
        on, in_ = np.abs(self.surfaces(unknowns)), np.maximum(-self.room(unknowns), 0.0)
        if not (np.all(np.isfinite(on)) and np.all(np.isfinite(in_))):
            return np.inf
        parts = [(on, self.surface_slopes), (in_, self.room_slopes)]
        return max(_farthest(off, slopes(unknowns)) if off.any() else 0.0 for off, slopes in parts)

    def size(self, unknowns: Array) -> float:
        """The largest coordinate of its ends and guard points."""
        return float(np.abs(np.concatenate([self.start[1], unknowns, self.end[1]])).max(initial=0.0))

    def allowed(self, unknowns: Array) -> bool:
        """Whether guard points are on their guards and images in their domains, nearly; what is missing is charged."""
        return self.excess(unknowns) <= TOLERANCE * self.size(unknowns)

    def charged(self, unknowns: Array) -> float:
        """The path's length, and what it may take to put its guard points where they have to be."""
        excess = self.excess(unknowns)
        if not excess > 0:
            return self.length(unknowns)
        points = zip(self.sequence, self.points(unknowns), strict=True)
        moved = sum(float(np.linalg.norm(side)) for c, x in points for side in c.slopes(x))
        return self.length(unknowns) + 2 * excess * moved

    def judged(self, unknowns: Array) -> list[int]:
        """Containment of each leg in its domain, see :mod:`hsdsl.analysis.metrics.guard_clearance`."""
        if not np.all(np.isfinite(unknowns)):
            return [OUTSIDE]
        legs = self.legs(unknowns)
        return [int(segments_inside(self.space, mode, a[None], b[None])[0]) for mode, a, b in legs]


def beyond(space: Space, mode: int, a: Array, b: Array) -> float:
    """How far a straight piece is seen to leave its domain."""
    at = [a + share * (b - a) for share in SHARES]
    return max((f(x) for f in space.domains[mode].curved for x in at), default=0.0)


def _farthest(off: Array, slopes: Array) -> float:
    """The way to where functions that are ``off`` are not, along their steepest slopes."""
    with np.errstate(all="ignore"):
        return float(np.max(np.where(off > 0, off / np.linalg.norm(slopes, axis=1), 0.0)))
