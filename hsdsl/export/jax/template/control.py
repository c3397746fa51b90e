# pyright: basic
"""The step size: fixed, or from the embedded error estimate; and when to stop trying shorter ones."""

from __future__ import annotations

import jax.numpy as jnp
from jax import lax

from .lane import scales_here
from .surfaces import UNIT

SAFETY, LEAST, MOST = 0.9, 0.2, 5.0
ALMOST = 1 - 2.0**-30
MOST_HALVINGS, CREEPING_HALVINGS, MOST_CREEPING, IDLE_UNITS, MOST_IDLE = 122, 10, 2000, 64, 64
MOST_REJECTIONS, STRETCH, NOTHING, SHARE, NOISE_UNITS, BLUR_UNITS = 2000, 1e-3, 2.0**-960, 32, 64, 4
MOVES = 2, -2, 6, -6


def cut(h, t, limit):
    """Length and end of a step, and whether it ends at the limit."""
    short = h < (limit - t) * ALMOST
    return jnp.where(short, h, limit - t), jnp.where(short, t + h, limit), ~short


def ratio_to(config, lane, h, error, z, scales, had):
    """Error ratio of a step of length h to z; at most 1 is acceptable."""
    size = jnp.maximum(scales, jnp.abs(z))
    tiny = (h <= config.least) & (had <= config.tolerance * jnp.abs(z))
    counts = (jnp.abs(error) > NOTHING) & ~tiny
    relative = jnp.abs(error) / jnp.where(size > 0, config.tolerance * size, config.tolerance)
    return jnp.where(counts, relative, 0.0).max()


def error_ratio(model, config, lane, flow, h, error, z):
    """The same, with a look at the round-off of the flow where a step is too wrong again."""
    had = scales_here(model, lane)
    ratio = ratio_to(config, lane, h, error, z, had, had)
    looks = (ratio > 1) & (lane.closer | (lane.t == lane.failed_at))

    def look(state):
        found = resolved(model, config, flow, lane.t, h, lane.x, had)
        return False, jnp.where(looks, ratio_to(config, lane, h, error, z, found, had), state[1])

    _, closer = lax.while_loop(lambda state: state[0], look, (looks, ratio))
    lane = lane._replace(
        failed_at=jnp.where(ratio > 1, lane.t, lane.failed_at), closer=jnp.where(looks, closer <= 1, lane.closer)
    )
    return lane, closer


def resolved(model, config, flow, t, h, x, scales):
    """Scales, none below a share of what the terms of the flow could move the state by in a step."""
    slope, moved, places = flow(t, x), scales, jnp.arange(model.W + 1)
    share = jnp.maximum(SHARE, config.tolerance / (NOISE_UNITS * UNIT))
    for _ in range(model.W):
        change = jnp.zeros(model.W)
        for probe in range(4):
            by = jnp.array(MOVES)[(places // 4**probe + probe) % 4] * UNIT
            change = jnp.maximum(change, jnp.abs(flow(t + by[-1] * t, x + by[:-1] * moved) - slope))
        least = h * change / (BLUR_UNITS * UNIT)
        more = jnp.isfinite(least) & (least > share * scales)
        moved = jnp.where(more, jnp.maximum(moved, least), moved)
    return jnp.maximum(scales, moved / share)


def factor(config, ratio):
    """Factor from one step to the next."""
    power = jnp.power(jnp.where(ratio > 0, ratio, 1.0), -1 / config.order)
    return jnp.where(ratio > 0, jnp.clip(SAFETY * power, LEAST, MOST), MOST)


def accepted(config, lane, h, ratio, mask):
    """Learn from an accepted step that was not halved."""
    stretch = lane.stretch + h
    anew = stretch > config.largest * STRETCH
    proposed = h * factor(config, ratio)
    longer = jnp.where(h < lane.h, jnp.maximum(proposed, lane.h), proposed)
    return lane._replace(
        h=jnp.where(mask, jnp.minimum(config.largest, longer), lane.h),
        accepted=jnp.where(mask, jnp.where(anew, 0, lane.accepted + 1), lane.accepted),
        rejected=jnp.where(mask & anew, 0, lane.rejected),
        stretch=jnp.where(mask, jnp.where(anew, 0.0, stretch), lane.stretch),
    )


def rejected(config, lane, h, ratio, mask):
    """Shrink after a step that is too wrong."""
    shorter = h * jnp.minimum(1.0, factor(config, ratio))
    return lane._replace(h=jnp.where(mask, shorter, lane.h), rejected=jnp.where(mask, lane.rejected + 1, lane.rejected))


def struggles(lane):
    """Whether rejections keep pace with steps."""
    return (lane.rejected > MOST_REJECTIONS) & (4 * lane.rejected > lane.accepted)
