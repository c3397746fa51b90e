"""Chains and cycles of transitions at one instant, followed with numbers."""

from __future__ import annotations

from collections.abc import Iterator

from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import Edge
from hsdsl.mathematics.decisions.mode_point import NEAR, ModePoint, Unsure

MOST = 40


def chain(here: ModePoint, edge: Edge) -> Iterator[tuple[Edge, ModePoint]]:
    """Follow an edge and the transitions that are made at the same instant: each with where it leads to.

    Raises :class:`Unsure` where what comes next is not known, or has no end.
    """
    following: Edge | None = edge
    for _ in range(MOST):
        here = here.after(following)
        yield following, here
        following = here.next()
        if following is None:
            return
    raise Unsure


def cycle(here: ModePoint, edge: Edge) -> tuple[Edge, ...] | None:
    """The transitions that follow an edge at one instant without end; None without a known cycle."""
    visited: list[ModePoint] = []
    edges: list[Edge] = []
    try:
        for following, reached in chain(here, edge):
            edges.append(following)
            for k, before in enumerate(visited):
                if same(before, reached):
                    return tuple(edges[k + 1 :])
            visited.append(reached)
    except Unsure:
        return None
    return None


def same(one: ModePoint, other: ModePoint) -> bool:
    """Whether two points agree within the accuracy of a search."""
    if one.mode is not other.mode:
        return False
    pairs = [(one.point[symbol(s)], other.point[symbol(s)], one.size(symbol(s))) for s in one.mode.states]
    return all(abs(a - b) <= NEAR * size for a, b, size in pairs)
