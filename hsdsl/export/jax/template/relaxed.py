# pyright: basic
"""Transitions of the relaxed scheme: crossings on the interpolant of a step."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .contact import may_hold_next
from .control import accepted, error_ratio
from .functions import frozen
from .lane import CROSS, DEEP, FLAT, INWARD, scaled, sizes_of
from .model import Bound, noise_of, norm_of
from .steps import at, error_of, hermite
from .surfaces import SCAN, each_at, last_up_crossing, states_at
from .transitions import Crossing, facts_here_and_at, passed_over
from .trials import shortened
from .verdicts import Verdict, attempted, motion


def pieces_of(method, trial):
    """The interpolants to search, as rows of equal length: the method's, and a cubic where that turns back."""
    if method.interpolant == "hermite":
        return trial.piece[None]
    cubic = hermite(trial.h, trial.x, trial.z, trial.stages[0], trial.end)
    rows = max(3, len(trial.piece))
    piece, cubic = (jnp.zeros((rows, *p.shape[1:])).at[: len(p)].set(p) for p in (trial.piece, cubic))
    line = jnp.zeros_like(cubic).at[:3].set(piece[:3])
    return jnp.stack([piece, jnp.where(trial.ends, cubic, line)])


def crossings(model, config, bound, lane, trial):
    """The last up-crossings of surfaces that a trial ended beyond; and whether it fails at one, which and why."""
    mode, t, h, x = lane.mode, trial.t, trial.h, trial.x
    reach = jnp.maximum(jnp.abs(x), jnp.abs(trial.z))
    times, places = jnp.stack([t, trial.t1, trial.t1]), jnp.stack([x, trial.z, reach])
    ends = bound.facts(mode, times, places)
    noises, norm = noise_of(ends, times, places, scaled(model, lane)), norm_of(ends)[1]
    values, noise, small = ends.values[1], noises[1], noises[2] / 16
    beyond = (values > noise) & model.of(model.is_edge, mode)
    may_pass = (lane.emerging | model.of(model.conditional, mode)) & (ends.values[0] > noises[0])
    pieces = pieces_of(model.method, trial)

    def solve(state, numbered):
        """Search the surfaces on one interpolant; those that turn back little are searched on the next."""
        needed, share, passed, back = state
        number, piece = numbered
        found = last_up_crossing(lambda s: each_at(bound, mode, t, h, x, piece, s), small, needed)
        none = needed & jnp.isnan(found) & may_pass
        share = jnp.where(needed & ~none, jnp.where(jnp.isnan(found), 0.0, found), share)
        rates = jnp.diagonal(bound.facts(mode, t + share * h, states_at(x, piece, share)).rates)
        back = jnp.where(needed, jnp.where(-rates * h > noise, -rates * h, 0.0), back)
        again = needed & ~none & (back > 0) & (back <= config.relaxation * norm)
        return (again, share, passed | (none & (number == 0)), back), again

    no, zero = jnp.zeros(model.M, bool), jnp.zeros(model.M)
    (_, share, passed, back), again = lax.scan(solve, (beyond, zero, no, zero), (jnp.arange(len(pieces)), pieces))
    own = jnp.where(again[0][:, None, None], pieces[-1], pieces[0])
    states = jnp.where((share == 0)[:, None], x, states_at(x, own, share))
    times = jnp.where(share == 0, t, t + share * h)
    turned = beyond & ~passed & (back > 0)
    here, facts = facts_here_and_at(bound, lane, beyond, times, states)
    found = beyond & ~passed & ~turned
    found = found & (
        jnp.diagonal(facts.conditions) | holds_next(model, bound, lane, trial, own, share, values, found, facts)
    )
    flat, deep = found & ~(norm > 0), found & ~(values <= config.relaxation * norm + noise)
    later = share + (1 - share) * jnp.arange(1, SCAN)[:, None] / SCAN
    flank = jax.vmap(lambda s: each_at(bound, mode, t, h, x, own, s))(later)
    deep = deep | (found & (flank > values + noise).any(axis=0))
    bad = turned | flat | deep
    blocked = jnp.argmax(bad)
    kind = jnp.where(turned[blocked], INWARD, jnp.where(flat[blocked], FLAT, DEEP))
    depth = jnp.minimum(config.relaxation, values / jnp.where(norm > 0, norm, 1.0))
    return (found, share, times, states, here, facts), depth, bad.any(), kind, blocked


def holds_next(model, bound, lane, trial, pieces, share, values, found, facts):
    """Whether an `if` holds next, of a surface that the state is on: where a hop ends that round-off hides."""
    returning = found & ((share == 0) | lane.active) & ~jnp.diagonal(facts.conditions)
    back = -jnp.diagonal(facts.rates) * trial.h
    hop = share + jnp.where(back > 0, (1 - share) * back / (jnp.where(back > 0, back, 0.0) + values), 0.0)
    points = states_at(trial.x, pieces, jnp.where(returning, hop, share))
    return may_hold_next(model, bound, lane, returning, trial.t + hop * trial.h, points)


def relaxed_crossing(model, config, p, lane):
    """What a step that ended in strips leads to: a transition, a shorter step, or nothing where it may be there."""
    mask = lane.phase == CROSS
    still, bound = frozen(lane), Bound(model, frozen(p), lane.segment, lane.contacts)
    trial = attempted(model, bound, still, still.trial)
    points, depth, failed, kind, blocked = crossings(model, config, bound, still, trial)
    none = ~points[0].any() & ~failed
    failed = failed | (none & ~trial.ends)
    goes = mask & ~failed & ~none
    ratio = jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        ratio = error_ratio(model, config, still, motion(bound, still), trial.h, error, trial.z)[1]
        longer = accepted(config, lane, trial.h, ratio, jnp.isfinite(ratio)).h
        lane = lane._replace(h=jnp.where(goes & (lane.halvings == 0), longer, lane.h))
    verdict = Verdict(jnp.asarray(False), failed, kind, blocked, jnp.asarray(False), ratio)

    def sizes(first, state):  # those of the entry count for what has not moved since, and on a guard not left
        last = jnp.where(points[1][first] > 0, trial.z, trial.x)
        return sizes_of(still, trial.x, last, (last == still.entered_x) | still.active[first])

    crossing = Crossing(
        goes, *points, trial.t1, depth, still.trial, trial, jnp.asarray(False), trial.t, sizes,
        lambda *given: on_step(model.method, *given),
    )  # fmt: skip
    lane = shortened(config, lane, verdict, trial, mask & failed)
    return passed_over(lane, mask & none & trial.ends), crossing


def on_step(method, bound, lane, length, share):
    """The point at a share of a step, with derivatives; those of a straight line are those of the cubic."""
    made = attempted(bound.model, bound, lane, length)
    piece = made.piece
    if method.interpolant == "secant":
        cubic = hermite(made.h, made.x, made.z, made.stages[0], jnp.where(made.ends, made.end, 0.0))
        piece = jnp.where(made.ends, cubic, jnp.zeros_like(cubic).at[:1].set(piece))
    return made.t + share * made.h, at(made.x, piece, share)
