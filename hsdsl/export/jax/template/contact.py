# pyright: basic
"""Motion along a guard that holds a state, at rest where that is none, and Zeno tails that end in it."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .functions import chosen, frozen, keeping, when
from .lane import STEP, ZENO, contraction, noticed, sampled, scales_here, stopped
from .model import Bound, noise_of
from .steps import at
from .surfaces import UNIT

SAME_UNITS, ZERO_UNITS, MOST_ROUNDS, CORRECTIONS, QUADRUPLINGS = 4, 16, 60, 8, 28
PARALLEL = 1e-6


def takes_back(slope, back):
    """Whether one direction is opposite to another that is not zero, in each component."""
    first = jnp.argmax(slope != 0)
    share = jnp.where(slope[first] == 0, 0.0, back[first] / jnp.where(slope[first] == 0, 1.0, slope[first]))
    off = jnp.abs(back - share * slope)
    return (share < 0) & (off <= PARALLEL * jnp.abs(share) * jnp.abs(slope)).all()


def after_reset(model, bound, mode, k, t, x):
    """Where edge k leads at a slow impact, but for states that it counts with."""
    edge = model.of(model.edge, mode)[k]
    return jnp.where(model.of(model.counts, edge), x, bound.routines.slow(edge, bound.p, t, x))


def keeps(model, bound, lane, k, t, x):
    """Whether edge k leaves the state where it is, and its `if` holds there or next along the flow."""
    scales = scales_here(model, lane)
    still = (jnp.abs(after_reset(model, bound, lane.mode, k, t, x) - x) <= SAME_UNITS * UNIT * scales).all()
    return still & is_possible(model, bound, lane.mode, k, t, x, scales)


def is_possible(model, bound, mode, k, t, x, scales):
    """Whether the `if` of edge k holds at a point, or next along the flow."""
    next_to = pressed(model, bound, mode, k, t, x, scales)
    return bound.facts(mode, t, x).conditions[k] | bound.facts(mode, t, next_to).conditions[k]


def pressed(model, bound, mode, k, t, x, scales):
    """Where the flow takes a state: off by round-off where the reset of edge k moves it."""
    slope = bound.flow(mode, t, x)
    slopes = jax.jvp(lambda x: after_reset(model, bound, mode, k, t, x) - x, (x,), (slope,))[1]
    moved = (slopes != 0) & (slope != 0)
    after = jnp.where(moved, ZERO_UNITS * UNIT * scales / jnp.abs(jnp.where(slope == 0, 1.0, slope)), 0.0).max()
    after = jnp.where(after > 0, after, UNIT * (bound.end - t))  # where these states have been zero only
    return x + after * slope


def is_tangent(model, bound, lane, k, t, x):
    """Whether the flow is tangent to surface k, to round-off."""
    rows = jax.jacfwd(lambda x: bound.flow(lane.mode, t, x))(x)
    sizes = jnp.abs(bound.flow(lane.mode, t, x)) + jnp.abs(rows) @ scales_here(model, lane)
    facts = bound.facts(lane.mode, t, x)
    gradient = facts.gradients[k]
    size = jnp.abs(gradient[0]) + jnp.abs(gradient[1:]) @ sizes
    return jnp.abs(facts.rates[k]) <= ZERO_UNITS * UNIT * size


def presses(model, bound, lane, k, t, x):
    """Whether a state's flow presses on the guard of edge k, and its reset keeps the state."""
    contact = model.of(model.contact, lane.mode)[k]
    held = jnp.maximum(contact, 0)
    facts = bound.facts(held, t, x)
    inside = (facts.values < -noise_of(facts, t, x, 0.0))[k]
    first = jnp.asarray(model.push_order)[held] == 1
    on = (contact >= 0) & keeps(model, bound, lane, k, t, x) & inside
    return on & (first | is_tangent(model, bound, lane, k, t, x))


