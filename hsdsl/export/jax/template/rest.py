# pyright: basic
"""Rest on a guard, and Zeno tails that end in it."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import lax

from .functions import INF, chosen, frozen, keeping, when
from .lane import ZENO, contraction, noticed, sampled, scales_here, stopped
from .model import Bound
from .steps import at
from .surfaces import SCAN, UNIT

SAME_UNITS, ZERO_UNITS, ROUNDS, HALVINGS, PARALLEL = 4, 16, 60, 64, 1e-6


def takes_back(slope, back, sizes, noise):
    """Whether one direction is opposite to another that is not zero, relative to the size of each component."""
    moving = slope != 0
    along = jnp.argmax(jnp.where(moving, jnp.abs(slope) / jnp.where(sizes > 0, sizes, 1.0), -1.0))
    share = back[along] / jnp.where(slope[along] == 0, 1.0, slope[along])
    off = jnp.abs(back - share * slope)
    return moving.any() & (share < 0) & (off <= PARALLEL * jnp.abs(share) * sizes + noise).all()


def after_reset(model, bound, mode, k, t, x):
    """Where edge k leads."""
    return bound.routines.reset(model.of(model.edge, mode)[k], bound.p, t, x)


def stays(model, bound, lane, k, t, x):
    """Whether edge k is possible and leaves the state where it is, on a surface that does not move."""
    noise = SAME_UNITS * UNIT * scales_here(model, lane)
    still = (jnp.abs(after_reset(model, bound, lane.mode, k, t, x) - x) <= noise).all()
    return still & (bound.gradients(lane.mode, t, x)[k, 0] == 0) & bound.conditions(lane.mode, t, x)[k]


def flow_sizes(model, bound, lane, t, x):
    """The sizes that the flow of each state has had."""
    rows = jax.jacfwd(lambda x: bound.flow(lane.mode, t, x))(x)
    return jnp.abs(bound.flow(lane.mode, t, x)) + jnp.abs(rows) @ scales_here(model, lane)


def push(model, bound, lane, k, t, x):
    """The first derivative of surface k along the flow, or where that is zero the second."""
    slope = bound.flow(lane.mode, t, x)
    gradient = bound.gradients(lane.mode, t, x)[k]
    rate = bound.rates(lane.mode, t, x)[k]
    size = jnp.abs(gradient[1:]) @ flow_sizes(model, bound, lane, t, x)

    def ahead(s):
        return bound.rates(lane.mode, t + s, x + s * slope)[k]

    second = jax.jvp(ahead, (0.0,), (1.0,))[1]
    zero = jnp.abs(rate) <= ZERO_UNITS * UNIT * size
    return jnp.where(zero, second, rate)


def moves_alone(model, config, bound, lane, k, t, x):
    """Whether the flow moves the state only in the direction that the reset takes back."""
    slope, scales = bound.flow(lane.mode, t, x), scales_here(model, lane)
    moving = (scales > 0) & (config.until * jnp.abs(slope) > scales)
    instant = jnp.where(moving, scales / jnp.where(slope == 0, 1.0, jnp.abs(slope)), config.until).min()
    ahead = x + jnp.sqrt(UNIT) * instant * slope
    back = after_reset(model, bound, lane.mode, k, t, ahead) - ahead
    return takes_back(slope, back, flow_sizes(model, bound, lane, t, x), SAME_UNITS * UNIT * scales)


def kept(model, config, bound, lane, k, t, x):
    """Whether the guard of edge k holds a state."""
    return is_held(model, bound, lane, k, t, x) & moves_alone(model, config, bound, lane, k, t, x)


def is_held(model, bound, lane, k, t, x):
    """The same of a flow that may move more."""
    return stays(model, bound, lane, k, t, x) & (push(model, bound, lane, k, t, x) > 0)


def rests(model, config, p, lane):
    """The edge on whose guard a run rests, or -1."""
    bound, still = Bound(model, frozen(p), lane.segment), frozen(lane)
    loops = model.of(model.loops, lane.mode) & lane.active

    def held():
        return jax.vmap(lambda k: kept(model, config, bound, still, k, still.t, still.x))(jnp.arange(model.M))

    found = loops & when(loops.any(), held, loops)
    return jnp.where(found.any(), jnp.argmax(found), -1)


def releases(model, config, bound, lane, trial):
    """Whether a step over a state at rest ends the rest."""
    if config.scheme == "relaxed" or not model.loops.any():
        return jnp.asarray(False)
    times = trial.t + trial.h * jnp.arange(1, SCAN + 1) / SCAN
    k = jnp.maximum(lane.resting, 0)

    def let_go():
        return ~jax.vmap(lambda t: kept(model, config, bound, lane, k, t, lane.x))(times).all()

    return when(lane.resting >= 0, let_go, jnp.asarray(False))


def release(model, config, bound, lane, trial, before):
    """Whether a rest ends inside a step and before a time, and when."""
    if config.scheme == "relaxed" or not model.loops.any():
        return jnp.asarray(False), lane.t
    shares = jnp.arange(SCAN + 1) / SCAN
    k = jnp.maximum(lane.resting, 0)

    def holds(s):
        return kept(model, config, bound, lane, k, trial.t + s * trial.h, lane.x)

    def look():
        lost = ~jax.vmap(holds)(shares[1:])
        part = jnp.argmax(lost)

        def close(_, ends):
            middle = (ends[0] + ends[1]) / 2
            held = holds(middle)
            return jnp.where(held, middle, ends[0]), jnp.where(held, ends[1], middle)

        _, share = lax.fori_loop(0, HALVINGS, close, (shares[part], shares[part + 1]))
        return jnp.where(lost.any(), trial.t + share * trial.h, INF)

    time = when(lane.resting >= 0, look, jnp.asarray(INF))
    return time < before, time


def fixed_point(reset, x, wanted):
    """The point that repeated resets run to (Aitken's acceleration, by component)."""

    def accelerate(_, x):
        one = reset(x)
        two = reset(one)
        bend = two - 2 * one + x
        return jnp.where(bend == 0, two, x - (one - x) * (one - x) / jnp.where(bend == 0, 1.0, bend))

    found = when(wanted, lambda: lax.fori_loop(0, ROUNDS, accelerate, frozen(x)), frozen(x))
    return keeping(found, accelerate(0, x))


def close_tail(model, config, p, lane, record, mask):
    """Replace a tail of transitions that is nearly over by its limit, if that is a point of rest."""
    bound, still = Bound(model, frozen(p), lane.segment), frozen(lane)
    shrinks, flight, ratio = contraction(still)
    edge = jnp.maximum(still.loops[-1], 0)
    k = jnp.argmax((model.of(model.edge, lane.mode) == edge) & model.of(model.is_edge, lane.mode))
    left = flight * ratio / (1 - jnp.where(ratio < 1, ratio, 0.0))
    end = still.t + left
    near = mask & shrinks & model.of(model.loops, lane.mode)[k] & (left <= config.relaxation) & (end <= bound.end)
    full = Bound(model, p, lane.segment)
    q = fixed_point(lambda x: after_reset(model, full, lane.mode, k, frozen(end), x), lane.x, near)
    limit = frozen(q)
    r = bound.surfaces(lane.mode, end, limit)
    noise = bound.noise(lane.mode, end, limit, still.scale)
    first = bound.surfaces(lane.mode, still.t, still.x)
    before = bound.noise(lane.mode, still.t, still.x, jnp.where(still.active[:, None], still.scale, 0.0))
    others = (r > noise) & ~(first > before) & (jnp.arange(model.M) != k)
    on = (jnp.abs(r[k]) <= noise[k]) & ~others.any()
    goes = near & on & when(near & on, lambda: is_held(model, bound, still, k, end, limit), jnp.asarray(False))
    alone = when(goes, lambda: moves_alone(model, config, bound, still, k, end, limit), jnp.asarray(False))
    record = sampled(
        record, config, goes & alone, lane.mode, lane.t, end,
        lambda times: jax.vmap(lambda time: at(lane.x, (q - lane.x)[None], (time - lane.t) / left))(times),
    )  # fmt: skip
    lane = stopped(lane, goes & ~alone, ZENO)
    active = (jnp.abs(r) <= noise) | (jnp.arange(model.M) == k)
    rest = noticed(model, lane, limit)._replace(
        t=keeping(end, lane.t), x=q, active=active, emerging=jnp.zeros_like(lane.emerging), resting=k.astype(jnp.int32),
        entered_t=end, entered_x=limit, trial=jnp.asarray(config.rest_step, float),
    )  # fmt: skip
    return chosen(goes & alone, rest, lane), record
