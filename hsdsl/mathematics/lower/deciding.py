# pyright: basic
"""States that decide nothing: no surface, condition or state that decides depends on them, now or in a later mode."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from typing import Any

import sympy as sp

from hsdsl.base.graphs import closure
from hsdsl.language.expression.scope import symbol
from hsdsl.language.system import HybridSystem, Mode
from hsdsl.mathematics.lower.mode import changed_by

Node = tuple[str, Any]  # a mode, and the symbol of one of its states
Found = dict[sp.Basic, frozenset[Any]]


def idle_states(system: HybridSystem) -> list[tuple[int, ...]]:
    """The numbers of the states of each mode that decide nothing, as counters do and what is only shown."""
    uses: dict[Node, set[Node]] = defaultdict(set)
    modes, found = {mode.name: mode for mode in system.modes}, Found()
    roots: list[Node] = []
    for mode in system.modes:
        conditions = [edge.condition for edge in mode.edges if edge.condition is not None]
        sides = [side for surface in mode.surfaces for side in (surface.residual, surface.left, surface.right)]
        roots += _nodes(mode, [*conditions, *sides], found)
        for state, flow in zip(mode.states, mode.flow, strict=True):
            uses[mode.name, symbol(state)] |= _nodes(mode, [flow], found)
        for edge in mode.edges:
            for i in changed_by(edge, mode) if modes[edge.target].states else ():
                uses[edge.target, symbol(edge.target_states[i])] |= _nodes(mode, [edge.reset[i]], found)
    needed = closure(roots, lambda node: uses.get(node, ()))
    return [
        tuple(i for i, state in enumerate(mode.states) if (mode.name, symbol(state)) not in needed)
        for mode in system.modes
    ]


def _nodes(mode: Mode, expressions: Iterable[Any], found: Found) -> set[Node]:
    return {(mode.name, name) for e in expressions for name in _symbols(sp.sympify(e), found)}


def _symbols(expression: sp.Basic, found: Found) -> frozenset[Any]:
    """The symbols of an expression whose parts may be the same many times over."""
    if expression not in found:
        own = [expression] if expression.is_Symbol else []
        found[expression] = frozenset(own).union(*(_symbols(part, found) for part in expression.args))
    return found[expression]
