# pyright: basic
"""Transitions: where they go from, with derivatives; how a run waits, is reset and recorded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .functions import INF, NAN, chosen, frozen, keeping, with_derivatives_of
from .lane import (
    END,
    ENTER,
    FIRE,
    FREE,
    INWARD,
    LIMIT,
    NOT_FINITE,
    STEP,
    STUCK,
    UNTIL,
    VALUE,
    WAITING,
    contraction,
    flown,
    of_contacts,
    recorded,
    sampled,
    sizes_of,
    stopped,
)
from .model import Bound
from .surfaces import choose, keeps, standing, ties


class Crossing(NamedTuple):
    """Crossings in a step where ``mask`` holds: which surfaces, and where each, M of them.

    ``here`` and ``facts`` are those of the run's own state and of the crossings. A strip is entered at ``landed``, this
    ``depth``. The ``trial`` has them; it ``leaves`` the domain at the time ``left``. ``sizes(first, state)`` are those
    of a crossing; ``point(bound, lane, length, share)`` is its time and state.
    """

    mask: Any
    found: Any
    shares: Any
    times: Any
    states: Any
    here: Any
    facts: Any
    landed: Any
    depth: Any
    length: Any
    trial: Any
    leaves: Any
    left: Any
    sizes: Callable
    point: Callable


class Event(NamedTuple):
    """Where ``mask`` holds: edge k of the mode goes from (t, x); a step into a strip ended at ``landed``, this deep.

    The guards of edges ``held`` held the state until then.
    """

    mask: Any
    k: Any
    t: Any
    x: Any
    landed: Any
    depth: Any
    sizes: Any
    tied: Any
    held: Any


def corrected(bound, lane, k, t, x, time, state):
    """The time and state of a crossing of surface k at (t, x), for their derivatives.

    (time, state) is a point with the same numbers, on the trajectory at a share of a step that does not depend on
    anything; the crossing moves along the flow as the surface's value there says.
    """
    rate = bound.facts(lane.mode, t, x).rates[k]
    r = bound.surfaces(lane.mode, time, state)[k]
    late = -(r - frozen(r)) / frozen(jnp.where(rate == 0, INF, rate))
    return time + late, state + frozen(bound.flow(lane.mode, t, x)) * late


def passed_over(lane, mask):
    """A run whose trial has no crossing after all: it counts when it is made again."""
    return lane._replace(clear=lane.clear | mask, phase=jnp.where(mask, STEP, lane.phase))


def facts_here_and_at(bound, lane, found, times, states):
    """The `Facts` of a run's own state, and those at crossings (rows), in one evaluation."""
    times, states = jnp.where(found, times, lane.t), jnp.where(found[:, None], states, lane.x)
    both = bound.facts(lane.mode, jnp.append(lane.t, times), jnp.concatenate([lane.x[None], states]))
    return jax.tree.map(lambda rows: rows[0], both), jax.tree.map(lambda rows: rows[1:], both)


def decided(model, config, p, lane, crossing):
    """The event of a crossing, of guards that a state is on where no step leads on or the run ends, or on entry."""
    still, goes, fires = frozen(lane), crossing.mask, lane.phase == FIRE
    bound = Bound(model, frozen(p), still.segment, still.contacts)
    may = (lane.failure == VALUE) | ((config.scheme == "relaxed") & (lane.failure >= 1) & (lane.failure <= INWARD))
    may = jnp.where(lane.phase == STUCK, may, lane.phase == END)
    on = may & standing(model, bound, still, crossing.here, still.t, still.x, ties(still.t))
    found, times = jnp.where(goes, crossing.found, on), jnp.where(goes, crossing.times, still.t)
    states = jnp.where(goes, crossing.states, still.x)
    facts = jax.tree.map(lambda ours, own: jnp.where(goes, ours, own), crossing.facts, crossing.here)
    first, k, tied = choose(model, bound, still, found, facts, times, states)

    def point(p, lane, t, x, first, length, share):
        bound = Bound(model, p, lane.segment, lane.contacts)
        return corrected(bound, lane, first, t, x, *crossing.point(bound, lane, length, share))

    length, share = jnp.where(goes, crossing.length, 0.0), jnp.where(goes, crossing.shares[first], 0.0)
    there = times[first], states[first]
    t, x = with_derivatives_of(point)(there, (p, lane, *there, first, length, share))
    t, x = jnp.where(fires, lane.t, t), jnp.where(fires, lane.x, x)
    here = sizes_of(lane, still.x, still.x, still.x == lane.entered_x)
    sizes = jnp.where(goes, crossing.sizes(first, there[1]), here)
    sizes = jnp.where(fires, lane.scale, sizes)
    landed = jnp.where(goes, crossing.landed, jnp.where(lane.phase == END, INF, still.t))
    depth = jnp.where(goes, jnp.where(found[k], crossing.depth[k], crossing.depth[first]), 0.0)
    depth = jnp.where(fires, config.relaxation, depth)
    k = jnp.where(fires, lane.blocked, k)
    return Event(goes | on.any() | fires, k, t, x, landed, depth, sizes, tied & ~fires, jnp.zeros_like(found))


def ended(lane, event):
    """End a run that no step leads on, or that is at its end, where nothing goes; each with its reason."""
    reasons = jnp.asarray([7, 3, 7, 7, 7, 6, 7, 7])  # by failure: a wall, no value, else no step is short enough
    lane = stopped(lane, (lane.phase == END) & ~event.mask, UNTIL)
    return stopped(lane, (lane.phase == STUCK) & ~event.mask, reasons[lane.failure])


