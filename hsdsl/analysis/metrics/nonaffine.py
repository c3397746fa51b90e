"""One distance where guards, resets or domains are not affine: bounds from below, and the best path of local solves."""

from __future__ import annotations

from hsdsl.analysis.metrics.geometry import Space
from hsdsl.analysis.metrics.guard_clearance import to_passages
from hsdsl.analysis.metrics.local import search_locally
from hsdsl.analysis.metrics.passage_bounds import unchanged
from hsdsl.analysis.metrics.search import End, Query, SearchResult, search

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
