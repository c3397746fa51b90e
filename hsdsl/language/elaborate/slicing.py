# pyright: basic, reportAttributeAccessIssue=false
"""Slices of a system: the states that some names depend on, and no others.

A state of a mode is needed where its name is given, where a given output, a guard, a condition or a domain uses it,
where the flow of a needed state of that mode uses it, or where the reset of a needed state of the next mode does.
The rest is not part of the answer: no transition and no needed value can depend on it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace

import sympy as sp

from hsdsl.base.graphs import closure
from hsdsl.language.system import Edge, HybridSystem, Mode, started

Node = tuple[str, str]  # a mode and one of its states


def only(system: HybridSystem, given: Iterable[str]) -> HybridSystem:
    """The system with the given states and outputs and what they need; all transitions stay."""
    names = frozenset(given)
    needed = closure(_roots(system, names), _uses(system).__getitem__)
    if all((mode.name, state) in needed for mode in system.modes for state in mode.states):
        return system
    outputs = [k for k, name in enumerate(system.outputs) if name in names]
    own = _with_states(system)
    mode, states = system.initial.mode, {state for _, state in needed}
    start = [name for name, _ in system.initial.values if mode not in own or (mode, name) in needed]
    scale = tuple(item for item in system.experiment.scale if item[0] in states)
    return replace(
        system,
        modes=tuple(_mode(mode, needed, outputs, own) for mode in system.modes),
        outputs=tuple(system.outputs[k] for k in outputs),
        experiment=replace(system.experiment, scale=scale),
        initial=started(mode, start, system.initial.in_order),
    )


def left_out(system: HybridSystem, reduced: HybridSystem) -> tuple[str, ...]:
    """The states that a reduced system has in no mode or in fewer ones: ``NAME``, or ``NAME in MODE``."""
    gone: list[str] = []
    for mode, smaller in zip(system.modes, reduced.modes, strict=True):
        gone += [
            s if s not in reduced.states else f"{s} in {mode.name}" for s in mode.states if s not in smaller.states
        ]
    return tuple(dict.fromkeys(gone))


def _roots(system: HybridSystem, names: frozenset[str]) -> Iterator[Node]:
    for mode in system.modes:
        expressions = [part for s in mode.surfaces for part in (s.residual, s.left, s.right)]
        expressions += [edge.condition for edge in mode.edges if edge.condition is not None]
        outputs = zip(system.outputs, mode.outputs, strict=True)
        expressions += [output for name, output in outputs if name in names and output is not None]
        yield from _states(mode, expressions)
        yield from ((mode.name, state) for state in mode.states if state in names)


def _uses(system: HybridSystem) -> dict[Node, list[Node]]:
    uses: dict[Node, list[Node]] = defaultdict(list)
    own = _with_states(system)
    for mode in system.modes:
        for state, expression in zip(mode.states, mode.flow, strict=True):
            uses[mode.name, state] += _states(mode, [expression])
        for edge in mode.edges:
            for state, expression in edge.values.items():
                uses[_entered(own, edge, state)] += _states(mode, [expression])
    return uses


def _with_states(system: HybridSystem) -> set[str]:
    return {mode.name for mode in system.modes if mode.states}


def _entered(own: set[str], edge: Edge, state: str) -> Node:
    """The node that a reset defines: a final mode without a flow has the states of the mode it is entered from."""
    return (edge.target if edge.target in own else edge.source), state


def _states(mode: Mode, expressions: Iterable[sp.Basic]) -> Iterator[Node]:
    names = {symbol.name for expression in expressions for symbol in sp.sympify(expression).free_symbols}
    yield from ((mode.name, state) for state in mode.states if state in names)


def _mode(mode: Mode, needed: set[Node], outputs: list[int], own: set[str]) -> Mode:
    kept = [k for k, state in enumerate(mode.states) if (mode.name, state) in needed]
    gone = {(mode.name, state) for state in mode.states} - needed
    return replace(
        mode,
        states=tuple(mode.states[k] for k in kept),
        flow=tuple(mode.flow[k] for k in kept),
        flow_texts=tuple(mode.flow_texts[k] for k in kept),
        edges=tuple(_edge(edge, needed, own) for edge in mode.edges),
        outputs=tuple(mode.outputs[k] for k in outputs),
        queues=tuple(
            q.of_states([mode.states[k] for k in kept]) for q in mode.queues if (mode.name, q.waiting) in needed
        ),
        scene=tuple(None if value is None or gone & {*_states(mode, [value])} else value for value in mode.scene),
    )


def _edge(edge: Edge, needed: set[Node], own: set[str]) -> Edge:
    return edge.of_states([state for state in edge.target_states if _entered(own, edge, state) in needed])
