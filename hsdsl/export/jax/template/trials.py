# pyright: basic
"""Trial steps, and the step that counts, which is made with derivatives."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from .control import (
    CREEPING_HALVINGS,
    IDLE_UNITS,
    MOST_CREEPING,
    MOST_HALVINGS,
    MOST_IDLE,
    accepted,
    rejected,
    struggles,
)
from .functions import chosen, frozen
from .lane import BOUNDARY, CREEPING, CROSS, STEP, STUCK, WRONG, noticed, sampled
from .model import Bound
from .steps import at
from .surfaces import UNIT
from .verdicts import attempted, followed, located_verdict, relaxed_verdict, terms_of


def advance(model, config, p, lane, record):
    """Try one step of a run that flows."""
    here = (lane.phase == STEP) & (lane.t < Bound(model, p, lane.segment, lane.contacts).end)
    still, length = frozen(lane), frozen(lane.trial)
    bound = Bound(model, frozen(p), still.segment, still.contacts)
    trial = attempted(model, bound, still, length)
    verdict_of = relaxed_verdict if config.scheme == "relaxed" else located_verdict
    learnt, verdict, ends = verdict_of(model, config, bound, still, trial)
    crosses = verdict.crosses & ~lane.clear
    counts = here & ~verdict.wrong & ~verdict.failed & ~crosses
    lane = lane._replace(
        failed_at=jnp.where(here, learnt.failed_at, lane.failed_at), closer=jnp.where(here, learnt.closer, lane.closer)
    )
    lane = lane._replace(phase=jnp.where(here & crosses, CROSS, lane.phase))
    lane = shortened(config, lane, verdict, trial, here & (verdict.wrong | verdict.failed))
    return counted(model, config, p, lane, record, trial, ends, verdict.ratio, counts)


def shortened(config, lane, verdict, trial, mask):
    """Shorten a step that does not count; a run with none that is short enough is stuck."""
    whole = mask & verdict.wrong & (lane.halvings == 0)
    lane = rejected(config, lane, trial.h, verdict.ratio, whole) if config.tolerance is not None else lane
    halvings = jnp.where(mask & ~whole, lane.halvings + 1, lane.halvings)
    length = jnp.where(whole, lane.h, trial.h / 2)
    never = ~(lane.t + length > lane.t) & (verdict.wrong | (config.scheme == "located"))
    ends = (halvings > MOST_HALVINGS) | (verdict.wrong & struggles(lane)) | never
    return lane._replace(
        trial=jnp.where(mask, length, lane.trial),
        halvings=halvings,
        clear=lane.clear & ~mask,
        failure=jnp.where(mask, jnp.where(verdict.wrong, WRONG, verdict.failure), lane.failure),
        blocked=jnp.where(mask, jnp.where(verdict.wrong, -1, verdict.blocked), lane.blocked),
        phase=jnp.where(mask, jnp.where(ends, STUCK, STEP), lane.phase),
    )


def counted(model, config, p, lane, record, tried, ends, ratio, mask):
    """Make the step that counts where ``mask`` holds: what was ``tried`` says how the run goes on from it."""
    bound, values, after = Bound(model, frozen(p), lane.segment, lane.contacts), ends.last.values, lane
    if config.tolerance is not None:
        after = accepted(config, after, tried.h, ratio, lane.halvings == 0)
    after = stalled(config, after, tried, ends)
    made = followed(model, p, lane, tried, frozen(lane.trial), mask)
    record = along_step(config, lane, record, made, mask, made.t1)
    closes = tried.at_limit & (bound.last | bound.next_jumps | lane.active.any() | lane.contacts.any())
    after = noticed(model, after, tried.z)._replace(
        t=made.t1,
        x=made.z,
        terms=terms_of(model.method, tried.x, tried.h, tried.stages),
        active=lane.active & (jnp.abs(values) <= ends.last_noise),
        emerging=lane.emerging & (values > 0) & (ends.last.rates < 0),
        trial=after.h,
        halvings=jnp.zeros_like(lane.halvings),
        clear=jnp.asarray(False),
        phase=jnp.where(after.phase == STUCK, STUCK, jnp.where(closes, BOUNDARY, STEP)),
        segment=jnp.where(tried.at_limit & ~closes, lane.segment + 1, lane.segment),
    )
    return chosen(mask, after, lane), record


def along_step(config, lane, record, made, mask, end):
    """Sample a step until some time."""
    if not len(config.times):
        return record
    length = jnp.where(made.h > 0, made.h, 1.0)
    return sampled(
        record, config, mask, lane.mode, made.t, end,
        lambda times: jax.vmap(lambda time: at(made.x, made.piece, (time - made.t) / length))(times),
    )  # fmt: skip


def stalled(config, lane, trial, ends):
    """Count steps in a row that had to be cut short; a run that creeps, or closes in on something, is stuck."""
    cut_short = lane.halvings > 0
    fresh = trial.t != lane.reached
    idle, creeping = jnp.where(fresh, 0, lane.idle), jnp.where(fresh, 0, lane.creeping)
    small = trial.h <= IDLE_UNITS * UNIT * jnp.maximum(trial.t, lane.h)
    same = (lane.blocked >= 0) & (ends.last.values == ends.first.values)[lane.blocked]
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
