# pyright: basic, reportCallIssue=false
"""A model and its routines as functions of the mode's number, with derivatives."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


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
    facts: Any
    outputs: Any
    reset: Any
    spread: Any
    slow: Any


class Model:
    """Modes, edges, a timeline, and tables of them; M surfaces in the mode with most, W states."""

    def __init__(self, modes, edges, states, width, outputs, method, timeline, surfaces=1):
        self.modes, self.edges, self.states, self.outputs = modes, edges, states, outputs
        self.method, self.timeline = method, timeline
        self.W, self.S = max(width, 1), max(len(states), 1)
        self.M = max(surfaces, *(len(mode.edges) + mode.walls for mode in modes))
        self.routines = Routines(
            with_derivatives([mode.flow for mode in modes]),
            with_derivatives([mode.surfaces for mode in modes]),
            plainly([mode.facts for mode in modes]),
            with_derivatives([mode.outputs for mode in modes]),
            with_derivatives([edge.reset for edge in edges] or [lambda p, t, x: x]),
            plainly([edge.spread for edge in edges] or [lambda p, t, x, s: s]),
            with_derivatives([edge.slow for edge in edges] or [lambda p, t, x: x]),
        )
        self._tabulate()

    def _tabulate(self):
        modes, edges, shape = self.modes, self.edges, (len(self.modes), self.M)
        self.final = np.array([mode.final for mode in modes])
        self.owner, self.push_order = np.array([m.owner for m in modes]), np.array([m.push_order for m in modes])
        self.dimension = np.array([len(mode.states) for mode in modes])
        self.is_edge, self.is_wall, self.conditional, self.loops, self.releases = np.zeros((5, *shape), bool)
        self.priority, self.edge = np.zeros((2, *shape), int)
        self.contact, self.of_owner, self.in_contact = np.full((3, *shape), -1)
        self.place = np.full((len(modes), self.W), -1)
        for j, mode in enumerate(modes):
            own, count = len(mode.edges), len(mode.edges) + mode.walls
            self.is_edge[j, :own] = True
            self.is_wall[j, own:count] = True
            self.place[j, : len(mode.states)] = mode.states
            self.contact[j, :own], self.releases[j, :own] = mode.contacts, mode.releases
            for k, number in enumerate(mode.edges):
                edge = edges[number]
                self.edge[j, k], self.priority[j, k] = number, edge.priority
                self.conditional[j, k] = edge.conditional and not mode.releases[k]
                self.loops[j, k] = edge.target == mode.owner and edge.states == mode.states
            if mode.owner != j:
                self._relate(j, len(modes[mode.owner].edges), own, mode.walls)
        self.holds = bool((self.contact >= 0).any())
        self.target = np.array([edge.target for edge in edges] or [0])
        self.counts = np.zeros((max(1, len(edges)), self.W), bool)
        for k, edge in enumerate(edges):
            self.counts[k, list(edge.counts)] = True
        # whose outputs a run has behind an edge: a final mode without a flow keeps the states before, and these
        keepers = [e.source if e.states and not modes[e.target].states else e.target for e in edges]
        self.keeper = np.array(keepers or [0])

    def _relate(self, j, edges, own, walls):
        """The surfaces of a motion along a guard among those of its mode, and the other way round."""
        for k in range(edges):
            self.of_owner[j, k] = self.in_contact[j, k] = k
        for k in range(walls):
            self.of_owner[j, own + k], self.in_contact[j, edges + k] = edges + k, own + k

    @cached_property
    def free(self):
        """The same without motions along guards, which the relaxed scheme has not."""
        own = [mode for j, mode in enumerate(self.modes) if mode.owner == j]
        modes = tuple(replace(mode, contacts=(-1,) * len(mode.contacts)) for mode in own)
        return Model(modes, self.edges, self.states, self.W, self.outputs, self.method, self.timeline, self.M)

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

    def facts(self, mode, t, x):
        """The `Facts` of a point, or those of many (rows)."""
        if jnp.ndim(t) == 0:
            return self.routines.facts(mode, self.p, t, x)
        return jax.vmap(lambda t, x: self.routines.facts(mode, self.p, t, x))(t, x)


def noise_of(facts, t, x, scale):
    """Round-off of each surface at a point, whose numbers were computed from those of sizes (M, W) or (W)."""
    gradient = facts.gradients
    known = jnp.isfinite(gradient.sum(axis=-1))
    sizes = jnp.maximum(jnp.abs(x)[..., None, :], scale)
    terms = jnp.abs(gradient[..., 0]) * jnp.abs(t)[..., None] + (jnp.abs(gradient[..., 1:]) * sizes).sum(axis=-1)
    return 32 * 2.0**-53 * (facts.magnitudes + jnp.where(known, terms, 0.0))


def norm_of(facts):
    """Sizes of the gradients."""
    return jnp.sqrt((facts.gradients * facts.gradients).sum(axis=-1))
