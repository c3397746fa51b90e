# pyright: basic
"""Surfaces along a step, and which of several crossings goes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .functions import INF
from .lane import TIE, releasing, scaled, sizes_here
from .model import noise_of
from .steps import at

SCAN = 8  # parts in which a step is searched
UNIT = 2.0**-53
SAME_UNITS = 4  # of round-off, relative to its scale: how far a reset may move a state that it keeps


def each_at(bound, mode, t, h, x, pieces, shares):
    """The value of each surface at a share of its own, on a piece that is one for all or one for each."""
    states = states_at(x, pieces, shares)
    return jnp.diagonal(jax.vmap(lambda s, x: bound.surfaces(mode, t + s * h, x))(shares, states))


def states_at(x, pieces, shares):
    """Points at shares of one interpolant, or each of its own."""
    return jax.vmap(lambda piece, s: at(x, piece, s), (None if pieces.ndim == 2 else 0, 0))(pieces, shares)


def ties(t):
    """Times closer than this are the same instant."""
    return TIE * jnp.abs(t)


def standing(model, bound, lane, facts, t, x, since):
    """Edges on whose guards a state is, to round-off or within a time, the flow pointing out and the `if` true.

    One that bends as it does in that time, and falls again before it has risen above round-off, is only touched.
    """
    noise = noise_of(facts, t, x, scaled(model, lane))
    near = jnp.abs(facts.values) <= jnp.maximum(noise, facts.rates * since)
    out = facts.rates > 32 * UNIT * facts.spans
    later = bound.facts(lane.mode, t + since, x + since * bound.flow(lane.mode, t, x)).rates
    bend = (facts.rates - later) / jnp.where(since > 0, since, 1.0)
    turns = (since > 0) & (bend > 0) & (facts.rates * facts.rates <= 2 * bend * (noise - facts.values))
    return near & out & ~turns & facts.conditions & model.of(model.is_edge, lane.mode) & ~releasing(model, lane)


def after_reset(model, bound, lane, k, t, x):
    """Where edge k leads at a slow impact, but for states that it counts with."""
    edge = model.of(model.edge, lane.mode)[k]
    return jnp.where(model.of(model.counts, edge), x, bound.routines.slow(edge, bound.p, t, x))


def keeps(model, bound, lane, k, t, x):
    """Whether the reset of edge k leaves the state where it is."""
    off = jnp.abs(after_reset(model, bound, lane, k, t, x) - x)
    return (off <= SAME_UNITS * UNIT * sizes_here(model, lane)).all()


def choose(model, bound, lane, found, facts, times, states):
    """Choose which crossing goes: the number of the first one, that of the edge, and whether others are tied.

    The earliest goes; of tied ones, and of those whose guard its point is on, the highest priority, then the first.
    ``facts`` are those at the times and states (rows).
    """
    first = jnp.argmin(jnp.where(found, times, INF))
    since = ties(times[first])
    tied = found & (times - times[first] <= since)
    here = jax.tree.map(lambda rows: rows[first], facts)
    tied = tied | standing(model, bound, lane, here, times[first], states[first], since)
    priority = model.of(model.priority, lane.mode)
    edge = jnp.argmax(jnp.where(tied, priority, jnp.iinfo(jnp.int32).min))
    return first, edge, (tied & ~releasing(model, lane)).sum() > 1


def closed(value, low, high, small, needed):
    """Close brackets (share, value) with a value <= 0 below and > 0 above, where ``needed``: shares of the roots.

    By the Illinois variant of regula falsi, until a value is below ``small`` or a bracket a few units wide.
    """
    (a, fa), (b, fb) = low, high
    zero = jnp.zeros(small.shape, jnp.int32)

    def is_open(state):
        a, b, fa, fb, *_, turn = state
        return needed & ~((-fa <= small) | (b - a <= 4 * UNIT) | (fb <= small)) & (turn < 200)

    def close(state):
        a, b, fa, fb, wa, wb, side, turn = state
        going = is_open(state)
        s = a - wa * (b - a) / jnp.where(wb == wa, 1.0, wb - wa)
        s = jnp.where((a < s) & (s < b), s, (a + b) / 2)
        f = value(s)
        low, high = going & (f <= 0), going & ~(f <= 0)
        wb = jnp.where(low & (side < 0), wb / 2, jnp.where(high, f, wb))
        wa = jnp.where(high & (side > 0), wa / 2, jnp.where(low, f, wa))
        a, fa, b, fb = jnp.where(low, s, a), jnp.where(low, f, fa), jnp.where(high, s, b), jnp.where(high, f, fb)
        return a, b, fa, fb, wa, wb, jnp.where(low, -1, jnp.where(high, 1, side)), turn + 1

    state = a, b, fa, fb, fa, fb, zero, zero
    a, b, fa, fb, *_ = lax.while_loop(lambda s: is_open(s).any(), close, state)
    return jnp.where((-fa <= small) | (b - a <= 4 * UNIT) | ~(fb <= small), a, b)


def last_up_crossing(value, small, needed):
    """For each function the last share where it rises through zero, being positive at 1; not-a-number if it never does.

    ``value`` takes a share for each function.
    """
    count = small.shape[0]
    ends = jax.vmap(lambda s: value(jnp.full(count, s)))(jnp.arange(SCAN + 1) / SCAN)
    below = ends[:-1] <= 0
    last = SCAN - 1 - jnp.argmax(below[::-1], axis=0)
    rises, column = below.any(axis=0) & needed, jnp.arange(count)
    low, high = (last / SCAN, ends[last, column]), ((last + 1) / SCAN, ends[last + 1, column])
    return jnp.where(rises, closed(value, low, high, small, rises), jnp.nan)
