"""One distance where guards, resets or domains are not affine: bounds from below, and the best path of local solves."""

from __future__ import annotations

from hsdsl.metrics.budget import Budget
from hsdsl.metrics.geometry import Space
from hsdsl.metrics.guard_clearance import to_passages
from hsdsl.metrics.local import search_locally
from hsdsl.metrics.passage_bounds import unchanged
from hsdsl.metrics.search import End, SearchResult

CLOSE = 1e-9  # relative: a path so near to the lower end is not improved


def search_nonaffine(
    space: Space,
    starts: list[End],
    ends: list[End],
    toll: float,
    hops: int,
    limit: float,
    outer: SearchResult,
    budget: Budget,
    enough: float = 0.0,
) -> SearchResult:
    """Keep what the affine part bounds from below, and find a path.

    The search through polyhedra is a relaxation of every path without a curved guard. Every path with one goes from its
    beginning to some guard or image, from another to its end, and through the coordinates that no passage changes. A
    path as short as ``enough`` is not improved.
    """
    lower = min(float(end[0]) for end in (outer.lower, outer.upper, outer.cut))
    if space.curved_gates:
        bound = any(a.bound is not None for a in (*starts, *ends))
        passing = min(least_with_passages(space, a, b) for a in starts for b in ends)
        lower = min(lower, passing + (0.0 if bound else toll))
    found = search_locally(space, starts, ends, toll, hops, limit, max(enough, lower * (1 + CLOSE)), budget)
    found.lower, found.local, found.ended_early = lower, True, budget.ran_out
    return found


def least_with_passages(space: Space, a: End, b: End) -> float:
    """The least that a path with passages between two ends can have, without tolls."""
    around = sum(float(to_passages(space, e.mode, e.x)[0]) for e in (a, b) if e.bound is None)
    return max(float(unchanged(space, a.mode, a.x, b.mode, b.x)[0]), around) + max(0.0, a.cost + b.cost)
