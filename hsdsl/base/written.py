"""Modes and edges as the file has them: one edge for each event, in place of those that make it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import Any, Protocol, TypeVar


class _Edge(Protocol):
    @property
    def name(self) -> str: ...

    @property
    def source(self) -> Any: ...

    @property
    def target(self) -> Any: ...

    @property
    def of_event(self) -> tuple[str, ...]: ...


class _Mode(Protocol):
    @property
    def name(self) -> str: ...

    @property
    def edges(self) -> Sequence[_Edge]: ...


E = TypeVar("E", bound=_Edge)
M = TypeVar("M", bound=_Mode)


def written_edges(edges: Iterable[E], also: Collection[Any] = ()) -> list[E]:
    """The edges of a mode, of each event only its own one; of those into the modes ``also`` the first."""
    found: dict[Any, E] = {}
    for k, edge in enumerate(edges):
        key = (edge.name,) if edge.of_event else k
        if not _is_inner(edge) or edge.target in also:
            found.setdefault(key, edge)
    return list(found.values())


def _is_inner(edge: _Edge) -> bool:
    """Whether an edge only changes what an event remembers, or ends a run."""
    return bool(edge.of_event) and edge.name != edge.of_event[0]


def inner_modes(modes: Iterable[_Mode]) -> set[Any]:
    """The modes in which runs end where too many executions of an event wait, as edges name them."""
    return {e.target for mode in modes for e in mode.edges if _is_inner(e) and e.target != e.source}


def written_modes(modes: Sequence[M]) -> list[M]:
    """The modes of the file."""
    inner = inner_modes(modes)
    return [mode for k, mode in enumerate(modes) if k not in inner and mode.name not in inner]


def event_text(of_event: Sequence[str]) -> list[str]:
    """How an event is written, key by key; nothing for another edge."""
    return [f"event {of_event[1]}", *of_event[2:]] if of_event else []