def into_contact(model, p, lane, mask):
    """Let a guard that a state is on hold it, if it does."""
    bound, still = Bound(model, frozen(p), frozen(lane.segment)), frozen(lane)
    may = mask & lane.active & (model.of(model.contact, lane.mode) >= 0)

    def pressed():
        return jax.vmap(lambda k: presses(model, bound, still, k, still.t, still.x))(jnp.arange(model.M))

    found = may & when(may.any(), pressed, may)
    k = jnp.argmax(found)
    contact = jnp.maximum(model.of(model.contact, lane.mode)[k], 0).astype(jnp.int32)
    known = model.of(model.of_owner, contact)
    active = (known >= 0) & lane.active[known] & (jnp.arange(model.M) != k)
    held = lane._replace(mode=contact, held=k.astype(jnp.int32), active=active, emerging=jnp.zeros_like(lane.emerging))
    return chosen(found.any(), held, lane)


def out_of_contact(model, lane, mask):
    """A run in its mode itself again, on the guard that held it."""
    known = model.of(model.in_contact, lane.mode)
    active = ((known >= 0) & lane.active[known]) | (jnp.arange(model.M) == lane.held)
    free = lane._replace(
        mode=model.of(model.owner, lane.mode).astype(jnp.int32), held=jnp.full_like(lane.held, -1), active=active,
        emerging=jnp.zeros_like(lane.emerging),
    )  # fmt: skip
    return chosen(mask & (lane.held >= 0), free, lane)


def let_go(model, config, p, lane, event):
    """End a contact at an event that does; what is left of events are transitions."""
    ends = event.mask & model.of(model.releases, lane.mode)[event.k]
    bound = Bound(model, frozen(p), lane.segment)
    t, x, owner = frozen(event.t), frozen(event.x), model.of(model.owner, lane.mode)
    slope, scales = bound.flow(lane.mode, t, x), scales_here(model, lane)
    after = jnp.minimum(UNIT * config.until * 4.0 ** jnp.arange(QUADRUPLINGS), bound.end - t)

    def look(s):
        """Whether an `if` ends, and whether the surface is above round-off."""
        time, point = t + s, x + s * slope
        ahead = bound.facts(lane.mode, time, pressed(model, bound, owner, lane.held, time, point, scales))
        above = ahead.values[event.k] > noise_of(ahead, time, point, 0.0)[event.k]
        return ~is_possible(model, bound, owner, lane.held, time, point, scales), above

    ended, above = jax.vmap(look)(after)
    first, own = jnp.argmax(ended | above | (t + after >= bound.end)), event.k == lane.held
    late, frees = jnp.where(own, 0.0, after[first]), own | ended[first]
    t, x = t + frozen(late), x + frozen(late) * slope
    facts, scale = bound.facts(lane.mode, t, x), jnp.where(lane.active[:, None], lane.scale, 0.0)
    here = noticed(model, lane, frozen(event.x))._replace(
        t=event.t + late, x=event.x + late * slope, trial=lane.h, clear=jnp.asarray(False), phase=jnp.int32(STEP),
        active=lane.active & (jnp.abs(facts.values) <= noise_of(facts, t, x, scale)),
        halvings=jnp.zeros_like(lane.halvings), terms=jnp.zeros_like(lane.terms),
    )  # fmt: skip
    free = out_of_contact(model, here, jnp.asarray(True))
    free = free._replace(scale=event.sizes, entered_x=frozen(here.x))
    lane = chosen(ends, chosen(frees, free, here), lane)
    return lane, event._replace(mask=event.mask & ~ends)


def fixed_point(reset, x, needed):
    """The point that repeated resets run to (Aitken's acceleration, by component)."""

    def accelerate(_, x):
        one = reset(x)
        two = reset(one)
        bend = two - 2 * one + x
        further = jnp.where(bend == 0, two, x - (one - x) * (one - x) / jnp.where(bend == 0, 1.0, bend))
        return jnp.where((one == x).all(), x, further)

    found = when(needed, lambda: lax.fori_loop(0, MOST_ROUNDS, accelerate, frozen(x)), frozen(x))
    return keeping(found, accelerate(0, x))