def transit(model, config, p, lane, record, event):
    """Make a transition: wait in the strip, reset, and enter the target next."""
    bound, entry, before = Bound(model, p, lane.segment, lane.contacts), lane.phase == FIRE, lane
    edge = model.of(model.edge, lane.mode)[event.k].astype(jnp.int32)
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
        waits = crowded(model, config, bound, lane, edge, event) & ~entry
        resumed = event.t + jnp.where(waits, config.relaxation, 0.0)
    waits = resumed > event.t
    late = waits & (resumed > config.until + ties(config.until))
    resumed = keeping(jnp.minimum(resumed, jnp.where(waits, config.until, resumed)), event.t)
    bad = ~jnp.isfinite(after).all() & ~late
    record = recorded(
        record, lane, mask & (late | ~bad), event.t, jnp.where(late, NAN, resumed), edge, x,
        jnp.where(late, NAN, after), entry,
    )  # fmt: skip
    record = sampled(
        record, config, mask & waits, lane.mode, event.t, jnp.minimum(resumed, config.until),
        lambda times: jnp.broadcast_to(x, (len(times), model.W)),
    )  # fmt: skip
    stops = mask & (late | bad)
    halted = stopped(lane, stops, jnp.where(late, UNTIL, NOT_FINITE))
    halted = halted._replace(
        t=jnp.where(late, config.until, event.t), x=jnp.where(before.phase == END, lane.x, x),
        count=lane.count + jnp.where(late, 1, 0),
    )  # fmt: skip
    crowd, first = two_wait(model, edge, frozen(x), frozen(after))
    after = jnp.where(first, x, after)
    made = entered_next(model, config, bound, lane, event, edge, x, after, scale, resumed, entry)
    made = stopped(made, crowd, WAITING)
    return chosen(mask & ~stops, made, chosen(stops, halted, lane)), record


def two_wait(model, edge, x, after):
    """Whether a reset lets a second execution of an event wait, and the values of the first one that it keeps."""
    waiting, at = model.of(model.waiting, edge), model.of(model.at, edge)
    more = (waiting >= 0) & (x[waiting] >= 1) & (after[waiting] > x[waiting])
    return more.any(), more & ~(after[at] < x[at] - ties(x[at]))


def entered_next(model, config, bound, lane, event, edge, x, after, scale, resumed, entry):
    """A run after a reset; one that a guard made on entry keeps what it knows of the flow before."""

    def kept(old, new):
        return jnp.where(entry, old, new)

    relaxed = config.scheme == "relaxed"
    slope = frozen(bound.flow(lane.mode, event.t, x)) if relaxed else lane.slope  # only the relaxed scheme reads it
    owner = model.of(model.owner, lane.mode).astype(jnp.int32)
    on = event.held | (lane.active & ~event.held.any() & (event.t == lane.t))
    off = jnp.abs(bound.surfaces(owner, event.t, x))
    stays = on & ~entry & (jnp.asarray(model.target)[edge] == owner) & (off >= 0)
    return lane._replace(
        phase=jnp.int32(ENTER), t=resumed, resumed=frozen(resumed), x=after, scale=scale,
        mode=jnp.asarray(model.target, jnp.int32)[edge],
        since=kept(lane.since, since_of(config, lane, event)), inside=jnp.zeros_like(lane.inside),
        reset_at=kept(NAN, frozen(event.t)), contacts=jnp.zeros_like(lane.contacts), made=kept(lane.made, True),
        stood=frozen(jnp.where(stays, off, 0.0)),
        flowed=kept(lane.flowed, event.t > lane.resumed), edge=edge, slope=kept(lane.slope, slope),
        mode_before=kept(lane.mode_before, owner), times=jnp.append(lane.times[1:], frozen(event.t)),
        waits=jnp.append(lane.waits[1:], frozen(resumed - event.t)),
        edges=jnp.append(lane.edges[1:], edge), entries=jnp.append(lane.entries[1:], entry), count=lane.count + 1,
        trial=lane.h, clear=jnp.asarray(False), halvings=jnp.zeros_like(lane.halvings),
        visited_modes=kept(lane.visited_modes, -1).astype(jnp.int32),
    )  # fmt: skip


def crowded(model, config, bound, lane, edge, event):
    """Whether as many transitions as cost no time have fallen within the relaxation of flow, and run to no limit.

    Those of one instant count only where the edge is one of theirs. Those of contacts that move the state run to one.
    """
    counts = (lane.edges == edge).any() | (event.t - lane.times[0] > ties(event.t))
    close = ~contraction(model, lane)[0] & (flown(lane, event.t) <= config.relaxation)
    contact = model.of(model.contact, model.of(model.owner, lane.mode))[event.k] >= 0
    runs = contact & of_contacts(model, lane)[0] & ~keeps(model, bound, lane, event.k, event.t, event.x)
    return frozen((lane.count >= FREE) & close & counts & ~runs)


def since_of(config, lane, event):
    """The time within which a surface that the flow passes is active: of tied transitions that of a tie."""
    if config.scheme == "relaxed":
        return jnp.asarray(0.0)
    tie = ties(event.t)
    at_this_instant = (lane.count > 0) & (event.t - lane.times[-1] - lane.waits[-1] <= tie)
    return frozen(jnp.where(event.tied | at_this_instant, tie, 0.0))
