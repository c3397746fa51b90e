"""Directed graphs that are given by what follows each node: what can be reached, and cycles."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from graphlib import CycleError, TopologicalSorter
from typing import TypeVar

T = TypeVar("T", bound=Hashable)


def closure(starts: Iterable[T], following: Callable[[T], Iterable[T]]) -> set[T]:
    """Everything that is reached from some nodes, and they themselves."""
    found: set[T] = set()
    waiting = list(starts)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting.extend(following(node))
    return found


def cycle(following: Mapping[T, Iterable[T]]) -> list[T] | None:
    """A cycle among the nodes of a mapping: each is followed by the next, the last by the first; None without one."""
    inner = {node: [other for other in others if other in following] for node, others in following.items()}
    try:
        TopologicalSorter(inner).prepare()
    except CycleError as error:
        found: list[T] = error.args[1][:0:-1]  # each is followed by the one before it there, and the last is the first
        at = found.index(min(found, key=list(following).index))
        return found[at:] + found[:at]
    return None
