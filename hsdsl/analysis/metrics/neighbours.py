"""Many distances where something is not affine: cheap bounds first, and paths carried over from pairs nearby.

Pairs that follow each other in time have almost the same shortest path. The guard points of paths that were found are
moved with the pair (linearly between two known pairs), put back onto the guards, and give an upper bound without a
search.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hsdsl.analysis.metrics.budget import Budget
from hsdsl.analysis.metrics.geometry import Array, Space
from hsdsl.analysis.metrics.guard_clearance import OUTSIDE, UNDECIDED, segments_inside, to_passages
from hsdsl.analysis.metrics.interval import CERTIFIED, SAMPLED, SEARCHED
from hsdsl.analysis.metrics.local import improve, onto
from hsdsl.analysis.metrics.nonaffine import search_nonaffine
from hsdsl.analysis.metrics.passage_bounds import ROUNDING, Indices, unchanged
from hsdsl.analysis.metrics.rounding import norm
from hsdsl.analysis.metrics.routes import Route
from hsdsl.analysis.metrics.search import End, Query

CLOSED = 0.005  # relative: a narrower gap is not worth a search among many pairs
FIRST = 5  # pairs that are searched from nothing, spread over all
FAR = 10  # times the lower bound: a path so long that it may take the wrong way
AGAIN = 16  # pairs improved before paths are carried over anew


@dataclass(frozen=True, eq=False)
class KnownPath:
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
        """What the bounds rest on: local solves, straight lines looked at in points, or proofs alone."""
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
        """The pairs not yet looked at that may matter and whose bounds are apart."""
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
        points, route = alike[first].points, self._route(alike[first].route, k)
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
        if self.upper[k] > FAR * self.lower[k]:
            self.from_nothing(k, enough)
        self.done[k] = True

    def from_nothing(self, k: int, enough: float) -> None:
        """Search as for a single pair."""
        owner = self.owner
        starts, ends = ([replace(end, x=end.x[k : k + 1])] for end in (self.start, self.end))
        query = Query(owner.space, starts, ends, owner.toll, owner.hops, owner.budget)
        found = search_nonaffine(query, max(enough, float(self.lower[k]) * (1 + CLOSED)))
        self.lower[k] = max(self.lower[k], found.lower * (1 - ROUNDING))
        self.upper[k] = min(self.upper[k], found.upper)
        self.done[k] = True
        if found.through is not None and found.through.sequence:
            self.pool.append(KnownPath(self.at[k], found.through, found.unknowns))

    def _route(self, route: Route, k: int) -> Route:
        return replace(route, start=(self.start.mode, self.start.x[k]), end=(self.end.mode, self.end.x[k]))

    def _shorter(self, k: int, value: float, found: KnownPath) -> None:
        if value < self.upper[k]:
            self.upper[k], self.guess[k], self.shortened[k] = value, found, True
