# pyright: basic
"""Transitions followed with numbers, as long as they fire at one instant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hsdsl.expression.scope import symbol
from hsdsl.lint.analysis.dynamics import Dynamics
from hsdsl.system import Edge, Mode

MOST = 40
_NEAR = 1e-9


@dataclass(frozen=True)
class Cycle:
    """The edges that follow each other without end."""

    edges: tuple[str, ...]


def cycle(dynamics: Dynamics, edge: Edge, point: Mapping[Any, float]) -> Cycle | None:
    """The cycle that transitions run into which follow an edge at one instant; None where they end."""
    if not point:
        return None
    visited: list[tuple[str, tuple[float, ...]]] = []
    names: list[str] = []
    here: Edge | None = edge
    values = dict(point)
    while here is not None and len(names) <= MOST:
        values = _after(dynamics, here, values)
        names.append(here.name)
        state = (here.target, tuple(values[symbol(s)] for s in here.target_states))
        for k, before in enumerate(visited):
            if before[0] == state[0] and _close(before[1], state[1]):
                return Cycle(tuple(names[k + 1 :]))
        visited.append(state)
        here = _next(dynamics, dynamics.modes[here.target], values)
    return None


def _after(dynamics: Dynamics, edge: Edge, values: dict[Any, float]) -> dict[Any, float]:
    source = {symbol(s) for s in dynamics.modes[edge.source].states}
    kept = {s: v for s, v in values.items() if s not in source}
    new = {
        symbol(s): dynamics.value(dynamics.placed(r), values)
        for s, r in zip(edge.target_states, edge.reset, strict=True)
    }
    return kept | new


def _close(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= _NEAR * (1 + abs(a)) for a, b in zip(one, other, strict=True))


def _next(dynamics: Dynamics, mode: Mode, values: Mapping[Any, float]) -> Edge | None:
    """The edge that fires at once: beyond its surface (M5), or on it with the flow pointing out."""
    for edge in sorted(mode.edges, key=lambda e: -e.priority):
        residual = dynamics.residual(edge.surface)
        value = dynamics.value(residual, values)
        if value > _NEAR and edge.condition is None:
            return edge
        if abs(value) <= _NEAR:
            rate = dynamics.rate(mode, residual)
            out = rate is not None and dynamics.value(rate, values) > _NEAR
            if out and _holds(dynamics, edge, values):
                return edge
    return None


def _holds(dynamics: Dynamics, edge: Edge, values: Mapping[Any, float]) -> bool:
    clauses = dynamics.condition(edge) or ()
    return any(all(dynamics.value(c.expr, values) <= 0 for c in clause) for clause in clauses)
