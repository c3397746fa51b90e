# pyright: basic
"""Entering a mode: at the start, after a reset, where an input jumps; and what happens at boundaries of inputs."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from .contact import close_tail, in_touch, into_contact, takes_back, unresolved
from .functions import NAN, chosen, frozen
from .lane import (
    BOUNDARY,
    END,
    ENTER,
    FINAL,
    FIRE,
    LEFT_DOMAIN,
    NOT_FINITE,
    RUNNING,
    STEP,
    TOUCH,
    ZENO,
    noticed,
    repeats,
    scaled,
    stopped,
)
from .model import Bound, noise_of


def boundary(model, config, p, lane, here, held):
    """Go on after a jump of an input, or end: a jump at the end is made, and a guard reached there fires.

    ``held`` are the edges whose guards the state was held by, ``here`` the `Facts` there.
    """
    mask, still = lane.phase == BOUNDARY, frozen(lane)
    bound = Bound(model, frozen(p), lane.segment)
    sizes = jnp.maximum(scaled(model, still), still.scale)  # as on entry
    noise, values = noise_of(here, still.t, still.x, sizes), bound.surfaces(still.mode, still.t, still.x)
    plain = model.of(model.is_edge, lane.mode) & ~model.of(model.conditional, lane.mode) & ~held
    touches = TOUCH if config.scheme == "located" and model.holds else STEP
    jump = lane._replace(
        phase=jnp.int32(ENTER), inside=plain & (here.values < -noise), since=jnp.asarray(0.0),
        reset_at=jnp.asarray(NAN), made=jnp.asarray(False), visited_modes=jnp.full_like(lane.visited_modes, -1),
        stood=jnp.where(lane.active & ~lane.emerging, jnp.abs(values), 0.0),
    )  # fmt: skip
    kink = lane._replace(
        phase=jnp.int32(touches), segment=lane.segment + 1, entered_x=still.x, terms=jnp.zeros_like(lane.terms),
    )  # fmt: skip
    end = lane._replace(phase=jnp.int32(END if touches == STEP else TOUCH))
    return chosen(mask, chosen(bound.last, end, chosen(bound.next_jumps, jump, kink)), lane)


def at_the_end(model, p, lane):
    """A run at its end, unless it has to leave guards that hold it, or may be held by one, first."""
    ends = (lane.phase == BOUNDARY) & Bound(model, frozen(p), lane.segment).last
    may_be_held = lane.active & (model.of(model.contact, lane.mode) >= 0)
    ends = ends & ~may_be_held.any() & ~lane.contacts.any()
    return lane._replace(phase=jnp.where(ends, END, lane.phase).astype(jnp.int32))


def met(model, bound, lane):
    """The surfaces on entry: what the state is beyond, on, and what moved past it while it waited in a strip."""
    t, x, mode = lane.t, lane.x, lane.mode
    then = jnp.where(jnp.isnan(lane.reset_at), t, lane.reset_at)
    both = bound.facts(mode, jnp.stack([t, then]), jnp.stack([x, x]))
    facts = jax.tree.map(lambda rows: rows[0], both)
    values, rates = facts.values, facts.rates
    noise = jnp.maximum(noise_of(facts, t, x, lane.scale), lane.stood)
    wide = jnp.maximum(noise, jnp.abs(rates) * lane.since)
    noise = jnp.where((lane.since > 0) & (jnp.abs(values) > noise), wide, noise)
    passed = (values > noise) & ~(both.values[1] > noise)
    beyond = ~passed & ((values > noise) | (lane.inside & (values >= -noise)))
    active = passed | (~beyond & (values >= -noise))
    return values, beyond, active, passed & (rates < 0)


def enter(model, config, p, lane):
    """Place a run in its mode; a guard fires at once, or the run flows. Returns which flow."""
    mask = lane.phase == ENTER
    placed = noticed(model, lane, frozen(lane.x))._replace(
        segment=model.segment(frozen(p), frozen(lane.t)).astype(jnp.int32), entered_x=frozen(lane.x),
        terms=jnp.zeros_like(lane.terms), contacts=jnp.zeros_like(lane.contacts),
        trial=lane.h, clear=jnp.asarray(False),
    )  # fmt: skip
    bound, still = Bound(model, frozen(p), placed.segment, placed.contacts), frozen(placed)
    values, beyond, active, emerging = met(model, bound, still)
    decides = model.decisive(still.mode, still.x)
    again = ((still.visited_modes == still.mode) & (still.visited == decides).all(axis=1)).any()
    own, priority = model.of(model.is_edge, lane.mode), model.of(model.priority, lane.mode)
    fires = beyond & own & ~model.of(model.conditional, lane.mode)
    walls = beyond & model.of(model.is_wall, lane.mode)
    first = jnp.argmax(jnp.where(fires, priority, jnp.iinfo(jnp.int32).min)).astype(jnp.int32)
    placed = placed._replace(
        visited_modes=jnp.append(still.visited_modes[1:], still.mode),
        visited=jnp.concatenate([still.visited[1:], decides[None]]),
        active=active,
        emerging=emerging,
        blocked=jnp.where(fires.any(), first, lane.blocked),
    )
    stop = jnp.where(walls.any() & ~fires.any(), LEFT_DOMAIN, RUNNING)
    stop = jnp.where(jnp.isfinite(values.sum()), stop, NOT_FINITE)
    stop = jnp.where(jnp.asarray(model.final)[lane.mode], FINAL, jnp.where(again, ZENO, stop))
    placed = placed._replace(phase=jnp.where(fires.any(), FIRE, ENTER).astype(jnp.int32))
    lane = chosen(mask, stopped(placed, stop != RUNNING, stop), lane)
    return flowing(model, config, bound, lane, mask & (lane.phase == ENTER))


def flowing(model, config, bound, lane, mask):
    """Let a run flow that has been entered, unless its cascade returns. Returns which flow after a transition, too."""
    still = frozen(lane)
    cascade, same = repeats(still.cascade, still.flowed, still.mode, model.decisive(still.mode, still.x))
    slides = same & lane.made
    if config.scheme == "relaxed":
        other = bound.flow(still.mode, still.t, still.x)
        undone = takes_back(still.slope, other)
        dimension = jnp.asarray(model.dimension)
        alike = dimension[still.mode_before] == dimension[still.mode]
        slides = slides & (still.mode_before != still.mode) & ~(alike & undone)
    flows = TOUCH if config.scheme == "located" and model.holds else STEP
    ready = lane._replace(
        phase=jnp.where(lane.t < bound.end, flows, BOUNDARY).astype(jnp.int32),
        cascade=chosen(lane.made, cascade, lane.cascade), halvings=jnp.zeros_like(lane.halvings),
    )  # fmt: skip
    lane = chosen(mask, stopped(ready, slides, ZENO), lane)
    return lane, mask & (lane.stop == RUNNING)


def held_on(model, config, p, lane, record, flows):
    """Guards may hold runs that flow on; those that flow after a transition go to the end of a tail of them."""
    entered, touched = lane, jnp.zeros_like(lane.active)
    if model.holds and config.scheme == "located":
        lane = into_contact(model, p, lane, lane.phase == TOUCH)
        touched = in_touch(model, lane)
    if model.loops.any():
        after = flows & lane.made & (lane.stop == RUNNING) & (lane.mode_before == entered.mode)
        over = after & unresolved(model, config, frozen(entered))
        if config.scheme == "located":
            ended, record, mask = close_tail(model, config, p, entered, record, touched, after)
            lane, over = chosen(mask, ended, lane), over & ~mask
        lane = stopped(lane, over, ZENO)
    return lane, record
