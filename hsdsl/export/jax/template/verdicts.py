# pyright: basic
"""One step as tried, in both schemes: it counts, or is too wrong, or too long, or may have a crossing in it.

What decides is computed from frozen numbers.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from .control import cut, error_ratio
from .functions import chosen, frozen, with_derivatives_of
from .lane import DEEP, FLAT, VALUE, WALL, scaled
from .model import Bound, noise_of, norm_of
from .steps import at, error_of, piece_of, secant, slope_at, step
from .surfaces import SCAN, each_at


class Trial(NamedTuple):
    """A step from (t, x) to (t1, z); ``ends`` says whether the flow has a value there."""

    t: Any
    h: Any
    t1: Any
    x: Any
    z: Any
    stages: Any
    end: Any
    ends: Any
    piece: Any
    at_limit: Any


class Verdict(NamedTuple):
    """What a trial is: too wrong, or failed (why, at which surface), or with a crossing to look for; else it counts."""

    wrong: Any
    failed: Any
    failure: Any
    blocked: Any
    crosses: Any
    ratio: Any


def motion(bound, lane):
    """The flow of a run's mode."""
    return lambda t, x: bound.flow(lane.mode, t, x)


def attempted(model, bound, lane, h):
    """Try a step of length h; numbers in ``h`` carry no derivatives."""
    flow, (h, t1, at_limit) = motion(bound, lane), cut(h, lane.t, bound.end)
    z, stages = step(model.method, flow, lane.t, h, lane.x)
    end = flow(t1, z)
    ends = jnp.isfinite(end.sum())
    safe = jnp.where(ends, end, 0.0)
    piece = piece_of(model.method, flow, lane.t, h, lane.x, z, stages, safe)
    line = jnp.zeros_like(piece).at[:1].set(secant(lane.x, z))
    piece = jnp.where(ends & jnp.isfinite(piece).all(), piece, line)
    return Trial(lane.t, h, t1, lane.x, z, stages, end, ends, piece, at_limit)


Made = namedtuple("Made", "t h t1 x z piece")  # a step from (t, x) to (t1, z) and its interpolant, with derivatives


def followed(model, p, lane, trial, length, mask):
    """The step of a trial of this length, with derivatives; where ``mask`` fails one of no length, which has them."""

    def again(p, lane, length):
        made = attempted(model, Bound(model, p, lane.segment, lane.contacts), lane, length)
        return Made(made.t, made.h, made.t1, made.x, made.z, made.piece)

    ours = Made(trial.t, trial.h, trial.t1, trial.x, trial.z, trial.piece)
    none = Made(trial.t, jnp.zeros_like(trial.h), trial.t, trial.x, trial.x, jnp.zeros_like(trial.piece))
    return with_derivatives_of(again)(chosen(mask, ours, none), (p, lane, jnp.where(mask, length, 0.0)))


def terms_of(method, x, h, stages):
    """The sizes of the terms that the end of a step of length h from x is computed from."""
    largest = jnp.abs(jnp.stack(stages)).max(axis=0)
    return frozen(jnp.abs(x) + h * sum(abs(weight) for _, weight in method.b) * largest)


class Ends(NamedTuple):
    """The `Facts` at both ends of a trial, their round-off, and the `Facts` and times and states at some shares."""

    first: Any
    last: Any
    first_noise: Any
    last_noise: Any
    shares: Any
    times: Any
    states: Any


def looked_at(model, bound, lane, trial, count):
    """Surfaces at the ends of a trial and at ``count`` multiples of a part of it, in one evaluation."""
    shares = jnp.arange(count) / SCAN
    states = jax.vmap(lambda s: at(trial.x, trial.piece, s))(shares)
    times = jnp.concatenate([trial.t + shares * trial.h, jnp.stack([trial.t, trial.t1])])
    places = jnp.concatenate([states.reshape(count, len(trial.x)), jnp.stack([trial.x, trial.z])])
    facts = bound.facts(lane.mode, times, places)
    first, last = (jax.tree.map(lambda rows, i=i: rows[i], facts) for i in (count, count + 1))
    sizes = scaled(model, lane)
    return Ends(
        first, last, noise_of(first, trial.t, trial.x, sizes), noise_of(last, trial.t1, trial.z, sizes),
        jax.tree.map(lambda rows: rows[:count], facts), times[:count], states,
    )  # fmt: skip


def judged(model, config, lane, trial, ends):
    """The verdict of the relaxed scheme before crossings are looked for."""
    mode, values, noise = lane.mode, ends.last.values, ends.last_noise
    beyond = (values > 0) & ~(values <= noise)
    wall = beyond & model.of(model.is_wall, mode) & ~lane.emerging
    plain = beyond & model.of(model.is_edge, mode) & ~model.of(model.conditional, mode) & ~lane.emerging
    norm = norm_of(ends.last)
    flat, deep = plain & ~(norm > 0), plain & ~(values <= config.relaxation * norm + noise)
    crosses = beyond & model.of(model.is_edge, mode)
    if model.transparent:  # a conditional surface that a step begins beyond and stays beyond was passed before
        outside = ends.shares.values[0] > ends.first_noise
        crosses = crosses & ~((ends.shares.values > 0).all(axis=0) & outside & model.of(model.conditional, mode))
    finite = jnp.isfinite(trial.z.sum() + values.sum()) & (trial.ends | crosses.any())
    bad = wall | flat | deep
    blocked = jnp.argmax(bad)
    kind = jnp.where(wall[blocked], WALL, jnp.where(flat[blocked], FLAT, DEEP))
    return finite, bad.any(), kind, blocked, crosses.any()


