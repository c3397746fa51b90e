# pyright: basic
"""Entering a mode: at the start, after a reset, where an input jumps; and what happens at boundaries of inputs."""

from __future__ import annotations

import jax.numpy as jnp

from .contact import close_tail, into_contact, out_of_contact, takes_back
from .functions import NAN, chosen, frozen
from .lane import (
    BOUNDARY,
    ENTER,
    FINAL,
    LEFT_DOMAIN,
    LIMIT,
    NOT_FINITE,
    STEP,
    UNTIL,
    ZENO,
    noticed,
    recorded,
    repeats,
    stopped,
)
from .model import Bound
from .surfaces import standing
from .transitions import at_once
from .verdicts import scaled


def boundary(model, config, p, lane, record):
    """Go on behind a jump of an input, or end; the end is closed, so a guard reached at it fires."""
    mask = lane.phase == BOUNDARY
    bound = Bound(model, frozen(p), lane.segment)
    end = mask & bound.last
    if model.holds:
        lane = into_contact(model, p, out_of_contact(model, lane, mask), end)
    still = frozen(lane)
    found = standing(model, bound, still, still.t, still.x, 1e-12 * still.t)
    event = at_once(model, config, p, lane, end & found.any(), found)
    if config.scheme == "relaxed":
        edge = model.of(model.edge, lane.mode)[event.k]
        over = event.mask & (lane.count >= config.max_transitions)
        written = event.mask & ~over
        record = recorded(record, lane, written, event.t, NAN, edge, event.x, NAN, jnp.asarray(False))
        lane = stopped(lane._replace(count=lane.count + written), event.mask, jnp.where(over, LIMIT, UNTIL))
        event = event._replace(mask=jnp.asarray(False))
    lane = stopped(lane, end & ~event.mask & (lane.phase == BOUNDARY), UNTIL)
    values, noise = bound.surfaces(lane.mode, still.t, still.x), bound.noise(lane.mode, still.t, still.x, scaled(still))
    plain = model.of(model.is_edge, lane.mode) & ~model.of(model.conditional, lane.mode)
    jump = lane._replace(
        phase=jnp.int32(ENTER), inside=plain & (values < -noise), since=jnp.asarray(0.0), reset_at=jnp.asarray(NAN),
        made=jnp.asarray(False), visited=lane.visited._replace(room=jnp.int32(0)),
    )  # fmt: skip
    kink = lane._replace(
        phase=jnp.int32(STEP), segment=lane.segment + 1, entered_t=still.t, entered_x=still.x,
        terms=jnp.zeros_like(lane.terms),
    )  # fmt: skip
    if model.holds and config.scheme == "located":
        kink = into_contact(model, p, kink, mask)
    return chosen(mask & ~end, chosen(bound.next_jumps, jump, kink), lane), record, event


def met(model, bound, lane):
    """The surfaces on entry: what the state is beyond, on, and what moved past it while it waited in a strip."""
    t, x, mode = lane.t, lane.x, lane.mode
    values, rates = bound.surfaces(mode, t, x), bound.rates(mode, t, x)
    noise = bound.noise(mode, t, x, lane.scale)
    wide = jnp.maximum(noise, jnp.abs(rates) * lane.since)
    noise = jnp.where((lane.since > 0) & (jnp.abs(values) > noise), wide, noise)
    then = bound.surfaces(mode, jnp.where(jnp.isnan(lane.reset_at), t, lane.reset_at), x)
    passed = (values > noise) & ~(then > noise)
    beyond = ~passed & ((values > noise) | (lane.inside & (values >= -noise)))
    active = passed | (~beyond & (values >= -noise))
    return values, beyond, active, passed & (rates < 0)


