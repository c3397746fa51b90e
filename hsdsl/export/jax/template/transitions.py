# pyright: basic
"""Transitions: where they go from, with derivatives; how a run waits, is reset and recorded; runs that are stuck."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp

from .functions import NAN, chosen, frozen, keeping
from .lane import (
    ENTER,
    FREE,
    INWARD,
    LIMIT,
    NOT_FINITE,
    STEP,
    STUCK,
    UNTIL,
    VALUE,
    contraction,
    recorded,
    sampled,
    stopped,
)
from .model import Bound
from .surfaces import choose, standing, ties


class Event(NamedTuple):
    """Where ``mask`` holds: edge k of the mode goes from (t, x); a step into a strip ended at ``landed``, this deep."""

    mask: Any
    k: Any
    t: Any
    x: Any
    landed: Any
    depth: Any
    sizes: Any
    tied: Any


def corrected(bound, lane, k, t, x, time, state):
    """The time and state of a crossing of surface k, with their derivatives.

    (time, state) is a point with the same numbers, on the trajectory at a share of a step that does not depend on
    anything; the crossing moves along the flow as the surface's value there says.
    """
    rate = frozen(bound.rates(lane.mode, t, x)[k])
    r = bound.surfaces(lane.mode, time, state)[k]
    late = -(r - frozen(r)) / jnp.where(rate == 0, jnp.inf, rate)
    return keeping(t, time + late), keeping(x, state + frozen(bound.flow(lane.mode, t, x)) * late)


def sizes_of(lane, x, z):
    """The sizes of the numbers that a point between x and z is computed from."""
    still = jnp.where(z == lane.entered_x, lane.scale, jnp.abs(z))
    return frozen(jnp.maximum(jnp.maximum(jnp.abs(x), jnp.abs(z)), still))


def passed_over(lane, mask):
    """A run whose trial has no crossing after all: it counts when it is made again."""
    return lane._replace(clear=lane.clear | mask, phase=jnp.where(mask, STEP, lane.phase))


def at_once(model, config, p, lane, mask, found):
    """The event of guards that a state is on."""
    bound = Bound(model, p, lane.segment)
    places, count = jnp.broadcast_to(frozen(lane.x), (model.M, model.W)), jnp.full(model.M, frozen(lane.t))
    first, k, tied = choose(model, config, Bound(model, frozen(p), lane.segment), frozen(lane), found, count, places)
    t, x = corrected(bound, lane, first, frozen(lane.t), frozen(lane.x), lane.t, lane.x)
    sizes = sizes_of(lane, frozen(lane.x), frozen(lane.x))
    return Event(mask, k, t, x, frozen(lane.t), jnp.asarray(0.0), sizes, tied)


def stuck(model, config, p, lane):
    """A run that no step leads on: a guard that it is on goes, or it ends with the reason."""
    mask, still = lane.phase == STUCK, frozen(lane)
    bound = Bound(model, frozen(p), lane.segment)
    may = (lane.failure == VALUE) | ((config.scheme == "relaxed") & (lane.failure >= 1) & (lane.failure <= INWARD))
    found = standing(model, bound, still, still.t, still.x, 1e-12 * still.t) & may
    event = at_once(model, config, p, lane, mask & found.any(), found)
    reasons = jnp.asarray([7, 3, 7, 7, 7, 6, 7, 7])  # by failure: a wall, no value, else no step is short enough
    return stopped(lane, mask & ~found.any(), reasons[lane.failure]), event


def either(one, other):
    """The event of one of two, of which at most one is an event."""
    return chosen(one.mask, one, other)


def transit(model, config, p, lane, record, event):
    """Make a transition: wait in the strip, reset, and enter the target next."""
    bound = Bound(model, p, lane.segment)
    edge = model.of(model.edge, lane.mode)[event.k]
    mask = event.mask
    over = mask & (lane.count >= config.max_transitions)
    lane, mask = stopped(lane._replace(t=jnp.where(over, event.t, lane.t)), over, LIMIT), mask & ~over
    x = jnp.where(mask, event.x, lane.x)
    after = bound.routines.reset(edge, bound.p, event.t, x)
    spread = bound.routines.spread(edge, bound.p, frozen(event.t), frozen(x), event.sizes)
    scale = frozen(jnp.where(jnp.isfinite(spread).all(), spread, jnp.abs(after)))
    if config.scheme == "relaxed":
        resumed = event.landed + (config.relaxation - event.depth)
    else:
        resumed = event.t + jnp.where(crowded(config, lane, event.t), config.relaxation, 0.0)
    waits = resumed > event.t
    late = waits & (resumed > config.until + ties(config, config.until))
    resumed = keeping(jnp.minimum(resumed, jnp.where(waits, config.until, resumed)), event.t)
    bad = ~jnp.isfinite(after).all() & ~late
    record = recorded(
        record, lane, mask & (late | ~bad), event.t, jnp.where(late, NAN, resumed), edge, x,
        jnp.where(late, NAN, after), jnp.asarray(False),
    )  # fmt: skip
    record = sampled(
        record, config, mask & waits, lane.mode, event.t, jnp.minimum(resumed, config.until),
        lambda times: jnp.broadcast_to(x, (len(times), model.W)),
    )  # fmt: skip
    stops = mask & (late | bad)
    ended = stopped(lane, stops, jnp.where(late, UNTIL, NOT_FINITE))
    ended = ended._replace(t=jnp.where(late, config.until, event.t), x=x, count=lane.count + jnp.where(late, 1, 0))
    made = lane._replace(
        phase=jnp.int32(ENTER), t=resumed, x=after, mode=jnp.asarray(model.target, jnp.int32)[edge],
        scale=scale, since=since_of(config, lane, event), inside=jnp.zeros_like(lane.inside),
        reset_at=frozen(event.t), held=jnp.full_like(lane.held, -1), made=jnp.asarray(True),
        flowed=event.t > lane.entered_t, edge=edge.astype(jnp.int32),
        slope=frozen(bound.flow(lane.mode, event.t, x)), mode_before=model.of(model.owner, lane.mode).astype(jnp.int32),
        times=jnp.concatenate([lane.times[1:], frozen(event.t)[None]]),
        waits=jnp.concatenate([lane.waits[1:], frozen(resumed - event.t)[None]]),
        loops=jnp.concatenate([lane.loops[1:], edge.astype(jnp.int32)[None]]), count=lane.count + 1,
        trial=lane.h, clear=jnp.asarray(False), halvings=jnp.zeros_like(lane.halvings),
        visited=lane.visited._replace(room=jnp.int32(0)),
    )  # fmt: skip
    lane = chosen(stops, ended, lane)
    return chosen(mask & ~stops, made, lane), record


def crowded(config, lane, t):
    """Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit."""
    flown = t - lane.times[0] - lane.waits.sum()
    return (lane.count >= FREE) & ~contraction(lane)[0] & (flown <= config.relaxation)


def since_of(config, lane, event):
    """The time within which a surface that the flow passes is active: of tied transitions that of a tie."""
    if config.scheme == "relaxed":
        return jnp.asarray(0.0)
    tie = ties(config, event.t)
    at_this_instant = (lane.count > 0) & (event.t - lane.times[-1] - lane.waits[-1] <= tie)
    return frozen(jnp.where(event.tied | at_this_instant, tie, 0.0))
