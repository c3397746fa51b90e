# pyright: basic
"""The timer of modes that use `since`: a state of theirs that flows at 1, and that every transition sets to 0."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from hsdsl.base.names import SINCE
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import ONE, ZERO, Edge, HybridSystem, Initial, Mode

_TIMER = symbol(SINCE)


def with_timers(system: HybridSystem) -> HybridSystem:
    """The system with the state `since` in every mode whose expressions use it, and in no other."""
    own = {mode.name: not (mode.final and not mode.states) for mode in system.modes}
    timed = {mode.name for mode in system.modes if own[mode.name] and any(map(_uses, _parts(mode)))}
    given, start = dict(system.initial.values), system.initial
    if not timed:
        return replace(system, initial=_without(system)) if SINCE in given else system
    if SINCE not in given:
        start = replace(start, values=(*start.values, (SINCE, ZERO)))
        start = replace(start, written=(*start.written, (SINCE, ZERO)) if start.written else ())
    unit = {SINCE: system.units["t"]} if "t" in system.units else {}
    return replace(
        system, modes=tuple(_mode(mode, timed, own) for mode in system.modes), initial=start, units=system.units | unit
    )


def _without(system: HybridSystem) -> Initial:
    initial = system.initial
    kept = [tuple(pair for pair in pairs if pair[0] != SINCE) for pairs in (initial.values, initial.written)]
    return replace(initial, values=kept[0], written=kept[1])


def _uses(expression: Any) -> bool:
    return _TIMER in getattr(expression, "free_symbols", ())


def _parts(mode: Mode) -> Iterator[Any]:
    yield from (*mode.flow, *mode.outputs, *mode.scene)
    yield from (side for s in mode.surfaces for side in (s.residual, s.left, s.right))
    for edge in mode.edges:
        yield from (edge.condition, *edge.reset)


def _mode(mode: Mode, timed: set[str], own: dict[str, bool]) -> Mode:
    edges = tuple(_edge(edge, timed, own) for edge in mode.edges)
    if mode.name not in timed:
        return replace(mode, edges=edges)
    states, flow = (*mode.states, SINCE), (*mode.flow, ONE)
    return replace(mode, states=states, flow=flow, flow_texts=(*mode.flow_texts, "1"), edges=edges)


def _edge(edge: Edge, timed: set[str], own: dict[str, bool]) -> Edge:
    """An edge that starts the timer of its target; a final mode without a flow keeps that of its source."""
    kept = not own[edge.target] and edge.source in timed
    if edge.target not in timed and not kept:
        return edge
    value, text = (_TIMER, SINCE) if kept or edge.stays else (ZERO, "0")
    return replace(
        edge,
        target_states=(*edge.target_states, SINCE),
        reset=(*edge.reset, value),
        reset_texts=(*edge.reset_texts, text),
    )