def enter(model, config, p, lane, record):
    """Place a run in its mode; a transition that fires at once is made, or the run flows."""
    mask = lane.phase == ENTER
    placed = noticed(model, lane, frozen(lane.x))._replace(
        segment=model.segment(frozen(p), frozen(lane.t)).astype(jnp.int32), entered_t=frozen(lane.t),
        entered_x=frozen(lane.x), terms=jnp.zeros_like(lane.terms), held=jnp.full_like(lane.held, -1),
        trial=lane.h, clear=jnp.asarray(False),
    )  # fmt: skip
    bound, still = Bound(model, frozen(p), placed.segment), frozen(placed)
    values, beyond, active, emerging = met(model, bound, still)
    visited, again = repeats(still.visited, jnp.asarray(False), still.mode, still.x)
    placed = placed._replace(active=active, emerging=emerging, visited=visited)
    own = model.of(model.is_edge, lane.mode)
    fires = beyond & own & ~model.of(model.conditional, lane.mode)
    walls = beyond & model.of(model.is_wall, lane.mode)
    finite = jnp.isfinite(values.sum())
    goes = mask & finite & fires.any() & ~again
    lane = chosen(mask, placed, lane)
    lane = stopped(lane, mask & ~fires.any() & walls.any(), LEFT_DOMAIN)
    lane = stopped(lane, mask & ~finite, NOT_FINITE)
    lane = stopped(lane, mask & again, ZENO)
    lane = stopped(lane, mask & jnp.asarray(model.final)[lane.mode], FINAL)
    lane, record = at_entry(model, config, p, lane, record, goes & (lane.phase == ENTER), fires)
    return flowing(model, config, p, lane, record, mask & ~fires.any() & (lane.phase == ENTER))


def at_entry(model, config, p, lane, record, mask, fires):
    """Make the transition of a surface that a state is beyond on entry."""
    bound = Bound(model, p, lane.segment)
    priority = model.of(model.priority, lane.mode)
    k = jnp.argmax(jnp.where(fires, priority, jnp.iinfo(jnp.int32).min))
    edge = model.of(model.edge, lane.mode)[k].astype(jnp.int32)
    over = mask & (lane.count >= config.max_transitions)
    lane, mask = stopped(lane, over, LIMIT), mask & ~over
    after = bound.routines.reset(edge, bound.p, lane.t, lane.x)
    sizes = frozen(jnp.maximum(jnp.abs(lane.x), lane.scale))
    spread = bound.routines.spread(edge, bound.p, frozen(lane.t), frozen(lane.x), sizes)
    bad = mask & ~jnp.isfinite(after).all()
    lane, mask = stopped(lane, bad, NOT_FINITE), mask & ~bad
    record = recorded(record, lane, mask, lane.t, lane.t, edge, lane.x, after, jnp.asarray(True))
    made = lane._replace(
        x=after, mode=jnp.asarray(model.target, jnp.int32)[edge], inside=jnp.zeros_like(lane.inside),
        scale=frozen(jnp.where(jnp.isfinite(spread).all(), spread, jnp.abs(after))), reset_at=jnp.asarray(NAN),
        times=jnp.concatenate([lane.times[1:], frozen(lane.t)[None]]),
        waits=jnp.concatenate([lane.waits[1:], jnp.zeros(1)]),
        loops=jnp.concatenate([lane.loops[1:], jnp.full(1, -1, jnp.int32)]), count=lane.count + 1,
    )  # fmt: skip
    return chosen(mask, made, lane), record


def flowing(model, config, p, lane, record, mask):
    """Let a run flow that has been entered: unless its cascade returns; what rests does so from here on."""
    bound, still = Bound(model, frozen(p), lane.segment), frozen(lane)
    cascade, same = repeats(still.cascade, still.flowed, still.mode, still.x)
    slides = same & lane.made
    if config.scheme == "relaxed":
        other = bound.flow(still.mode, still.t, still.x)
        undone = takes_back(still.slope, other, jnp.abs(still.slope))
        dimension = jnp.asarray(model.dimension)
        alike = dimension[still.mode_before] == dimension[still.mode]
        slides = slides & (still.mode_before != still.mode) & ~(alike & undone)
    ready = lane._replace(
        phase=jnp.where(lane.t < bound.end, STEP, BOUNDARY).astype(jnp.int32),
        cascade=chosen(lane.made, cascade, lane.cascade), halvings=jnp.zeros_like(lane.halvings),
    )  # fmt: skip
    made = lane.made
    lane = chosen(mask, stopped(ready, slides, ZENO), lane)
    if config.scheme == "relaxed":
        return lane, record
    mask = mask & (lane.phase == STEP)
    if model.loops.any():
        lane, record = close_tail(model, config, p, lane, record, mask & made)
    if model.holds:
        lane = into_contact(model, p, lane, mask & (lane.phase == STEP))
    return lane, record
