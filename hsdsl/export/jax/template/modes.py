# pyright: basic, reportCallIssue=false
"""What is generated from a model: modes, edges, the table of a method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax.numpy as jnp

from .functions import padded


@dataclass(frozen=True)
class Mode:
    """A mode: its name, the numbers of its states among those of all modes, and its routines.

    ``owner`` is another mode's number where this one is the motion along the guard of its edge ``held``; ``releases``
    says which of its edges end that, ``push_order`` which derivative presses. ``contacts`` are numbers of such motions,
    -1 for none.

    A routine takes (p, t, x); vectors are as wide as in the widest mode. ``edges`` are numbers among all
    edges.
    """

    name: str
    states: tuple[int, ...]
    final: bool
    edges: tuple[int, ...]
    walls: int
    contacts: tuple[int, ...]
    releases: tuple[bool, ...]
    owner: int
    held: int
    push_order: int
    flow: Callable
    surfaces: Callable
    magnitudes: Callable
    gradients: Callable
    rates: Callable
    conditions: Callable
    outputs: Callable


def mode_of(
    name, states, final, edges, contact, sizes, flow, surfaces, magnitudes, gradients, rates, conditions, outputs
):
    """A mode of plain routines, which return a tuple each, padded to ``sizes`` (W, M, outputs).

    ``contact`` has the fields of `Mode` from ``contacts`` on.
    """
    width, count, results = sizes
    rest = count - len(rates)

    def all_gradients(p, t, x):
        rows = [padded(gradient(p, t, x), width + 1) for gradient in gradients]
        return jnp.stack(rows + [jnp.zeros(width + 1)] * rest)

    def all_conditions(p, t, x):
        holds = [jnp.stack([part(p, t, x)[0] for part in parts]).all() for parts in conditions]
        return jnp.stack(holds + [jnp.asarray(True)] * (count - len(holds)))

    return Mode(
        name,
        states,
        final,
        edges,
        len(rates) - len(edges),
        *contact,
        lambda p, t, x: padded(flow(p, t, x), width),
        lambda p, t, x: padded(surfaces(p, t, x), count, -1.0),
        lambda p, t, x: padded(magnitudes(p, t, x), count),
        all_gradients,
        lambda p, t, x: padded([rate(p, t, x)[0] for rate in rates], count),
        all_conditions,
        lambda p, t, x: padded(outputs(p, t, x), results),
    )


def edge_of(name, source, target, states, conditional, priority, width, reset, spread):
    """An edge of plain routines."""
    return Edge(
        name,
        source,
        target,
        states,
        conditional,
        priority,
        lambda p, t, x: padded(reset(p, t, x), width),
        lambda p, t, x, s: padded(spread(p, t, x, s), width),
    )


@dataclass(frozen=True)
class Edge:
    """An edge between modes, given by their numbers; ``keeps`` says that both have the same states."""

    name: str
    source: int
    target: int
    states: tuple[int, ...]
    conditional: bool
    priority: int
    reset: Callable
    spread: Callable


@dataclass(frozen=True)
class Method:
    """A table of an explicit method: rows of (stage, weight); stage ``stages`` is the flow at the step's end."""

    name: str
    order: int
    stages: int
    extra: int
    interpolant: str
    nodes: tuple
    a: tuple
    b: tuple
    error: tuple
    coarse: tuple
    dense: tuple
