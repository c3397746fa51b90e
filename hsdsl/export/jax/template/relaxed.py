# pyright: basic
"""Transitions of the relaxed scheme: crossings on the interpolant of a step."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from .control import accepted, error_ratio
from .functions import frozen
from .lane import CROSS, DEEP, FLAT, INWARD, sampled
from .model import Bound
from .steps import at, error_of, hermite
from .surfaces import SCAN, along, choose, each_at, last_up_crossing
from .transitions import Event, corrected, passed_over, sizes_of
from .trials import shortened
from .verdicts import Verdict, attempted, motion, scaled


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


def relaxed_crossing(model, config, p, lane, record):
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
    sizes = sizes_of(lane, trial.x, trial.z)  # those of the entry count for what has not moved since
    sizes = jnp.where(state == lane.entered_x, jnp.maximum(sizes, lane.scale), sizes)
    return Event(mask, k, t, x, frozen(made.t1), frozen(depth), sizes, tied)


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
