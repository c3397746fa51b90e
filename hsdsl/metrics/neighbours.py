"""Many distances where something is not affine: cheap bounds first, and paths carried over from pairs nearby.

Pairs that follow each other in time have almost the same shortest path. The guard points of paths that were found are
moved with the pair (linearly between two known pairs), put back onto the guards, and give an upper bound without a
search.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hsdsl.metrics.batch_search import ROUNDING, Pairs
from hsdsl.metrics.budget import Budget
from hsdsl.metrics.geometry import Array, Space
from hsdsl.metrics.guard_clearance import to_passages
from hsdsl.metrics.interval import CERTIFIED, SAMPLED, SEARCHED, weakest
from hsdsl.metrics.local import improve, onto
from hsdsl.metrics.nonaffine import search_nonaffine
from hsdsl.metrics.routes import Route
from hsdsl.metrics.search import End, most_hops, search
from hsdsl.metrics.segment_containment import OUTSIDE, UNDECIDED, segments_inside

CLOSED = 0.005  # relative: a narrower gap is not worth a search when many pairs are asked for
FIRST = 5  # pairs that are searched from nothing, spread over those asked for
FAR = 10  # times the lower bound: a path so long that it may take the wrong way
AGAIN = 16  # pairs improved before paths are carried over anew

Indices = NDArray[np.intp]


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
    relaxation: float | None
    budget: Budget
    hops: int | None = None
    known: dict[tuple[int, int], list[KnownPath]] = field(default_factory=dict[tuple[int, int], list[KnownPath]])

    def bound(self, pairs: Pairs, enough: float) -> None:
        """Bound the distances of pairs; those at most ``enough`` are not looked at more closely."""
        pool = self.known.setdefault((pairs.source, pairs.target), [])
        search = _Batch(self, pairs, pool)
        if len(open_ := search.open(enough)) and not self.budget.spent():
            search.around(open_)
        if not pool and len(open_ := search.open(enough)):
            for k in np.unique(open_[np.linspace(0, len(open_) - 1, FIRST).astype(int)]).tolist():
                if not self.budget.spent():
                    search.from_nothing(k, enough)
        while len(open_ := search.open(enough)) and not self.budget.spent():
            search.carry(open_)
            open_ = search.open(enough)
            for k in open_[np.argsort(-pairs.upper[open_], kind="stable")][:AGAIN].tolist():
                if pairs.upper[k] > enough and not self.budget.spent():
                    search.improve(k, enough)
                    enough = max(enough, float(pairs.upper[k]) if np.isfinite(pairs.upper[k]) else 0.0)
        if len(search.open(enough)):
            self.budget.spent()
        pairs.status = weakest(pairs.status, search.status())


class _Batch:
    """One call's pairs: which are done, and the best guess for each that is not."""

    def __init__(self, owner: Neighbours, pairs: Pairs, pool: list[KnownPath]) -> None:
        self.owner, self.pairs, self.pool = owner, pairs, pool
        self.done, self.shortened = np.zeros((2, len(pairs.p)), dtype=bool)
        self.guess: dict[int, KnownPath] = {}
        self.at = np.hstack([pairs.p, pairs.q])
        self._quick()

    def _quick(self) -> None:
        """What no passage changes, and the straight line."""
        pairs, space = self.pairs, self.owner.space
        self.straight = pairs.lower
        pairs.lower = np.minimum(self.straight, pairs.least() + pairs.toll)
        self.looked_at = np.zeros(len(pairs.p), dtype=bool)
        if pairs.source == pairs.target and not space.domains[pairs.source].convex:
            verdicts = segments_inside(space, pairs.source, pairs.p, pairs.q)
            pairs.upper = np.where(verdicts == OUTSIDE, np.inf, pairs.upper)
            self.looked_at = verdicts == UNDECIDED

    def status(self) -> str:
        """What the bounds rest on: local solves, straight lines looked at in points, or proofs alone."""
        apart = self.pairs.upper > self.pairs.lower * (1 + CLOSED)
        if np.any(apart & (self.done | self.shortened)):
            return SEARCHED
        return SAMPLED if np.any(self.looked_at) else CERTIFIED

    def around(self, chosen: Indices) -> None:
        """The way to the nearest guard and from one, which every path takes that is not straight."""
        pairs, space = self.pairs, self.owner.space
        ways = to_passages(space, pairs.source, pairs.p[chosen]) + to_passages(space, pairs.target, pairs.q[chosen])
        passing = np.minimum(self.straight[chosen], (ways + pairs.toll) * (1 - ROUNDING))
        pairs.lower[chosen] = np.maximum(pairs.lower[chosen], passing)

    def open(self, enough: float) -> Indices:
        """The pairs not yet looked at that may matter and whose bounds are apart."""
        upper, lower = self.pairs.upper, self.pairs.lower
        return np.flatnonzero(~self.done & (upper > enough) & (upper > lower * (1 + CLOSED) + 1e-300))

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
                self._shorter(k, found.route.charged(found.points) + self.pairs.toll * found.route.passages, found)

    def improve(self, k: int, enough: float) -> None:
        """Search from the best guess, or from nothing where there is none, or another way may be much shorter."""
        guess = self.guess.get(k)
        found = None if guess is None else improve(guess.route, guess.points, self.pairs.toll, self.owner.budget)
        if found is not None:
            value, route, points = found
            known = KnownPath(self.at[k], route, points)
            self.pool.append(known)
            self._shorter(k, value, known)
            self.done[k] = True
        if self.pairs.upper[k] > FAR * self.pairs.lower[k]:
            self.from_nothing(k, enough)
        self.done[k] = True

    def from_nothing(self, k: int, enough: float) -> None:
        """Search as for a single pair."""
        pairs, owner = self.pairs, self.owner
        starts, ends = [End(pairs.source, pairs.p[k])], [End(pairs.target, pairs.q[k])]
        hops = most_hops(owner.space, pairs.source, pairs.target, owner.hops)
        outer = search(owner.space, starts, ends, pairs.toll, hops, np.inf, owner.budget)
        enough = max(enough, float(pairs.lower[k]) * (1 + CLOSED))
        found = search_nonaffine(owner.space, starts, ends, pairs.toll, hops, np.inf, outer, owner.budget, enough)
        pairs.lower[k] = max(pairs.lower[k], found.lower * (1 - ROUNDING))
        pairs.upper[k] = min(pairs.upper[k], found.upper)
        self.done[k] = True
        if found.through is not None and found.through.sequence:
            self.pool.append(KnownPath(self.at[k], found.through, found.unknowns))

    def _route(self, route: Route, k: int) -> Route:
        pairs = self.pairs
        return replace(route, start=(pairs.source, pairs.p[k]), end=(pairs.target, pairs.q[k]))

    def _shorter(self, k: int, value: float, found: KnownPath) -> None:
        if value < self.pairs.upper[k]:
            self.pairs.upper[k], self.guess[k], self.shortened[k] = value, found, True
