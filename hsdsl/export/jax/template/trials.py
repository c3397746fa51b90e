# pyright: basic
"""One step as tried, in both schemes: it counts, or is too wrong, or too long, or there may be a crossing in it.

What decides is computed from frozen numbers; the step that counts is then made with derivatives.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .control import (
    CREEPING_HALVINGS,
    IDLE_UNITS,
    MOST_CREEPING,
    MOST_HALVINGS,
    MOST_IDLE,
    accepted,
    cut,
    error_ratio,
    rejected,
    struggles,
)
from .functions import chosen, frozen
from .lane import BOUNDARY, CREEPING, CROSS, DEEP, FLAT, STEP, STUCK, VALUE, WALL, WRONG, noticed, sampled
from .model import Bound
from .steps import at, error_of, piece_of, secant, slope_at, step
from .surfaces import SCAN, UNIT, along


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
    """The flow of a run's mode; at rest nothing moves."""
    return lambda t, x: jnp.where(lane.resting < 0, bound.flow(lane.mode, t, x), 0.0)


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


def terms_of(method, x, h, stages):
    """The sizes of the terms that the end of a step of length h from x is computed from."""
    largest = jnp.abs(jnp.stack(stages)).max(axis=0)
    return frozen(jnp.abs(x) + h * sum(abs(weight) for _, weight in method.b) * largest)


def scaled(lane):
    """Sizes that round-off counts with, for each surface: on those that the state was on when it entered."""
    return jnp.where(lane.active[:, None], lane.scale, 0.0)


def judged(model, config, bound, lane, trial):
    """The verdict of the relaxed scheme before crossings are looked for."""
    mode, t1, z = lane.mode, trial.t1, trial.z
    values = bound.surfaces(mode, t1, z)
    noise = bound.noise(mode, t1, z, scaled(lane))
    beyond = (values > 0) & ~(values <= noise)
    wall = beyond & model.of(model.is_wall, mode) & ~lane.emerging
    plain = beyond & model.of(model.is_edge, mode) & ~model.of(model.conditional, mode) & ~lane.emerging
    norm = bound.norm(mode, t1, z)
    flat, deep = plain & ~(norm > 0), plain & ~(values <= config.relaxation * norm + noise)
    crosses = beyond & model.of(model.is_edge, mode)
    if model.transparent:
        crosses = crosses & ~passed_before(model, bound, lane, trial)
    finite = jnp.isfinite(z.sum() + values.sum()) & (trial.ends | crosses.any())
    bad = wall | flat | deep
    blocked = jnp.argmax(bad)
    kind = jnp.where(wall[blocked], WALL, jnp.where(flat[blocked], FLAT, DEEP))
    return finite, bad.any(), kind, blocked, crosses.any()


def passed_before(model, bound, lane, trial):
    """Conditional surfaces that a step begins beyond and stays beyond."""
    shares = jnp.arange(SCAN) / SCAN
    values = along(bound, lane.mode, trial.t, trial.h, trial.x, trial.piece, shares)
    outside = values[0] > bound.noise(lane.mode, trial.t, trial.x, scaled(lane))
    return (values > 0).all(axis=0) & outside & model.of(model.conditional, lane.mode)


def excursion(model, bound, lane, trial):
    """Surfaces that an adaptive step went beyond and came back from."""
    mode, shares = lane.mode, jnp.arange(SCAN) / SCAN

    def rate(t, x, flow):
        gradient = bound.gradients(mode, t, x)
        return gradient[:, 0] + gradient[:, 1:] @ flow

    out, back = rate(trial.t, trial.x, trial.stages[0]), rate(trial.t1, trial.z, trial.end)

    def beyond(s):
        t, x = trial.t + s * trial.h, at(trial.x, trial.piece, s)
        r, noise = bound.surfaces(mode, t, x), bound.noise(mode, t, x, scaled(lane))
        return (r > noise) & bound.conditions(mode, t, x)

    seen = jax.vmap(beyond)(shares)
    first = bound.surfaces(mode, trial.t, trial.x) > bound.noise(mode, trial.t, trial.x, scaled(lane))
    return (out > 0) & (back <= 0) & seen[1:].any(axis=0) & ~first


