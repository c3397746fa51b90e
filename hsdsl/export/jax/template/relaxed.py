# pyright: basic
"""Transitions, and those of the relaxed scheme: crossings on the interpolant of a step, and the strip."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .control import accepted, error_ratio
from .functions import NAN, chosen, frozen, keeping
from .lane import (
    CROSS,
    DEEP,
    ENTER,
    FLAT,
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
from .steps import at, error_of, hermite
from .surfaces import SCAN, along, choose, each_at, last_up_crossing, standing, ties
from .trials import Verdict, attempted, motion, scaled, shortened


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


def crossings(model, config, bound, lane, trial):
    """The last up-crossings of surfaces that a trial ended beyond; and whether it fails at one, which and why."""
    mode, t, h, x = lane.mode, trial.t, trial.h, trial.x
    values = bound.surfaces(mode, trial.t1, trial.z)
    noise = bound.noise(mode, trial.t1, trial.z, scaled(lane))
    beyond = (values > noise) & model.of(model.is_edge, mode)
    transparent = lane.emerging | model.of(model.conditional, mode)
    norm = bound.norm(mode, trial.t1, trial.z)
    reach = jnp.maximum(jnp.abs(x), jnp.abs(trial.z))
    small = bound.noise(mode, trial.t1, reach, scaled(lane)) / 16
    outside = values_at_start(bound, lane, trial) > bound.noise(mode, t, x, scaled(lane))

    def solve(piece, wanted):
        share = last_up_crossing(lambda s: each_at(bound, mode, t, h, x, piece, s), small, wanted)
        none = jnp.isnan(share) & transparent & outside
        return jnp.where(jnp.isnan(share), 0.0, share), none

    def inward(share, piece):
        back = jax.vmap(lambda k, s: -bound.rates(mode, t + s * h, at(x, piece, s))[k] * h)(jnp.arange(model.M), share)
        return jnp.where(back > noise, back, 0.0)

    piece = trial.piece
    share, passed = solve(piece, beyond)
    back = inward(share, piece)
    again = beyond & ~passed & (back > 0) & (back <= config.relaxation * norm)
    if model.method.interpolant == "hermite":
        cubic = piece
    else:
        cubic = jnp.where(trial.ends, hermite(h, x, trial.z, trial.stages[0], trial.end), 0.0)
        line = jnp.zeros_like(cubic).at[: min(3, len(piece))].set(piece[:3])
        cubic = jnp.where(trial.ends, cubic, line)
        other, none = solve(cubic, again)
        share = jnp.where(again & ~none, other, share)
        back = jnp.where(again, inward(share, cubic), back)
    states = jax.vmap(lambda s, other: jnp.where(other, at(x, cubic, s), at(x, piece, s)))(share, again)
    states = jnp.where((share == 0)[:, None], x, states)
    times = jnp.where(share == 0, t, t + share * h)
    holds = jax.vmap(lambda k, time, q: bound.conditions(mode, time, q)[k])(jnp.arange(model.M), times, states)
    turned = beyond & ~passed & (back > 0)
    found = beyond & ~passed & holds & ~turned
    flat, deep = found & ~(norm > 0), found & ~(values <= config.relaxation * norm + noise)
    later = share + (1 - share) * jnp.arange(1, SCAN)[:, None] / SCAN
    flank = jax.vmap(
        lambda s: jnp.where(again, each_at(bound, mode, t, h, x, cubic, s), each_at(bound, mode, t, h, x, piece, s))
    )(later)
    deep = deep | (found & (flank > values + noise).any(axis=0))
    bad = turned | flat | deep
    blocked = jnp.argmax(bad)
    kind = jnp.where(turned[blocked], INWARD, jnp.where(flat[blocked], FLAT, DEEP))
    depth = jnp.minimum(config.relaxation, values / jnp.where(norm > 0, norm, 1.0))
    return found, share, times, states, depth, bad.any(), kind, blocked


def values_at_start(bound, lane, trial):
    """The surfaces where a trial begins."""
    return along(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, jnp.zeros(1))[0]


def relaxed_crossing(model, config, p, lane, record, _):
    """What a step that ended in strips leads to: a transition, a shorter step, or nothing where it may be there."""
    mask = lane.phase == CROSS
    still, bound = frozen(lane), Bound(model, frozen(p), lane.segment)
    trial = attempted(model, bound, still, still.trial)
    found, share, times, states, depth, failed, kind, blocked = crossings(model, config, bound, still, trial)
    none = ~found.any() & ~failed
    failed = failed | (none & ~trial.ends)
    first, k, tied = choose(model, config, bound, still, found, times, states)
    shallow = jnp.where(found[k], depth[k], depth[first])
    goes = mask & ~failed & ~none
    ratio = jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        ratio = error_ratio(model, config, still, motion(bound, still), trial.h, error, trial.z)[1]
        lane = lane._replace(h=jnp.where(goes & (lane.halvings == 0), grown(config, lane, trial, ratio), lane.h))
    verdict = Verdict(jnp.asarray(False), failed, kind, blocked, jnp.asarray(False), ratio)
    event = landing(model, p, lane, trial, goes, first, k, share[first], times[first], states[first], shallow, tied)
    record = within_step(config, model, p, lane, record, goes, event)
    lane = shortened(config, lane, verdict, trial, mask & failed)
    return passed_over(lane, mask & none & trial.ends), record, event


def passed_over(lane, mask):
    """A run whose trial has no crossing after all: it counts when it is made again."""
    return lane._replace(clear=lane.clear | mask, phase=jnp.where(mask, STEP, lane.phase))


def grown(config, lane, trial, ratio):
    """The next step after one into a strip."""
    return accepted(config, lane, trial.h, ratio, jnp.isfinite(ratio)).h


def landing(model, p, lane, trial, mask, first, k, share, time, state, depth, tied):
    """The event at a crossing of a step, with derivatives."""
    length = jnp.where(mask, frozen(lane.trial), 0.0)
    bound = Bound(model, p, lane.segment)
    made = attempted(model, bound, lane, length)
    piece = made.piece
    if model.method.interpolant == "secant":  # its derivatives are those of the cubic
        cubic = hermite(made.h, made.x, made.z, made.stages[0], jnp.where(made.ends, made.end, 0.0))
        piece = jnp.where(made.ends, cubic, jnp.zeros_like(cubic).at[:1].set(piece))
    t, x = jnp.where(mask, time, lane.t), jnp.where(mask, state, lane.x)
    t, x = corrected(bound, lane, first, frozen(t), frozen(x), made.t + share * made.h, at(made.x, piece, share))
    return Event(mask, k, t, x, frozen(made.t1), frozen(depth), sizes_of(lane, trial.x, trial.z), tied)


def within_step(config, model, p, lane, record, mask, event):
    """Sample the part of a step before its crossing."""
    if not len(config.times):
        return record
    made = attempted(model, Bound(model, p, lane.segment), lane, jnp.where(mask, frozen(lane.trial), 0.0))
    length = jnp.where(made.h > 0, made.h, 1.0)
    return sampled(
        record, config, mask, lane.mode, made.t, event.t,
        lambda times: jax.vmap(lambda time: at(made.x, made.piece, (time - made.t) / length))(times),
    )  # fmt: skip


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
        reset_at=frozen(event.t), resting=jnp.full_like(lane.resting, -1), made=jnp.asarray(True),
        flowed=event.t > lane.entered_t, edge=edge.astype(jnp.int32),
        slope=frozen(bound.flow(lane.mode, event.t, x)), mode_before=lane.mode,
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
