# pyright: basic
"""A run under way (a lane of a batch), and what it records."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .functions import INF, NAN, frozen
from .model import HELD, LOOKED_AT

STEP, CROSS, STUCK, BOUNDARY, END, ENTER, FIRE, TOUCH, DONE = range(9)  # what a lane does next
RUNNING, UNTIL, FINAL, LEFT_DOMAIN, ZENO, LIMIT, NOT_FINITE, UNDERFLOW, STEPS, WAITING = range(10)  # how it ended
STOPS = (
    "running", "until", "final", "left_domain", "zeno", "transition_limit", "not_finite", "step_underflow", "steps",
    "waiting_limit",
)  # fmt: skip
FREE = 16  # transitions within the relaxation that cost no time
CLEAR, WALL, DEEP, FLAT, INWARD, VALUE, WRONG, CREEPING = range(8)  # why a trial step does not count
TIE = 1e-12


class Brent(NamedTuple):
    """One of the states that a cascade led to, with which those after it are compared."""

    mode: Any
    x: Any
    length: Any
    room: Any


class Lane(NamedTuple):
    """Where a run is.

    ``scale`` has the sizes of the numbers that the state was computed from on entry, negative where a reset's terms
    gave them: the next reset reads no more than the value of such a state. ``scales`` has the largest size that each
    state of the model has had. ``active`` and ``emerging`` are as in the reference loop. ``h`` is the step to try next,
    ``trial`` the one under way, halved ``halvings`` times. ``terms`` has the sizes of the terms of the last step.
    ``contacts`` has the numbers of contacts, `HELD` for those that hold the state since ``began``. ``stood`` is how far
    off the surfaces of the mode the state was that it comes from. ``edge`` is that of the last transition, after which
    it ``resumed``, and ``slope`` the flow before it. A chain of entries has ``visited`` the last states in
    ``visited_modes``; ``times``, ``waits``, ``edges`` and ``entries`` are of the last
    ones.
    """

    phase: Any
    stop: Any
    t: Any
    x: Any
    mode: Any
    segment: Any
    scale: Any
    scales: Any
    active: Any
    emerging: Any
    inside: Any
    since: Any
    reset_at: Any
    resumed: Any
    entered_x: Any
    terms: Any
    h: Any
    trial: Any
    clear: Any
    halvings: Any
    failure: Any
    blocked: Any
    reached: Any
    idle: Any
    creeping: Any
    failed_at: Any
    closer: Any
    accepted: Any
    rejected: Any
    stretch: Any
    contacts: Any
    began: Any
    stood: Any
    made: Any
    flowed: Any
    edge: Any
    slope: Any
    mode_before: Any
    cascade: Brent
    visited_modes: Any
    visited: Any
    times: Any
    waits: Any
    edges: Any
    entries: Any
    count: Any
    steps: Any


class Record(NamedTuple):
    """Transitions: when the guard was reached, when flow went on, the edge, the states, whether it fired on entry.

    ``sampled`` has the states at given times, ``sampled_mode`` the modes.
    """

    times: Any
    resumed: Any
    edges: Any
    before: Any
    after: Any
    entries: Any
    sampled: Any
    sampled_mode: Any


def start(model, config, mode, x0):
    """A run at its beginning, and its empty record."""
    w, m, free = model.W, model.M, FREE
    number, integer = (lambda value: jnp.asarray(value, float)), (lambda value: jnp.asarray(value, jnp.int32))
    no, one = jnp.zeros(m, bool), number(config.step)
    brent = Brent(integer(-1), jnp.zeros(w), integer(0), integer(0))
    lane = Lane(
        integer(ENTER), integer(RUNNING), number(0.0), x0, mode, integer(0), jnp.zeros(w), jnp.asarray(config.scale),
        no, no, no, number(0.0), number(NAN), number(0.0), x0, jnp.zeros(w), one, one, jnp.asarray(False),
        integer(0), integer(0), integer(0),
        number(NAN), integer(0), integer(0), number(NAN), jnp.asarray(False), integer(0), integer(0), number(0.0),
        jnp.zeros(model.C), number(0.0), jnp.zeros(m), jnp.asarray(False), jnp.asarray(False), integer(-1),
        jnp.zeros(w), integer(-1), brent, jnp.full(free, -1, jnp.int32), jnp.zeros((free, w)), jnp.full(free, -INF),
        jnp.zeros(free), jnp.full(free, -1, jnp.int32),
        jnp.zeros(free, bool), integer(0), integer(0),
    )  # fmt: skip
    kept, sampled = config.transitions, len(config.times)
    record = Record(
        jnp.full(kept, NAN), jnp.full(kept, NAN), jnp.full(kept, -1, jnp.int32), jnp.full((kept, w), NAN),
        jnp.full((kept, w), NAN), jnp.zeros(kept, bool), jnp.full((sampled, w), NAN),
        jnp.full(sampled, -1, jnp.int32),
    )  # fmt: skip
    return lane, record


def scales_here(model, lane):
    """The scales of the states of the mode that a run is in; 0 after them."""
    place = model.of(model.place, lane.mode)
    return jnp.where(place >= 0, lane.scales[place], 0.0)


def sizes_here(model, lane):
    """The same, or the sizes of the numbers that the state was computed from on entry."""
    return jnp.maximum(scales_here(model, lane), jnp.abs(lane.scale))


def joined(scale, sizes):
    """The sizes of numbers of two sizes, of which the first may have a sign (see `Lane`)."""
    return jnp.where(scale < 0, -1.0, 1.0) * jnp.maximum(jnp.abs(scale), sizes)


def sizes_of(lane, x, z, still):
    """The sizes of the numbers that a point between x and z is computed from, or that those ``still`` came in with."""
    return frozen(joined(jnp.where(still, lane.scale, 0.0), jnp.maximum(jnp.abs(x), jnp.abs(z))))


def releasing(model, lane, least=HELD):
    """The surfaces that end contacts which hold the state, or those of contacts that are looked at, too."""
    place = model.of(model.releases, lane.mode)
    return (place >= 0) & (jnp.append(lane.contacts, 0.0)[place] >= least)


def scaled(model, lane):
    """Sizes that round-off counts with, for each surface: of those the state was on when it entered, and of pushes."""
    pushes = releasing(model, lane, LOOKED_AT)[:, None]
    return jnp.where(pushes, sizes_here(model, lane), jnp.where(lane.active[:, None], lane.scale, 0.0))


def noticed(model, lane, x):
    """Let the scales grow to a state."""
    place = model.of(model.place, lane.mode)
    spot = jnp.where(place >= 0, place, model.S)  # one that is dropped
    return lane._replace(scales=lane.scales.at[spot].max(frozen(jnp.abs(x)), mode="drop"))


def stopped(lane, mask, reason):
    """End a run where ``mask`` holds."""
    return lane._replace(stop=jnp.where(mask, reason, lane.stop), phase=jnp.where(mask, DONE, lane.phase))


def repeats(brent, flowed, mode, x):
    """Count a state of a cascade; say whether one of the same was the same before."""
    begins = flowed | (brent.room == 0)
    same = ~begins & (brent.mode == mode) & (brent.x == x).all()
    length = brent.length + 1
    renew = begins | (~same & (length == brent.room))
    after = Brent(
        jnp.where(renew, mode, brent.mode),
        jnp.where(renew, x, brent.x),
        jnp.where(renew, 0, length),
        jnp.where(begins, 1, jnp.where(renew, 2 * brent.room, brent.room)),
    )
    return after, same


def recorded(record, lane, mask, time, resumed, edge, before, after, entry):
    """Write a transition down where ``mask`` holds, if it is among the first."""
    place = jnp.where(mask, lane.count, len(record.times))
    edge = edge.astype(jnp.int32)
    return record._replace(
        times=record.times.at[place].set(time, mode="drop"),
        resumed=record.resumed.at[place].set(resumed, mode="drop"),
        edges=record.edges.at[place].set(edge, mode="drop"),
        before=record.before.at[place].set(before, mode="drop"),
        after=record.after.at[place].set(after, mode="drop"),
        entries=record.entries.at[place].set(entry, mode="drop"),
    )


def sampled(record, config, mask, mode, t0, t1, point):
    """Write the states at the times in [t0, t1]; those of a later arc go over them."""
    if not len(config.times):
        return record
    times = jnp.asarray(config.times)
    here = mask & (times >= t0) & (times <= t1)
    states = point(jnp.where(here, times, t0))
    return record._replace(
        sampled=jnp.where(here[:, None], states, record.sampled),
        sampled_mode=jnp.where(here, mode, record.sampled_mode),
    )


def last_flights(model, lane, of_flow=False):
    """The last flights of the last edge, which leads back to its mode, and whether there are three.

    Others that lead back to that mode may go meanwhile, also as entries. Time in strips is none ``of_flow``.
    """
    edge = lane.edges[-1]
    same = jnp.asarray(model.source)[lane.edges] == jnp.asarray(model.source)[edge]
    begins = lane.entries & (lane.edges == edge)
    loops = (lane.edges >= 0) & jnp.asarray(model.returns)[lane.edges] & same & ~begins
    own = jnp.cumprod(loops[::-1]).astype(bool) & (lane.edges[::-1] == edge)
    nth = jnp.cumsum(own)
    times = lane.times[::-1]
    times = times + jnp.cumsum(lane.waits[::-1]) - lane.waits[-1] if of_flow else times
    return nth[-1] > 3, jnp.diff(jax.vmap(lambda n: times[jnp.argmax(own & (nth == n))])(jnp.arange(4, 0, -1)))


def contraction(model, lane, of_flow=False):
    """Whether these flights shrink, the last, and the largest ratio."""
    enough, flights = last_flights(model, lane, of_flow)
    before, after = flights[:-1], flights[1:]
    ratio = jnp.where(before > 0, after / jnp.where(before > 0, before, 1.0), INF).max()
    return enough & (flights > 0).all() & (ratio < 1), after[-1], ratio


def flown(lane, t):
    """The time of flow since the first of the last transitions."""
    return t - lane.times[0] - lane.waits.sum()


def of_contacts(model, lane):
    """Whether the last transitions led back to the present mode, each by an edge whose guard can hold a state.

    And the edges of the mode that they were.
    """
    own, known = model.of(model.edge, model.of(model.owner, lane.mode)), lane.edges >= 0
    can = model.of(model.contact, model.of(model.owner, lane.mode)) >= 0
    among = lane.edges[:, None] == jnp.where(can, own, -1)[None]
    return (known & ~lane.entries & among.any(axis=1)).all(), (among & known[:, None]).any(axis=0)
