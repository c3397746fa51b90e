# pyright: basic, reportAttributeAccessIssue=false
"""Only what is asked: a system without the states that nothing asked for depends on.

A state of a mode is needed where it is asked for, where an asked output, a guard, a condition or a domain uses it,
where the flow of a needed state of that mode uses it, or where the reset of a needed state of the next mode does.
The rest is not part of the answer: no transition and no needed value can depend on it, whatever it does.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import sympy as sp

from hsdsl.system import Edge, HybridSystem, Mode

Node = tuple[str, str]  # a mode and one of its states


def only(system: HybridSystem, asked: Iterable[str]) -> HybridSystem:
    """Return the system with the asked states and outputs and what they need; all transitions stay."""
    wanted = frozenset(asked)
    needed = _needed(system, wanted)
    if all((mode.name, state) in needed for mode in system.modes for state in mode.states):
        return system
    outputs = [k for k, name in enumerate(system.outputs) if name in wanted]
    own = _with_states(system)
    states = {state for _, state in needed}
    scale = tuple((state, size) for state, size in system.experiment.scale if state in states)
    start = {state for mode, state in needed if mode == system.initial.mode}
    return replace(
        system,
        modes=tuple(_mode(mode, needed, outputs, own) for mode in system.modes),
        outputs=tuple(system.outputs[k] for k in outputs),
        experiment=replace(system.experiment, scale=scale),
        initial=replace(
            system.initial,
            values=tuple(v for v in system.initial.values if system.initial.mode not in own or v[0] in start),
        ),
    )


def left_out(system: HybridSystem, reduced: HybridSystem) -> tuple[str, ...]:
    """The states that a reduced system has in no mode or in fewer ones: ``NAME``, or ``NAME in MODE``."""
    gone: list[str] = []
    kept = {state for mode in reduced.modes for state in mode.states}
    for mode, smaller in zip(system.modes, reduced.modes, strict=True):
        gone += [s if s not in kept else f"{s} in {mode.name}" for s in mode.states if s not in smaller.states]
    return tuple(dict.fromkeys(gone))


def _needed(system: HybridSystem, wanted: frozenset[str]) -> set[Node]:
    uses = _uses(system)
    needed: set[Node] = set()
    waiting = list(_roots(system, wanted))
    while waiting:
        node = waiting.pop()
        if node not in needed:
            needed.add(node)
            waiting += uses.get(node, ())
    return needed


def _roots(system: HybridSystem, wanted: frozenset[str]) -> Iterator[Node]:
    for mode in system.modes:
        expressions = [edge.surface.residual for edge in mode.edges] + [wall.residual for wall in mode.walls]
        expressions += [part for edge in mode.edges for part in (edge.surface.left, edge.surface.right)]
        expressions += [part for wall in mode.walls for part in (wall.left, wall.right)]
        expressions += [edge.condition for edge in mode.edges if edge.condition is not None]
        expressions += [
            e for name, e in zip(system.outputs, mode.outputs, strict=True) if name in wanted and e is not None
        ]
        yield from _states(mode, expressions)
        yield from ((mode.name, state) for state in mode.states if state in wanted)


def _uses(system: HybridSystem) -> dict[Node, list[Node]]:
    uses: dict[Node, list[Node]] = {}
    own = _with_states(system)
    for mode in system.modes:
        for state, expression in zip(mode.states, mode.flow, strict=True):
            uses.setdefault((mode.name, state), []).extend(_states(mode, [expression]))
        for edge in mode.edges:
            for state, expression in zip(edge.target_states, edge.reset, strict=True):
                uses.setdefault(_entered(own, edge, state), []).extend(_states(mode, [expression]))
    return uses


def _with_states(system: HybridSystem) -> set[str]:
    return {mode.name for mode in system.modes if mode.states}


def _entered(own: set[str], edge: Edge, state: str) -> Node:
    """What a reset gives a value to: a final mode without a flow has the states of the mode it is entered from."""
    return (edge.target if edge.target in own else edge.source), state


def _states(mode: Mode, expressions: Iterable[sp.Basic]) -> Iterator[Node]:
    names = {symbol.name for expression in expressions for symbol in sp.sympify(expression).free_symbols}
    yield from ((mode.name, state) for state in mode.states if state in names)


def _mode(mode: Mode, needed: set[Node], outputs: list[int], own: set[str]) -> Mode:
    kept = [k for k, state in enumerate(mode.states) if (mode.name, state) in needed]
    return replace(
        mode,
        states=tuple(mode.states[k] for k in kept),
        flow=tuple(mode.flow[k] for k in kept),
        flow_texts=tuple(mode.flow_texts[k] for k in kept),
        edges=tuple(_edge(edge, needed, own) for edge in mode.edges),
        outputs=tuple(mode.outputs[k] for k in outputs),
    )


def _edge(edge: Edge, needed: set[Node], own: set[str]) -> Edge:
    kept = [k for k, state in enumerate(edge.target_states) if _entered(own, edge, state) in needed]
    return replace(
        edge,
        target_states=tuple(edge.target_states[k] for k in kept),
        reset=tuple(edge.reset[k] for k in kept),
        reset_texts=tuple(edge.reset_texts[k] for k in kept),
    )
