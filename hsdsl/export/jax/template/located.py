# pyright: basic
"""Crossings of the located scheme: the first of every surface inside a step, at its own instant.

The surface is searched on the step's interpolant. Its root is then corrected on a step of the method that ends there.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .functions import INF, chosen, frozen
from .lane import CROSS, LEFT_DOMAIN, sampled, stopped
from .model import Bound
from .steps import at, slope_at, step
from .surfaces import SCAN, choose, closed, each_at, standing, ties
from .transitions import Event, corrected, passed_over, sizes_of
from .verdicts import attempted, looked_along, motion, rising, scaled, terms_of

HALVINGS, NEWTON_STEPS = 40, 8


def slopes_at(bound, lane, trial, shares):
    """The slope of each surface by the share, at a share of its own."""

    def slope(k, s):
        gradient = bound.gradients(lane.mode, trial.t + s * trial.h, at(trial.x, trial.piece, s))[k]
        return gradient[0] * trial.h + gradient[1:] @ slope_at(trial.piece, s)

    return jax.vmap(slope)(jnp.arange(bound.model.M), shares)


def crests(bound, lane, trial, low, high, wanted):
    """Where surfaces turn that rise at one share and fall at another."""

    def close(state):
        low, high, turn = state
        middle = (low + high) / 2
        rises = slopes_at(bound, lane, trial, middle) > 0
        return jnp.where(rises, middle, low), jnp.where(rises, high, middle), turn + 1

    state = low, high, jnp.zeros((), int)
    return lax.while_loop(lambda s: wanted.any() & (s[2] < HALVINGS), close, state)[0]


def values_of(bound, lane, trial, shares):
    """Each surface at a share of its own; one that the state is on begins at zero, and has that root taken out."""
    values = each_at(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, shares)
    first = bound.surfaces(lane.mode, trial.t, trial.x)
    return jnp.where(lane.active, (values - first) / jnp.where(shares > 0, shares, 1.0), values)


def settled(model, bound, lane, trial, shares):
    """Correct crossings on steps of the method that end there, to round-off."""
    flow = motion(bound, lane)

    def point(s):
        time = jnp.where(s == 1, trial.t1, trial.t + s * trial.h)
        made = step(model.method, flow, trial.t, s * trial.h, trial.x)[0]
        return time, jnp.where(s == 1, trial.z, jnp.where(s > 0, made, trial.x))

    def residual(k, s):
        time, q = point(s)
        noise = bound.noise(lane.mode, time, q, scaled(lane))[k]
        return bound.surfaces(lane.mode, time, q)[k], noise

    slopes, numbers = slopes_at(bound, lane, trial, shares), jnp.arange(model.M)

    def correct(_, state):
        shares, best, least, over = state
        r, noise = jax.vmap(residual)(numbers, shares)
        better = ~over & (jnp.abs(r) < least)
        best, least = jnp.where(better, shares, best), jnp.where(better, jnp.abs(r), least)
        over = over | ~better | (jnp.abs(r) <= noise) | (slopes == 0)
        further = jnp.clip(shares - r / jnp.where(slopes == 0, 1.0, slopes), 0.0, 1.0)
        return jnp.where(over, shares, further), best, least, over

    state = shares, shares, jnp.full(model.M, INF), jnp.zeros(model.M, bool)
    best = lax.fori_loop(0, NEWTON_STEPS, correct, state)[1]
    times, states = jax.vmap(point)(best)
    return best, times, states


def first_rises(model, bound, lane, trial, wanted):
    """The first point of a step where each surface is crossed and its condition holds, if there is one."""
    values, slopes, first, level = looked_along(model, bound, lane, trial)
    rows = rising(lane, values, slopes, first, level) & wanted
    numbers, ends = jnp.arange(model.M), jnp.arange(SCAN + 1) / SCAN
    base = jnp.where(lane.active, values[0], 0.0)

    def look(state):
        rows, found, share, times, states = state
        open_ = rows.any(axis=0) & ~found
        part = jnp.argmax(rows, axis=0)
        low, high = ends[part], ends[part + 1]
        above = (values[part + 1, numbers] - base) > level
        top = jnp.where(above, high, crests(bound, lane, trial, low, high, open_ & ~above))
        height = each_at(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, top) - base
        rises = open_ & (height > level)
        on = lane.active & (low == 0)
        begins = jnp.where(on, slopes[0], values_of(bound, lane, trial, low))
        small = jnp.where(on, 0.0, level / 16)
        ends_at = top, values_of(bound, lane, trial, top)
        root = closed(lambda s: values_of(bound, lane, trial, s), (low, begins), ends_at, small, rises & (begins <= 0))
        root = jnp.where(begins > 0, low, root)
        root, time, state = settled(model, bound, lane, trial, jnp.where(rises, root, 0.0))
        holds = jax.vmap(lambda k, time, q: bound.conditions(lane.mode, time, q)[k])(numbers, time, state)
        new = rises & holds
        rows = rows & (jnp.arange(SCAN)[:, None] > part) & ~new
        return (
            rows,
            found | new,
            jnp.where(new, root, share),
            jnp.where(new, time, times),
            jnp.where(new[:, None], state, states),
        )

    count = model.M
    state = rows, jnp.zeros(count, bool), jnp.zeros(count), jnp.full(count, INF), jnp.zeros((count, model.W))
    return lax.while_loop(lambda s: s[0].any(), look, state)[1:]


def located_crossing(model, config, p, lane, record):
    """What a step with a possible crossing leads to: a transition, the end at a wall, or nothing."""
    mask = lane.phase == CROSS
    still, bound = frozen(lane), Bound(model, frozen(p), lane.segment)
    trial = attempted(model, bound, still, still.trial)
    mode = lane.mode
    wanted = model.of(model.is_edge | model.is_wall, mode) & mask
    found, share, times, states = first_rises(model, bound, still, trial, wanted)
    guards, walls = found & model.of(model.is_edge, mode), found & model.of(model.is_wall, mode)
    wall = jnp.argmin(jnp.where(walls, times, INF))
    hits = walls.any() & ~(guards & (times <= times[wall] + ties(config, times[wall]))).any()
    on = standing(model, bound, still, times[wall], states[wall], ties(config, times[wall]))
    leaves = hits & ~on.any()
    guards = jnp.where(hits, on, guards)
    times = jnp.where(hits, times[wall], times)
    states = jnp.where(hits, states[wall], states)
    share = jnp.where(hits, share[wall], share)
    first, k, tied = choose(model, config, bound, still, guards, times, states)
    goes = mask & guards.any() & ~leaves
    event = arriving(model, p, lane, trial, goes, first, k, share[first], times[first], states[first], tied)
    ends = mask & (goes | leaves)
    until = jnp.where(leaves, times[wall], event.t)
    record = until_crossing(model, config, p, lane, record, ends, until)
    lane = chosen(mask & leaves, stopped(lane, True, LEFT_DOMAIN)._replace(t=times[wall], x=states[wall]), lane)
    return passed_over(lane, mask & ~ends), record, event


def until_crossing(model, config, p, lane, record, mask, end):
    """Sample the part of a step before it ends."""
    if not len(config.times):
        return record
    made = attempted(model, Bound(model, p, lane.segment), lane, jnp.where(mask, frozen(lane.trial), 0.0))
    length = jnp.where(made.h > 0, made.h, 1.0)
    return sampled(
        record, config, mask, lane.mode, made.t, end,
        lambda times: jax.vmap(lambda time: at(made.x, made.piece, (time - made.t) / length))(times),
    )  # fmt: skip


def arriving(model, p, lane, trial, mask, first, k, share, time, state, tied):
    """The event at a crossing of a step, with derivatives: a step of the method ends there."""
    bound = Bound(model, p, lane.segment)
    length = jnp.where(mask, frozen(share * trial.h), 0.0)
    z = step(model.method, motion(bound, lane), lane.t, length, lane.x)[0]
    t, x = frozen(jnp.where(mask, time, lane.t)), frozen(jnp.where(mask, state, lane.x))
    t, x = corrected(bound, lane, first, t, x, lane.t + length, z)
    terms = terms_of(model.method, trial.x, share * trial.h, trial.stages)
    sizes = jnp.maximum(jnp.maximum(sizes_of(lane, trial.x, frozen(x)), terms), lane.terms)
    sizes = jnp.where(lane.active[first], jnp.maximum(sizes, lane.scale), sizes)
    return Event(mask, k, t, x, t, jnp.asarray(0.0), sizes, tied)
