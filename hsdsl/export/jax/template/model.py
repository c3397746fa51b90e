# pyright: basic, reportCallIssue=false
"""A model and its routines as functions of the mode's number, with derivatives."""

from __future__ import annotations

from copy import copy
from types import SimpleNamespace

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


LOOKED_AT, HELD = 1.0, 2.0  # what the number of a contact is, 0 for none


class Model:
    """Modes, edges, a timeline, and tables of them; M surfaces in the mode with most, W states, C contacts."""

    def __init__(self, modes, edges, states, width, outputs, method, timeline, contacts, until):
        self.modes, self.edges, self.states, self.outputs = modes, edges, states, outputs
        self.method, self.timeline, self.until = method, timeline, until
        self.W, self.S, self.C = max(width, 1), max(len(states), 1), contacts
        self.M = max(1, *(len(mode.edges) + mode.walls for mode in modes))
        self.routines = SimpleNamespace(  # by the number of the mode or edge
            flow=with_derivatives([mode.flow for mode in modes]),
            surfaces=with_derivatives([mode.surfaces for mode in modes]),
            facts=plainly([mode.facts for mode in modes]),
            outputs=with_derivatives([mode.outputs for mode in modes]),
            reset=with_derivatives([edge.reset for edge in edges] or [lambda p, t, x: x]),
            spread=plainly([edge.spread for edge in edges] or [lambda p, t, x, s: s]),
            slow=with_derivatives([edge.slow for edge in edges] or [lambda p, t, x: x]),
        )
        self._tabulate()

    def _tabulate(self):
        modes, edges, shape = self.modes, self.edges, (len(self.modes), self.M)
        self.final = np.array([mode.final for mode in modes])
        self.owner, self.held = np.array([mode.owner for mode in modes]), np.array([mode.held for mode in modes])
        self.dimension = np.array([len(mode.states) for mode in modes])
        self.is_edge, self.is_wall, self.conditional, self.loops = np.zeros((4, *shape), bool)
        self.priority, self.edge, self.order = np.zeros((3, *shape), int)
        self.contact, self.releases, self.of_owner, self.of_held = np.full((4, *shape), -1)
        self.place, self.idle = np.full((len(modes), self.W), -1), np.zeros((len(modes), self.W), bool)
        for j, mode in enumerate(modes):
            own, count = len(mode.edges), len(mode.edges) + mode.walls
            self.is_edge[j, :own] = True
            self.is_wall[j, own:count] = True
            self.place[j, : len(mode.states)], self.idle[j, list(mode.idle)] = mode.states, True
            plain = len(mode.contacts)
            self.contact[j, :plain], self.order[j, :plain] = mode.contacts, mode.orders
            self.releases[j, :own] = mode.releases
            for k, number in enumerate(mode.edges):
                edge = edges[number]
                self.edge[j, k], self.priority[j, k] = number, edge.priority
                self.conditional[j, k] = edge.conditional and k < plain
                self.loops[j, k] = edge.target == mode.owner and edge.states == mode.states
            self.of_owner[j, :plain] = self.of_held[mode.owner, :plain] = range(plain)
            for k in range(mode.walls):  # beyond what ends an `if`
                self.of_owner[j, own + k], self.of_held[mode.owner, plain + k] = plain + k, own + k
        self.holds = bool((self.contact >= 0).any())
        self.target = np.array([edge.target for edge in edges] or [0])
        self.counts, self.changes = np.zeros((2, max(1, len(edges)), self.W), bool)
        self.waiting, self.at = np.full((2, max(1, len(edges)), self.W), -1)
        self.tails = np.array([edge.tails for edge in edges] or [0])
        self.returns = np.array([edge.source == edge.target for edge in edges] or [False])
        self.source = np.array([edge.source for edge in edges] or [0])
        for k, edge in enumerate(edges):
            self.counts[k, list(edge.counts)] = self.changes[k, list(edge.changes)] = True
            for waiting, *values in edge.queues:
                self.waiting[k, values], self.at[k, values] = waiting, values[0]
        # whose outputs a run has after an edge: a final mode without a flow keeps the states before, and these
        keepers = [e.source if e.states and not modes[e.target].states else e.target for e in edges]
        self.keeper = np.array(keepers or [0])

    @property
    def transparent(self):
        """Whether a state may be beyond a surface without having crossed it."""
        return bool(self.conditional.any())

    def of(self, table, mode):
        """A row of a table that has one for each mode."""
        return jnp.asarray(table)[mode]

    def decisive(self, mode, x):
        """What of a state decides how a run goes on: a cascade that only counts comes back to it."""
        return jnp.where(self.of(self.idle, mode), 0.0, x)

    def segment(self, p, t):
        """The number of the segment of inputs that a time is in; at a boundary the later one."""
        starts = self.timeline(p)[0]
        return jnp.maximum(jnp.searchsorted(starts, t, side="right") - 1, 0)


class Bound:
    """A model with the numbers of one segment of its inputs, and those of contacts (`HELD`, `LOOKED_AT`, 0)."""

    def __init__(self, model, p, segment, contacts=None):
        starts, ends, jumps, data = model.timeline(p)
        self.model, self.routines = model, model.routines
        self.end, self.last = ends[segment], segment + 1 >= len(starts)
        self.next_jumps = jumps[jnp.minimum(segment + 1, len(starts) - 1)]
        self.own = jnp.concatenate([p, data[segment]])
        self.p = jnp.concatenate([self.own, jnp.zeros(model.C) if contacts is None else contacts])

    def touching(self, contacts):
        """The same with other numbers of contacts."""
        other = copy(self)
        other.p = jnp.concatenate([self.own, contacts])
        return other

    def flow(self, mode, t, x):
        """The flow, W numbers."""
        return self.routines.flow(mode, self.p, t, x)

    def surfaces(self, mode, t, x):
        """Values of the surfaces, M numbers, -1 after those of the mode."""
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
    sizes = jnp.maximum(jnp.abs(x)[..., None, :], jnp.abs(scale))
    terms = jnp.abs(gradient[..., 0]) * jnp.abs(t)[..., None] + (jnp.abs(gradient[..., 1:]) * sizes).sum(axis=-1)
    return 32 * 2.0**-53 * (facts.magnitudes + jnp.where(known, terms, 0.0))


def norm_of(facts):
    """Sizes of the gradients."""
    return jnp.sqrt((facts.gradients * facts.gradients).sum(axis=-1))
