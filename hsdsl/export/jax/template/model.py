# pyright: basic, reportCallIssue=false
"""What is generated from a model, and its routines as functions of the mode's number, with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .functions import padded


@dataclass(frozen=True)
class Mode:
    """A mode: its name, the numbers of its states among those of all modes, and its routines.

    A routine takes (p, t, x); vectors are as wide as in the widest mode. ``edges`` are numbers among all
    edges.
    """

    name: str
    states: tuple[int, ...]
    final: bool
    edges: tuple[int, ...]
    walls: int
    flow: Callable
    surfaces: Callable
    magnitudes: Callable
    gradients: Callable
    rates: Callable
    conditions: Callable
    outputs: Callable


def mode_of(name, states, final, edges, sizes, flow, surfaces, magnitudes, gradients, rates, conditions, outputs):
    """A mode of plain routines, which return a tuple each, padded to ``sizes`` (W, M, outputs)."""
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


def with_derivatives(branches):
    """One function of (index, p, t, x) of several; only the branch that is chosen has derivatives.

    Matrices of derivatives are chosen before they are applied, so that not-a-number in another branch spreads nowhere.
    """

    @jax.custom_jvp
    def call(index, p, t, x):
        return jax.lax.switch(index, branches, p, t, x)

    @call.defjvp
    def _(primals, tangents):
        index, p, t, x = primals
        _, dp, dt, dx = tangents
        slopes = [lambda p, t, x, f=f: jax.jacfwd(f, (0, 1, 2))(p, t, x) for f in branches]
        by_p, by_t, by_x = jax.lax.switch(index, slopes, p, t, x)
        return call(index, p, t, x), by_p @ dp + by_t * dt + by_x @ dx

    return jax.jit(call)  # a function of its own is traced once


def plainly(branches):
    """One function of (index, ...) of several."""
    return jax.jit(lambda index, *arguments: jax.lax.switch(index, branches, *arguments))


@dataclass(frozen=True)
class Routines:
    """All that a run calls, by the number of the mode or edge."""

    flow: Any
    surfaces: Any
    magnitudes: Any
    gradients: Any
    rates: Any
    conditions: Any
    outputs: Any
    reset: Any
    spread: Any


class Model:
    """Modes, edges, a timeline, and tables of them; M surfaces in the mode with most, W states."""

    def __init__(self, modes, edges, states, width, outputs, method, timeline):
        self.modes, self.edges, self.states, self.outputs = modes, edges, states, outputs
        self.method, self.timeline = method, timeline
        self.W, self.S = max(width, 1), max(len(states), 1)
        self.M = max(1, *(len(mode.edges) + mode.walls for mode in modes))
        self.routines = Routines(
            with_derivatives([mode.flow for mode in modes]),
            with_derivatives([mode.surfaces for mode in modes]),
            *(
                plainly([getattr(mode, name) for mode in modes])
                for name in ("magnitudes", "gradients", "rates", "conditions")
            ),
            with_derivatives([mode.outputs for mode in modes]),
            with_derivatives([edge.reset for edge in edges] or [lambda p, t, x: x]),
            plainly([edge.spread for edge in edges] or [lambda p, t, x, s: s]),
        )
        self._tabulate()

    def _tabulate(self):
        modes, edges = self.modes, self.edges
        count, width = len(modes), self.M
        self.final = np.array([mode.final for mode in modes])
        self.is_edge, self.is_wall = np.zeros((count, width), bool), np.zeros((count, width), bool)
        self.conditional, self.loops = np.zeros((count, width), bool), np.zeros((count, width), bool)
        self.priority, self.edge = np.zeros((count, width), int), np.zeros((count, width), int)
        self.place = np.full((count, self.W), -1)
        for j, mode in enumerate(modes):
            own = len(mode.edges)
            self.is_edge[j, :own] = True
            self.is_wall[j, own : own + mode.walls] = True
            self.place[j, : len(mode.states)] = mode.states
            for k, number in enumerate(mode.edges):
                edge = edges[number]
                self.edge[j, k], self.priority[j, k] = number, edge.priority
                self.conditional[j, k] = edge.conditional
                self.loops[j, k] = edge.target == j and edge.states == mode.states
        self.dimension = np.array([len(mode.states) for mode in modes])
        self.target = np.array([edge.target for edge in edges] or [0])
        self.target_place = np.full((max(len(edges), 1), self.W), -1)
        for number, edge in enumerate(edges):
            self.target_place[number, : len(edge.states)] = edge.states

    @property
    def transparent(self):
        """Whether a state may be beyond a surface without having crossed it."""
        return bool(self.conditional.any())

    def of(self, table, mode):
        """A row of a table that has one for each mode."""
        return jnp.asarray(table)[mode]

    def segment(self, p, t):
        """The number of the segment of inputs that a time is in; at a boundary the later one."""
        starts = self.timeline(p)[0]
        return jnp.maximum(jnp.searchsorted(starts, t, side="right") - 1, 0)


class Bound:
    """A model with the numbers of one segment of its inputs."""

    def __init__(self, model, p, segment):
        starts, ends, jumps, data = model.timeline(p)
        self.model, self.routines = model, model.routines
        self.end, self.last = ends[segment], segment + 1 >= len(starts)
        self.next_jumps = jumps[jnp.minimum(segment + 1, len(starts) - 1)]
        self.p = jnp.concatenate([p, data[segment]])

    def flow(self, mode, t, x):
        """The flow, W numbers."""
        return self.routines.flow(mode, self.p, t, x)

    def surfaces(self, mode, t, x):
        """Values of the surfaces, M numbers, -1 behind those of the mode."""
        return self.routines.surfaces(mode, self.p, t, x)

    def gradients(self, mode, t, x):
        """Gradients of the surfaces in (t, x), M rows of 1 + W numbers."""
        return self.routines.gradients(mode, self.p, t, x)

    def rates(self, mode, t, x):
        """Rates of the surfaces along the flow, M numbers."""
        return self.routines.rates(mode, self.p, t, x)

    def conditions(self, mode, t, x):
        """Whether the `if` of each edge holds; true of walls, M of them."""
        return self.routines.conditions(mode, self.p, t, x)

    def noise(self, mode, t, x, scale):
        """Round-off of each surface at a point, whose numbers were computed from those of sizes (M, W) or (W)."""
        gradient = self.gradients(mode, t, x)
        known = jnp.isfinite(gradient.sum(axis=-1))
        sizes = jnp.maximum(jnp.abs(x), scale)
        terms = jnp.abs(gradient[:, 0]) * jnp.abs(t) + (jnp.abs(gradient[:, 1:]) * sizes).sum(axis=-1)
        return 32 * 2.0**-53 * (self.routines.magnitudes(mode, self.p, t, x) + jnp.where(known, terms, 0.0))

    def norm(self, mode, t, x):
        """Sizes of the gradients."""
        gradient = self.gradients(mode, t, x)
        return jnp.sqrt((gradient * gradient).sum(axis=-1))
