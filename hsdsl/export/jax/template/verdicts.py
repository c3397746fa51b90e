# pyright: basic
"""One step as tried, in both schemes: it counts, or is too wrong, or too long, or may have a crossing in it.

What decides is computed from frozen numbers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from .control import cut, error_ratio
from .functions import frozen
from .lane import DEEP, FLAT, VALUE, WALL
from .steps import at, error_of, piece_of, secant, slope_at, step
from .surfaces import SCAN, along


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
        wrong = finite & ~(ratio <= 1)
    own = model.of(model.is_edge | model.is_wall, lane.mode)
    crosses = (rising(lane, values, slopes, first, level) & own).any()
    return lane, Verdict(wrong, ~finite, jnp.asarray(VALUE), jnp.asarray(-1), crosses & finite & ~wrong, ratio)
