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
    facts: Callable
    outputs: Callable


class Facts(NamedTuple):
    """Surfaces at a point: values, -1 behind those of the mode; rates along the flow; gradients in (t, x), M rows of
    1 + W numbers; magnitudes of terms; whether the `if` of each edge holds, true of walls.
    """

    values: Any
    rates: Any
    gradients: Any
    magnitudes: Any
    conditions: Any


def mode_of(
    name,
    states,
    final,
    edges,
    contact,
    sizes,
    flow,
    surfaces,
    magnitudes,
    gradients,
    rates,
    conditions,
    outputs,
    flags=(),
):
    """A mode of plain routines, which return a tuple each, padded to ``sizes`` (W, M, outputs).

    ``contact`` has the fields of `Mode` from ``contacts`` on, ``flags`` the numbers of contacts, which routines of
    motions along guards take behind the others.
    """

    def with_flags(routine):
        return (lambda p, t, x: routine(jnp.concatenate([p, jnp.asarray(flags)]), t, x)) if flags else routine

    flow, surfaces, magnitudes, outputs = map(with_flags, (flow, surfaces, magnitudes, outputs))
    gradients, rates = list(map(with_flags, gradients)), list(map(with_flags, rates))
    conditions = [list(map(with_flags, parts)) for parts in conditions]
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
        terms = padded(magnitudes(p, t, x), count)
        return Facts(values(p, t, x), along, all_gradients(p, t, x), terms, all_conditions(p, t, x))

    return Mode(
        name,
        states,
        final,
        edges,
        len(rates) - len(edges),
        *contact,
        lambda p, t, x: padded(flow(p, t, x), width),
        values,
        facts,
        lambda p, t, x: padded(outputs(p, t, x), results),
    )


def edge_of(name, source, target, states, conditional, priority, counts, width, reset, spread, slow):
    """An edge of plain routines; ``slow`` is its reset, or the branch of that which slow impacts take."""
    return Edge(
        name,
        source,
        target,
        states,
        conditional,
        priority,
        counts,
        lambda p, t, x: padded(reset(p, t, x), width),
        lambda p, t, x, s: padded(spread(p, t, x, s), width),
        lambda p, t, x: padded(slow(p, t, x), width),
    )


@dataclass(frozen=True)
class Edge:
    """An edge between modes, given by their numbers, as the states of its target and those that it counts with."""

    name: str
    source: int
    target: int
    states: tuple[int, ...]
    conditional: bool
    priority: int
    counts: tuple[int, ...]
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
