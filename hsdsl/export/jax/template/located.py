# pyright: basic, reportCallIssue=false
"""Crossings of the located scheme: the first of every surface inside a step, at its own instant.

The surface is searched on the step's interpolant. Its root is then corrected on a step of the method that ends there.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .contact import may_hold_next
from .functions import INF, chosen, frozen
from .lane import CROSS, LEFT_DOMAIN, joined, scaled, scales_here, sizes_of, stopped
from .model import Bound, noise_of
from .steps import slope_at, step
from .surfaces import SCAN, closed, each_at, standing, states_at, ties
from .transitions import Crossing, facts_here_and_at, passed_over
from .verdicts import attempted, looked_along, motion, rising, terms_of

JUMP_HALVINGS, NEWTON_STEPS = 40, 8


def slopes_at(bound, lane, trial, shares):
    """The slope of each surface by the share, at a share of its own."""
    numbers, places = jnp.arange(bound.model.M), states_at(trial.x, trial.piece, shares)
    gradients = bound.facts(lane.mode, trial.t + shares * trial.h, places).gradients[numbers, numbers]
    moved = jax.vmap(lambda s: slope_at(trial.piece, s))(shares)
    return gradients[:, 0] * trial.h + (gradients[:, 1:] * moved).sum(axis=1)


def crests(bound, lane, trial, low, high, needed):
    """Where surfaces turn that rise at one share and fall at another."""

    def close(state):
        low, high, turn = state
        middle = (low + high) / 2
        rises = slopes_at(bound, lane, trial, middle) > 0
        return jnp.where(rises, middle, low), jnp.where(rises, high, middle), turn + 1

    state = low, high, jnp.zeros((), int)
    return lax.while_loop(lambda s: needed.any() & (s[2] < JUMP_HALVINGS), close, state)[0]


def settled(model, bound, lane, trial, shares):
    """Correct crossings on steps of the method that end there, to round-off: shares, times and states."""
    flow = motion(bound, lane)

    def point(s):
        time = jnp.where(s == 1, trial.t1, trial.t + s * trial.h)
        made = step(model.method, flow, trial.t, s * trial.h, trial.x)[0]
        return time, jnp.where(s == 1, trial.z, jnp.where(s > 0, made, trial.x))

    slopes = slopes_at(bound, lane, trial, shares)

    def correct(turn, state):
        shares, best, least, over = state
        times, states = jax.vmap(point)(shares)
        facts = bound.facts(lane.mode, times, states)
        r, noise = jnp.diagonal(facts.values), jnp.diagonal(noise_of(facts, times, states, scaled(model, lane)))
        better = ~over & (jnp.abs(r) < least)
        best = chosen_rows(better | (turn == 0), (shares, times, states), best)
        least = jnp.where(better, jnp.abs(r), least)
        over = over | ~better | (jnp.abs(r) <= noise) | (slopes == 0)
        further = jnp.clip(shares - r / jnp.where(slopes == 0, 1.0, slopes), 0.0, 1.0)
        return jnp.where(over, shares, further), best, least, over

    begin = shares, trial.t + shares * trial.h, jnp.broadcast_to(trial.x, (model.M, model.W))
    state = shares, begin, jnp.full(model.M, INF), jnp.zeros(model.M, bool)
    return lax.fori_loop(0, NEWTON_STEPS, correct, state)[1]


def chosen_rows(mask, ours, theirs):
    """Rows of arrays where ``mask`` holds, of the others elsewhere."""
    return jax.tree.map(lambda a, b: jnp.where(mask.reshape(-1, *[1] * (a.ndim - 1)), a, b), ours, theirs)


def first_rises(model, bound, lane, trial, needed):
    """The first point of a step where each surface is crossed and its condition holds, if there is one."""
    looked, slopes, levels = looked_along(model, bound, lane, trial)
    values, first = looked.shares.values, looked.first_noise
    rows = rising(lane, values, slopes, first, levels) & needed
    numbers, ends = jnp.arange(model.M), jnp.arange(SCAN + 1) / SCAN
    base = jnp.where(lane.active, values[0], 0.0)

    def taken_out(values, shares):  # a surface that the state is on begins at zero, and has that root taken out
        return jnp.where(lane.active, (values - looked.first.values) / jnp.where(shares > 0, shares, 1.0), values)

    def values_at(shares):
        return each_at(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, shares)

    def look(state):
        rows, found, points = state
        open_ = rows.any(axis=0) & ~found
        part = jnp.argmax(rows, axis=0)
        low, high = ends[part], ends[part + 1]
        above = (values[part + 1, numbers] - base) > levels[part, numbers]
        level = jnp.where(above, levels[part, numbers], levels[0])
        top = jnp.where(above, high, crests(bound, lane, trial, low, high, open_ & ~above))
        height = values_at(top)
        rises = open_ & (height - base > level)
        on = lane.active & (low == 0)
        begins = jnp.where(on, slopes[0], taken_out(values[part, numbers], low))
        bracket, small = ((low, begins), (top, taken_out(height, top))), jnp.where(on, 0.0, level / 16)
        root = closed(lambda s: taken_out(values_at(s), s), *bracket, small, rises & (begins <= 0))
        flat = small * trial.h > jnp.abs(slopes_at(bound, lane, trial, root)) * ties(trial.t1)
        flat = flat & rises & (begins <= 0)  # round-off hides the root: its sign does not
        root = jnp.where(flat, closed(lambda s: taken_out(values_at(s), s), *bracket, 0 * small, flat), root)
        root = jnp.where(begins > 0, low, root)
        settled_at = settled(model, bound, lane, trial, jnp.where(rises, root, 0.0))
        holds = jnp.diagonal(bound.facts(lane.mode, *settled_at[1:]).conditions)
        new = rises & (holds | may_hold_next(model, bound, lane, rises & lane.active & ~holds, *settled_at[1:]))
        rows = rows & (jnp.arange(SCAN)[:, None] > part) & ~new
        return rows, found | new, chosen_rows(new, settled_at, points)

    count = model.M
    state = rows, jnp.zeros(count, bool), (jnp.zeros(count), jnp.full(count, INF), jnp.zeros((count, model.W)))
    return lax.while_loop(lambda s: s[0].any(), look, state)[1:]


def located_crossing(model, config, p, lane):
    """What a step with a possible crossing leads to: a transition, the end at a wall, or nothing."""
    mask, mode = lane.phase == CROSS, lane.mode
    still, bound = frozen(lane), Bound(model, frozen(p), lane.segment, lane.contacts)
    trial = attempted(model, bound, still, still.trial)
    needed = model.of(model.is_edge | model.is_wall, mode) & mask
    found, points = first_rises(model, bound, still, trial, needed)
    here, facts = facts_here_and_at(bound, still, found, *points[1:])
    guards, walls, times = found & model.of(model.is_edge, mode), found & model.of(model.is_wall, mode), points[1]
    wall = jnp.argmin(jnp.where(walls, times, INF))
    hits = walls.any() & ~(guards & (times <= times[wall] + ties(times[wall]))).any()
    at_wall = jax.tree.map(lambda rows: rows[wall], (facts, times, points[2]))
    on = standing(model, bound, still, *at_wall, ties(times[wall]))
    leaves = mask & hits & ~on.any()
    guards = jnp.where(hits, on, guards)
    rows = jax.tree.map(lambda rows: jnp.where(hits, rows[wall], rows), (*points, facts))
    goes = mask & guards.any() & ~leaves

    def sizes(first, state):
        terms = terms_of(model.method, trial.x, rows[0][first] * trial.h, trial.stages)
        values, noise = rows[3].values[first], noise_of(rows[3], rows[1], rows[2], scaled(model, still))[first]
        held = still.contacts.any()
        stands = held | still.active[first] | (still.active & (jnp.abs(values) <= noise)).any()
        between = sizes_of(still, trial.x, state, stands | (state == still.entered_x))
        between = joined(joined(between, terms), still.terms)
        return jnp.where(held, jnp.maximum(between, scales_here(model, still)), between)

    crossing = Crossing(
        goes, guards, *rows[:3], here, rows[3], trial.t1, jnp.zeros(model.M), trial.h, trial, leaves, times[wall],
        sizes, lambda *given: at_end(model.method, *given),
    )  # fmt: skip
    lane = chosen(leaves, stopped(lane, True, LEFT_DOMAIN)._replace(t=times[wall], x=points[2][wall]), lane)
    return passed_over(lane, mask & ~goes & ~leaves), crossing


def at_end(method, bound, lane, length, share):
    """The end of a share of a step, with derivatives: a step of the method."""
    length = share * length
    return lane.t + length, step(method, motion(bound, lane), lane.t, length, lane.x)[0]