def onto_guard(bound, lane, k, t, x, scales):
    """A point near a guard taken to it, each state in proportion to its scale."""

    def correct(_, x):
        facts = bound.facts(lane.mode, t, x)
        r, gradient = facts.values[k], facts.gradients[k, 1:]
        near = jnp.abs(r) <= noise_of(facts, t, x, 0.0)[k]
        weights = gradient * scales * scales
        across = gradient @ weights
        return jnp.where(near | ~(across > 0), x, x - r / jnp.where(across > 0, across, 1.0) * weights)

    return lax.fori_loop(0, CORRECTIONS, correct, x)


def limit_of(model, p, lane, k, end, left, needed):
    """The point that a tail runs to: kept by resets, moved along the guard to its end, and kept by resets there."""
    bound, whole = Bound(model, frozen(p), lane.segment), Bound(model, p, lane.segment)
    contact = model.of(model.contact, lane.mode)[k]
    q = fixed_point(lambda x: after_reset(model, whole, lane.mode, k, lane.t, x), lane.x, needed)
    still, t = frozen(q), frozen(lane.t)
    moved = still + left * bound.flow(jnp.maximum(contact, 0), t, still)
    moved = onto_guard(bound, lane, k, end, moved, scales_here(model, frozen(lane)))
    q = jnp.where(contact >= 0, keeping(moved, q), q)
    then = keeping(end, lane.t)
    return fixed_point(lambda x: after_reset(model, whole, lane.mode, k, then, x), q, needed)


def close_tail(model, config, p, lane, record, mask):
    """Go to the limit of a tail that is nearly over; stop at one where no motion along the guard goes on."""
    bound, still = Bound(model, frozen(p), lane.segment), frozen(lane)
    shrinks, flight, ratio = contraction(still)
    edge = jnp.maximum(still.loops[-1], 0)
    k = jnp.argmax((model.of(model.edge, lane.mode) == edge) & model.of(model.is_edge, lane.mode))
    left = flight * ratio / (1 - jnp.where(ratio < 1, ratio, 0.0))
    end = still.t + left
    near = mask & shrinks & model.of(model.loops, lane.mode)[k] & (left <= config.relaxation) & (end <= bound.end)
    left, end = jnp.where(near, left, 0.0), jnp.where(near, end, still.t)  # elsewhere derivatives must exist, too
    q = limit_of(model, p, lane, k, end, left, near)
    limit = frozen(q)
    facts, first = bound.facts(lane.mode, end, limit), bound.facts(lane.mode, still.t, still.x)
    r, noise = facts.values, noise_of(facts, end, limit, still.scale)
    before = noise_of(first, still.t, still.x, jnp.where(still.active[:, None], still.scale, 0.0))
    others = (r > noise) & ~(first.values > before) & (jnp.arange(model.M) != k)
    near = near & (jnp.abs(r[k]) <= noise[k]) & keeps(model, bound, still, k, end, limit)
    none = near & (model.of(model.contact, lane.mode)[k] < 0)
    pressed = when(near, lambda: presses(model, bound, still, k, end, limit), jnp.asarray(False))
    goes = near & ~none & pressed & ~others.any()
    length = jnp.where(goes, left, 1.0)
    record = sampled(
        record, config, goes, lane.mode, lane.t, end,
        lambda times: jax.vmap(lambda time: at(lane.x, (q - lane.x)[None], (time - lane.t) / length))(times),
    )  # fmt: skip
    lane = stopped(lane, none, ZENO)
    active = (jnp.abs(r) <= noise) | (jnp.arange(model.M) == k)
    rest = noticed(model, lane, limit)._replace(
        t=keeping(end, lane.t), x=q, active=active, emerging=jnp.zeros_like(lane.emerging), entered_x=limit,
    )  # fmt: skip
    return chosen(goes, rest, lane), record
