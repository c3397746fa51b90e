# pyright: basic, reportCallIssue=false
"""The loop of a run, and the experiment of a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from .contact import let_go
from .entry import at_the_end, boundary, enter, held_on
from .functions import frozen
from .lane import FINAL, RUNNING, STEP, STEPS, STOPS, start
from .located import located_crossing
from .model import Bound, Model
from .relaxed import relaxed_crossing
from .transitions import decided, ended, transit
from .trials import advance, along_step
from .verdicts import followed

ROUND = 16  # trial steps between two looks at what they found
MOST_STEPS = 10_000_000


@dataclass(frozen=True)
class Config:
    """Settings of a run; one of ``step`` and ``tolerance`` decides, the other is its beginning or None."""

    scheme: str
    step: float
    tolerance: float | None
    relaxation: float
    until: float
    max_transitions: int
    order: int
    scale: tuple = ()
    transitions: int = 64
    times: tuple = ()

    @property
    def largest(self):
        """The largest step of an adaptive method."""
        return 0.1 * self.until

    @property
    def least(self):
        return max(self.tolerance or 0.0, 2.0**-26.5) * self.largest


class Run(NamedTuple):
    """What a run gives.

    Of the first transitions ``times`` says when their guards were reached, ``resumed`` when flow went on, ``edges`` the
    numbers of their edges (-1 after the last), ``before`` and ``after`` the states, ``entries`` which fired on entry.
    ``count`` is how many there were. ``stop`` is a number of `STOPS`; the run ended at ``t`` in ``mode`` at ``x``,
    where the outputs are ``outputs``. ``sampled`` has the states at the given times, in ``sampled_mode``. ``rounds``
    counts passes of the loop.
    """

    times: Any
    resumed: Any
    edges: Any
    before: Any
    after: Any
    entries: Any
    sampled: Any
    sampled_mode: Any
    count: Any
    stop: Any
    t: Any
    mode: Any
    x: Any
    outputs: Any
    rounds: Any


def look(model, config, p, lane, record):
    """Do what steps have led to: transitions, ends, entries."""
    crossed, before = relaxed_crossing if config.scheme == "relaxed" else located_crossing, lane
    lane, crossing = crossed(model, config, p, at_the_end(model, p, lane))
    event = decided(model, config, p, lane, crossing)
    if len(config.times):
        ends, until = crossing.mask | crossing.leaves, jnp.where(crossing.leaves, crossing.left, event.t)
        made = followed(model, p, before, crossing.trial, frozen(before.trial), ends)
        record = along_step(config, before, record, made, ends, until)
    lane = ended(lane, event)
    if model.holds and config.scheme == "located":
        lane, event = let_go(model, config, p, lane, event)
    lane = boundary(model, config, p, lane, crossing.here, event.held)
    lane, record = transit(model, config, p, lane, record, event)
    lane, flows = enter(model, config, p, lane)
    return held_on(model, config, p, lane, record, flows)


def one_round(model, config, p, state):
    """Look at what the steps before have led to, and try some more."""

    def same_types(new, old):
        return jax.tree.map(lambda a, b: jnp.asarray(a).astype(b.dtype), new, old)

    def looked(state):
        return same_types(look(model, config, p, *state), state)

    def tried(state, _):
        return same_types(advance(model, config, p, *state), state), None

    state = lax.cond(state[0].phase == STEP, lambda s: s, looked, state)
    lane, record = lax.scan(tried, state, None, ROUND)[0]
    return lane._replace(steps=lane.steps + (lane.stop == RUNNING)), record


def run(model, config, p, mode, x0, rounds=None):
    """Run from a state; with a bound on the rounds the loop has a fixed length, as reverse mode needs it."""
    state = start(model, config, mode, x0)
    if rounds is None:
        state = lax.while_loop(
            lambda s: (s[0].stop == RUNNING) & (s[0].steps < MOST_STEPS),
            lambda s: one_round(model, config, p, s),
            state,
        )
    else:
        again = jax.checkpoint(lambda s, _: (one_round(model, config, p, s), None))
        state = lax.scan(again, state, None, rounds)[0]
    lane, record = state
    stop = jnp.where(lane.stop == RUNNING, STEPS, lane.stop)
    bound = Bound(model, p, model.segment(frozen(p), frozen(lane.t)))  # at an end in a strip inputs may have jumped
    mode = model.of(model.owner, lane.mode).astype(jnp.int32)
    shown = jnp.where(stop == FINAL, jnp.asarray(model.keeper, jnp.int32)[lane.edge], mode)
    shown = jnp.where(lane.count > 0, shown, mode)
    outputs = bound.routines.outputs(shown, bound.p, lane.t, lane.x)
    return Run(*record, lane.count, stop, lane.t, mode, lane.x, outputs, lane.steps)


@dataclass(frozen=True)
class Experiment:
    """A model with the settings it was exported with."""

    model: Model
    config: Config
    names: tuple
    fixed: Mapping
    values: Any
    start: Any
    start_mode: int

    def parameters(self, given: Mapping | None = None):
        """Values of all parameters, P numbers, some of them given by name; those that depend on them follow."""
        given = dict(given or {})
        for name in given:
            if name not in self.names:
                raise KeyError(f"no parameter {name!r}: expected one of {', '.join(self.names)}")
            if name in self.fixed:
                raise ValueError(f"parameter {name!r} is fixed in this module: {self.fixed[name]}")
        return self.values({self.names.index(name): jnp.asarray(value, float) for name, value in given.items()})

    def initial(self, p=None, given: Mapping | None = None):
        """The initial state, W numbers, for parameters, some of its states given by name."""
        x = self.start(self.parameters() if p is None else p)
        own = self.model.modes[self.start_mode].states
        for name, value in dict(given or {}).items():
            if name not in self.model.states or self.model.states.index(name) not in own:
                raise KeyError(f"no state {name!r} of mode {self.model.modes[self.start_mode].name!r}")
            x = x.at[own.index(self.model.states.index(name))].set(value)
        return x

    def simulate(self, p=None, x0=None, *, scheme=None, step=None, tolerance=None, relaxation=None,
                 transitions=None, times=None, rounds=None):  # fmt: skip
        """Run the experiment from parameters and an initial state; a `Run`.

        ``transitions`` is how many of them are kept, ``times`` where states are sampled (constants). ``step`` and
        ``tolerance`` exclude each other. ``rounds`` bounds the length of the loop for derivatives in reverse mode;
        ``rounds`` of a run says how many it takes. All others are settings, and constants of a compiled function.
        """
        p = self.parameters() if p is None else jnp.asarray(p, float)
        x0 = self.initial(p) if x0 is None else jnp.asarray(x0, float)
        if self.fixed:
            kept = np.array([name in self.fixed for name in self.names])
            p = jnp.where(kept, self.parameters(), p)
        config = self.settings(scheme, step, tolerance, relaxation, transitions, times)
        return run(self.model, config, p, jnp.int32(self.start_mode), x0, rounds)

    def settings(self, scheme, step, tolerance, relaxation, transitions, times):
        """The settings of a run."""
        config = self.config
        if step is not None and tolerance is not None:
            raise ValueError("expected one of step and tolerance, got both")
        if tolerance is not None and not self.model.method.error:
            raise ValueError(f"{self.model.method.name} has no error estimate: expected a step, got a tolerance")
        if scheme not in (None, "relaxed", "located"):
            raise ValueError(f"expected the scheme relaxed or located, got {scheme!r}")
        if step is not None:
            config = replace(config, step=float(step), tolerance=None)
        if tolerance is not None:
            config = replace(config, step=config.largest / 100, tolerance=float(tolerance))
        return replace(
            config,
            scheme=scheme or config.scheme,
            relaxation=config.relaxation if relaxation is None else float(relaxation),
            transitions=config.transitions if transitions is None else int(transitions),
            times=() if times is None else tuple(map(float, np.asarray(times))),
        )

    def show(self):
        """Run the experiment and print its transitions."""
        kept = 1024
        found = jax.jit(lambda: self.simulate(transitions=kept))()
        for i in range(min(int(found.count), kept)):
            edge = self.model.edges[int(found.edges[i])]
            source, target = self.model.modes[edge.source].name, self.model.modes[edge.target].name
            print(f"{i} {float(found.times[i])!r} {edge.name} {source} -> {target}")
        mode = self.model.modes[int(found.mode)]
        states = " ".join(f"{self.model.states[s]}={float(v)!r}" for s, v in zip(mode.states, found.x, strict=False))
        print(f"{STOPS[int(found.stop)]} at t = {float(found.t)!r} in {mode.name}: {states}")
