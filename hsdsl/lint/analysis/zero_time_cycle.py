"""Transitions followed with numbers, as long as they fire at one instant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.mode_point import NEAR, ModePoint, Unsure
from hsdsl.system import Edge

MOST = 40


@dataclass(frozen=True)
class Cycle:
    """The edges that follow each other without end."""

    edges: tuple[str, ...]


def chain(here: ModePoint, edge: Edge) -> Iterator[tuple[Edge, ModePoint]]:
    """Follow an edge and the transitions that are made at the same instant: each with where it leads to.

    Raises
    ------
    Unsure
        What comes next is not known, or has no end.
    """
    following: Edge | None = edge
    for _ in range(MOST):
        here = here.after(following)
        yield following, here
        following = here.next()
        if following is None:
            return
    raise Unsure


def cycle(here: ModePoint, edge: Edge) -> Cycle | None:
    """The cycle that transitions run into which follow an edge at one instant; None where none is known."""
    visited: list[ModePoint] = []
    names: list[str] = []
    try:
        for following, reached in chain(here, edge):
            names.append(following.name)
            for k, before in enumerate(visited):
                if same(before, reached):
                    return Cycle(tuple(names[k + 1 :]))
            visited.append(reached)
    except Unsure:
        return None
    return None


def same(one: ModePoint, other: ModePoint) -> bool:
    """Whether two points are one, as far as can be told."""
    if one.mode is not other.mode:
        return False
    pairs = [(one.point[symbol(s)], other.point[symbol(s)], one.size(symbol(s))) for s in one.mode.states]
    return all(abs(a - b) <= NEAR * size for a, b, size in pairs)