def relaxed_verdict(model, config, bound, lane, trial):
    """The verdict of the relaxed scheme, and the run with what its step control learns."""
    finite, bad, kind, blocked, crosses = judged(model, config, bound, lane, trial)
    failed = ~finite | bad
    wrong, ratio = jnp.asarray(False), jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        lane, ratio = error_ratio(model, config, lane, motion(bound, lane), trial.h, error, trial.z)
        wrong = ~failed & trial.ends & ~(ratio <= 1)
        away = excursion(model, bound, lane, trial)
        back = away.any() & ~failed & ~wrong & ~crosses
        kind, blocked = jnp.where(back, DEEP, kind), jnp.where(back, jnp.argmax(away), blocked)
        failed = failed | back
    kind = jnp.where(finite, kind, VALUE)
    return lane, Verdict(wrong, failed, kind, jnp.where(finite, blocked, -1), crosses & ~failed & ~wrong, ratio)


def looked_along(model, bound, lane, trial):
    """Surfaces and their slopes by the share at the ends of the parts of a step, and what counts as above."""
    mode, shares = lane.mode, jnp.arange(SCAN + 1) / SCAN

    def look(s):
        t, x = trial.t + s * trial.h, at(trial.x, trial.piece, s)
        gradient = bound.gradients(mode, t, x)
        return bound.surfaces(mode, t, x), gradient[:, 0] * trial.h + gradient[:, 1:] @ slope_at(trial.piece, s)

    values, slopes = jax.vmap(look)(shares)
    first = bound.noise(mode, trial.t, trial.x, scaled(lane))
    last = bound.noise(mode, trial.t1, trial.z, scaled(lane))
    return values, slopes, first, jnp.maximum(first, last)


def rising(lane, values, slopes, first, level, outside=None):
    """For each part of a step and each surface whether it may rise above its level there.

    It does where it ends above, or has a crest inside. A state on a surface begins at zero; one beyond a surface has to
    come back first.
    """
    values = values - jnp.where(lane.active, values[0], 0.0)
    outside = ~lane.active & (values[0] > first) if outside is None else outside
    rows = []
    for i in range(SCAN):
        above = values[i + 1] > level
        rows.append(~outside & (above | ((slopes[i] > 0) & (slopes[i + 1] < 0))))
        outside = jnp.where(outside, values[i + 1] > 0, above)
    return jnp.stack(rows)


def located_verdict(model, config, bound, lane, trial):
    """The verdict of the located scheme, and the run with what its step control learns."""
    values, slopes, first, level = looked_along(model, bound, lane, trial)
    finite = trial.ends & jnp.isfinite(trial.z.sum() + values.sum())
    wrong, ratio = jnp.asarray(False), jnp.asarray(0.0)
    if config.tolerance is not None:
        error = error_of(model.method, trial.h, trial.stages, trial.end)
        lane, ratio = error_ratio(model, config, lane, motion(bound, lane), trial.h, error, trial.z)
        ratio = jnp.where(lane.resting < 0, ratio, 0.0)
        wrong = finite & ~(ratio <= 1)
    own = model.of(model.is_edge | model.is_wall, lane.mode) & (jnp.arange(model.M) != lane.resting)
    crosses = (rising(lane, values, slopes, first, level) & own).any()
    return lane, Verdict(wrong, ~finite, jnp.asarray(VALUE), jnp.asarray(-1), crosses & finite & ~wrong, ratio)


def advance(model, config, released, p, lane, record):
    """Try one step of a run that flows."""
    here = (lane.phase == STEP) & (lane.t < Bound(model, p, lane.segment).end)
    still, length = frozen(lane), frozen(lane.trial)
    bound = Bound(model, frozen(p), still.segment)
    trial = attempted(model, bound, still, length)
    verdict_of = relaxed_verdict if config.scheme == "relaxed" else located_verdict
    learnt, verdict = verdict_of(model, config, bound, still, trial)
    crosses = verdict.crosses | (released(model, config, bound, still, trial) & ~verdict.failed & ~verdict.wrong)
    crosses = crosses & ~lane.clear
    counts = here & ~verdict.wrong & ~verdict.failed & ~crosses
    lane = lane._replace(
        failed_at=jnp.where(here, learnt.failed_at, lane.failed_at),
        closer=jnp.where(here, learnt.closer, lane.closer),
    )
    lane = lane._replace(phase=jnp.where(here & crosses, CROSS, lane.phase))
    lane = shortened(config, lane, verdict, trial, here & (verdict.wrong | verdict.failed))
    return counted(model, config, p, lane, record, trial, verdict.ratio, counts)


