# pyright: basic, reportCallIssue=false
"""What is generated from a model: modes, edges, the table of a method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax.numpy as jnp

from .functions import padded


@dataclass(frozen=True)
class Mode:
    """A mode: its name, the numbers of its states among those of all modes, and its routines.

    ``owner`` is another mode's number where this one is that with its motions along guards, ``held`` the number of that
    one, or -1. ``contacts`` are the numbers of contacts of the owner's edges, -1 for none, ``releases`` of those that
    this mode's edges end; ``orders`` say which derivative presses. States that are ``idle`` decide no transition.

    A routine takes (p, t, x); vectors are as wide as in the widest mode. ``edges`` are numbers among all
    edges.
    """

    name: str
    states: tuple[int, ...]
    final: bool
    edges: tuple[int, ...]
    walls: int
    owner: int
    held: int
    contacts: tuple[int, ...]
    releases: tuple[int, ...]
    orders: tuple[int, ...]
    idle: tuple[int, ...]
    flow: Callable
    surfaces: Callable
    facts: Callable
    outputs: Callable


class Facts(NamedTuple):
    """Surfaces at a point: values, -1 after those of the mode; rates along the flow and ``spans``, the sizes of their
    terms; gradients in (t, x), M rows of 1 + W numbers; magnitudes of terms; whether the `if` of each edge holds, true
    of walls.
    """

    values: Any
    rates: Any
    spans: Any
    gradients: Any
    magnitudes: Any
    conditions: Any


def mode_of(head, sizes, flow, surfaces, magnitudes, gradients, rates, conditions, outputs):
    """A mode of its fields up to the routines, and plain routines, which return tuples, padded to (W, M, outputs)."""
    width, count, results = sizes
    rest = count - len(rates)

    def all_gradients(p, t, x):
        rows = [padded(gradient(p, t, x), width + 1) for gradient in gradients]
        return jnp.stack(rows + [jnp.zeros(width + 1)] * rest)

    def all_conditions(p, t, x):
        holds = [jnp.stack([part(p, t, x)[0] for part in parts]).all() for parts in conditions]
        return jnp.stack(holds + [jnp.asarray(True)] * (count - len(holds)))

    def values(p, t, x):
        return padded(surfaces(p, t, x), count, -1.0)

    def facts(p, t, x):
        along = padded([rate(p, t, x)[0] for rate in rates], count)
        terms, slopes = padded(magnitudes(p, t, x), count), all_gradients(p, t, x)
        spans = jnp.abs(slopes[:, 0]) + jnp.abs(slopes[:, 1:]) @ jnp.abs(padded(flow(p, t, x), width))
        return Facts(values(p, t, x), along, spans, slopes, terms, all_conditions(p, t, x))

    results_of = (lambda p, t, x: padded(flow(p, t, x), width)), values, facts
    return Mode(*head, *results_of, lambda p, t, x: padded(outputs(p, t, x), results))


def edge_of(head, width, reset, spread, slow):
    """An edge of its fields up to the routines, and plain ones; ``slow`` is the branch of slow impacts."""
    return Edge(
        *head,
        lambda p, t, x: padded(reset(p, t, x), width),
        lambda p, t, x, s: padded(spread(p, t, x, s), width),
        lambda p, t, x: padded(slow(p, t, x), width),
    )


@dataclass(frozen=True)
class Edge:
    """An edge between modes, given by their numbers; the states of its target, those it counts with, and changes.

    ``queues`` are states of its mode: the number of executions of an event that wait, the time and values of the first.
    ``tails`` is 0 where it makes one of these, since that ends, 2 of another event, 1 else.
    """

    name: str
    source: int
    target: int
    states: tuple[int, ...]
    conditional: bool
    priority: int
    counts: tuple[int, ...]
    changes: tuple[int, ...]
    queues: tuple[tuple[int, ...], ...]
    tails: int
    reset: Callable
    spread: Callable
    slow: Callable


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