def excursion(model, config, bound, lane, trial, ends):
    """Surfaces that an adaptive step went beyond and came back from: at its eighths, then nearer around the highest."""

    def rate(facts, flow):
        return facts.gradients[:, 0] + facts.gradients[:, 1:] @ flow

    out, back = rate(ends.first, trial.stages[0]), rate(ends.last, trial.end)
    outside = (ends.first.values > ends.first_noise) | (ends.last.values > ends.last_noise)
    looked = (lane.active | ((out > 0) & (back <= 0))) & ~outside
    values, noise = ends.shares.values, noise_of(ends.shares, ends.times, ends.states, scaled(model, lane))
    seen = (values > noise)[1:].any(axis=0)
    noise = jnp.maximum(ends.first_noise, ends.last_noise)

    def nearer(state):
        place, crest, width, going, seen = state
        width, top, least, sides = width / 2, crest, crest, jnp.full(going.shape, True)
        for s in (place - width, place + width):
            within = (s > 0) & (s < 1)
            r = jnp.where(within, each_at(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, s), top)
            seen, sides = seen | (going & (r > noise)), sides & within
            place, top, least = jnp.where(r > top, s, place), jnp.maximum(r, top), jnp.minimum(r, least)
        clear = sides & (top == crest) & (top + (top - least) <= 0)
        return place, top, width, going & ~clear & ~seen & (width * trial.h > config.relaxation), seen

    going = looked & ~seen & (trial.h / SCAN > config.relaxation)
    state = jnp.argmax(values, axis=0) / SCAN, values.max(axis=0), jnp.asarray(1 / SCAN), going, seen
    *_, seen = lax.while_loop(lambda state: state[3].any(), nearer, state)
    return looked & seen


def relaxed_verdict(model, config, bound, lane, trial):
    """The verdict of the relaxed scheme, the run with what its step control learns, and what it looked at."""
    shares = SCAN if model.transparent or config.tolerance is not None else 0
    ends = looked_at(model, bound, lane, trial, shares)
    finite, bad, kind, blocked, crosses = judged(model, config, lane, trial, ends)
    failed = ~finite | bad
    wrong, ratio = jnp.asarray(False), jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        lane, ratio = error_ratio(model, config, lane, motion(bound, lane), trial.h, error, trial.z)
        wrong = ~failed & trial.ends & ~(ratio <= 1)
        away = excursion(model, config, bound, lane, trial, ends)
        back = away.any() & ~failed & ~wrong
        kind, blocked = jnp.where(back, DEEP, kind), jnp.where(back, jnp.argmax(away), blocked)
        failed = failed | back
    kind = jnp.where(finite, kind, VALUE)
    verdict = Verdict(wrong, failed, kind, jnp.where(finite, blocked, -1), crosses & ~failed & ~wrong, ratio)
    return lane, verdict, ends


def looked_along(model, bound, lane, trial):
    """Surfaces and their slopes by the share at the ends of parts of a step, and what counts as above at each end."""
    ends = looked_at(model, bound, lane, trial, SCAN + 1)
    gradients = ends.shares.gradients
    moved = jax.vmap(lambda s: slope_at(trial.piece, s))(jnp.arange(SCAN + 1) / SCAN)
    slopes = gradients[..., 0] * trial.h + (gradients[..., 1:] @ moved[..., None])[..., 0]
    level = jnp.tile(jnp.maximum(ends.first_noise, ends.last_noise), (SCAN, 1))
    return ends, slopes, level.at[-1].set(ends.last_noise)


def rising(lane, values, slopes, first, level):
    """For each part of a step and each surface whether it may rise above its level there.

    It does where it ends above, or has a crest inside. A state on a surface begins at zero; one beyond a surface has to
    come back first. A part begins beyond where the one before ended above, or began beyond and stayed positive: as a
    carry in a sum of two numbers, whose digits are the parts.
    """
    begins = ~lane.active & (values[0] > first)
    values = (values - jnp.where(lane.active, values[0], 0.0))[1:]
    place = jnp.arange(SCAN)[:, None]
    stays, above = (jnp.left_shift(rows.astype(int), place).sum(axis=0) for rows in (values > 0, values > level))
    total = stays + above + begins
    outside = jnp.right_shift(total ^ stays ^ above, place) % 2 == 1
    return ~outside & ((values > level) | ((slopes[:-1] > 0) & (slopes[1:] < 0)))


def located_verdict(model, config, bound, lane, trial):
    """The verdict of the located scheme, the run with what its step control learns, and what it looked at."""
    ends, slopes, level = looked_along(model, bound, lane, trial)
    values = ends.shares.values
    finite = trial.ends & jnp.isfinite(trial.z.sum() + values.sum())
    wrong, ratio = jnp.asarray(False), jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        lane, ratio = error_ratio(model, config, lane, motion(bound, lane), trial.h, error, trial.z)
        wrong = finite & ~(ratio <= 1)
    own = model.of(model.is_edge | model.is_wall, lane.mode)
    crosses = (rising(lane, values, slopes, ends.first_noise, level) & own).any()
    return lane, Verdict(wrong, ~finite, jnp.asarray(VALUE), jnp.asarray(-1), crosses & finite & ~wrong, ratio), ends