def shortened(config, lane, verdict, trial, mask):
    """Shorten a step that does not count; a run with none that is short enough is stuck."""
    whole = mask & verdict.wrong & (lane.halvings == 0)
    lane = rejected(config, lane, trial.h, verdict.ratio, whole) if config.tolerance is not None else lane
    halvings = jnp.where(mask & ~whole, lane.halvings + 1, lane.halvings)
    length = jnp.where(whole, lane.h, trial.h / 2)
    never = ~(lane.t + length > lane.t)
    ends = (halvings > MOST_HALVINGS) | (verdict.wrong & struggles(lane)) | (never & located_or(config, verdict.wrong))
    return lane._replace(
        trial=jnp.where(mask, length, lane.trial),
        halvings=halvings,
        clear=lane.clear & ~mask,
        failure=jnp.where(mask, jnp.where(verdict.wrong, WRONG, verdict.failure), lane.failure),
        blocked=jnp.where(mask, jnp.where(verdict.wrong, -1, verdict.blocked), lane.blocked),
        phase=jnp.where(mask, jnp.where(ends, STUCK, STEP), lane.phase),
    )


def located_or(config, mask):
    """True in the located scheme, which ends where time cannot go on; the relaxed one there only where it is wrong."""
    return True if config.scheme == "located" else mask


def counted(model, config, p, lane, record, tried, ratio, mask):
    """Make the step that counts where ``mask`` holds: what was ``tried`` says how the run goes on from it."""
    still, bound = frozen(lane), Bound(model, frozen(p), frozen(lane.segment))
    values = bound.surfaces(lane.mode, tried.t1, tried.z)
    noise = bound.noise(lane.mode, tried.t1, tried.z, scaled(still))
    after = lane
    if config.tolerance is not None:
        after = accepted(config, after, tried.h, ratio, (lane.halvings == 0) & (lane.resting < 0))
    after = stalled(config, bound, after, tried, values)
    # elsewhere a step of no length is made, which has derivatives
    trial = attempted(model, Bound(model, p, lane.segment), lane, jnp.where(mask, still.trial, 0.0))
    length = jnp.where(trial.h > 0, trial.h, 1.0)
    record = sampled(
        record, config, mask, lane.mode, trial.t, trial.t1,
        lambda times: jax.vmap(lambda time: at(trial.x, trial.piece, (time - trial.t) / length))(times),
    )  # fmt: skip
    ends = tried.at_limit & (bound.last | bound.next_jumps)
    after = noticed(model, after, tried.z)._replace(
        t=trial.t1,
        x=trial.z,
        terms=terms_of(model.method, tried.x, tried.h, tried.stages),
        active=lane.active & (jnp.abs(values) <= noise),
        emerging=lane.emerging & (values > 0) & (bound.rates(lane.mode, tried.t1, tried.z) < 0),
        trial=jnp.where(lane.resting < 0, after.h, config.rest_step),
        halvings=jnp.zeros_like(lane.halvings),
        clear=jnp.asarray(False),
        phase=jnp.where(after.phase == STUCK, STUCK, jnp.where(ends, BOUNDARY, STEP)),
        segment=jnp.where(tried.at_limit & ~ends, lane.segment + 1, lane.segment),
    )
    return chosen(mask, after, lane), record


def stalled(config, bound, lane, trial, values):
    """Count steps in a row that had to be cut short; a run that creeps, or closes in on something, is stuck."""
    cut_short = lane.halvings > 0
    fresh = trial.t != lane.reached
    idle, creeping = jnp.where(fresh, 0, lane.idle), jnp.where(fresh, 0, lane.creeping)
    small = trial.h <= IDLE_UNITS * UNIT * jnp.maximum(trial.t, lane.h)
    before = bound.surfaces(lane.mode, trial.t, trial.x)
    same = (lane.blocked >= 0) & (values == before)[lane.blocked]
    idle = jnp.where(small | same, idle + 1, 0)
    creeping = jnp.where(lane.halvings >= CREEPING_HALVINGS, creeping + 1, 0)
    gives_up = (idle > MOST_IDLE) | (small & (trial.z == trial.x).all())
    ends = cut_short & ((gives_up & (config.scheme == "relaxed")) | (creeping > MOST_CREEPING))
    return lane._replace(
        reached=jnp.where(cut_short, trial.t1, lane.reached),
        idle=jnp.where(cut_short, idle, lane.idle),
        creeping=jnp.where(cut_short, creeping, lane.creeping),
        failure=jnp.where(ends & ~gives_up, CREEPING, lane.failure),
        phase=jnp.where(ends, STUCK, lane.phase),
    )
