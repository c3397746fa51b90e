"""Errors of a run by Taylor series without another run: a companion takes the same steps by series of more terms.

The companion starts where the run does. Each step begins where the companion itself is, and takes as long as the run's;
each transition is made where the companion crosses the same surface. So what it is away from the run is the sum of what
the run's series left out, carried along by the flow and by jumps, as long as it is small. The step size is chosen by
the last term and the first that is left out, so two more terms tell what was left out. Nothing is looked for: that no
other surface is reached is decided along the run's own steps, by enclosures that are wider than the errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.arithmetic import DOMAIN_ERRORS
from hsdsl.execution import Arc, Execution, Transition
from hsdsl.integrators.stepper import State
from hsdsl.integrators.taylor import terms
from hsdsl.simulate.problem import Problem
from hsdsl.simulate.verdict.agreement import Errors

Array = NDArray[np.float64]
MORE = 2  # terms
MOST_ORDER = 30  # of series in C: HS_MOST_ORDER
MOST_ROUNDS = 8  # of Newton's method
CLOSED_IN = 2.0**-10  # of the tie tolerance: a crossing's time is found


@dataclass(frozen=True)
class Companion:
    """How far a run is from its companion.

    Attributes
    ----------
    apart : array, shape (rows, states of the largest mode)
    late : array, shape (transitions + 1,)
        How far the times of transitions are apart, up to each; the last entry has no meaning.
    lost : float or None
        From when on it could not follow.
    """

    apart: Array
    late: Array
    lost: float | None = None


@dataclass(frozen=True)
class Accompanied(Errors):
    """What a companion shows of a run."""

    companion: Companion

    @cached_property
    def parted(self) -> float | None:
        """From when on the companion could not follow."""
        return self.companion.lost

    @cached_property
    def late(self) -> Array:
        """How far times of transitions are apart, up to each of them; shape (transitions,)."""
        return self.companion.late[:-1]

    @cached_property
    def measured(self) -> Array:
        """How far the run is from its companion in each state; shape (rows, states), nowhere falling."""
        found = np.zeros(self._values.shape)
        for arc in self.run.arcs:
            columns = [self.columns[name] for name in arc.states]
            found[arc.first : arc.last + 1, columns] = self.companion.apart[arc.first : arc.last + 1, : len(columns)]
        return np.maximum.accumulate(np.nan_to_num(found))


def is_compiled(run: Execution) -> bool:
    """Whether a run was made in C, where it is followed as well."""
    return run.__dict__.get("_of") is not None


def order_of(method: Any) -> int:
    """The order of the companion's series, which have one coefficient more."""
    return method.order + MORE - 1


def has_companion(problem: Problem, run: Execution) -> bool:
    """Whether a run's errors can be told by a companion: one by Taylor series, without strips and inputs' samples.

    Of a run made in C the rest is seen where it is followed.
    """
    settings = problem.settings
    return (
        settings.scheme == "located"
        and settings.tolerance is not None
        and settings.method is not None
        and settings.method.kind == "taylor"
        and order_of(settings.method) <= MOST_ORDER
        and problem.arithmetic.digits is None
        and len(problem.timeline.segments) == 1
        and run.stop.complete
        and (is_compiled(run) or not (run.enters_beyond or any(arc.kind != "flow" for arc in run.arcs)))
    )


class _Lost(ValueError):
    """The companion cannot follow."""


class _Follower:
    """The companion on its way: its mode, time and state, and the series from there."""

    def __init__(self, problem: Problem, run: Execution) -> None:
        assert problem.settings.method is not None
        self.problem, self.run, self.order = problem, run, order_of(problem.settings.method)
        self.modes = {mode.name: k for k, mode in enumerate(problem.program.modes)}
        self.apart = np.zeros((len(run.times), run.values.shape[1]))
        self.times: list[float] = run.times.tolist()
        self.late: list[float] = []
        self.t: float = float(run.times[0])
        self.x: State = tuple(run.values[0, : len(run.arcs[0].states)].tolist())
        self.stages: Sequence[State] = ()

    def arc(self, arc: Arc, made: Transition | None) -> None:
        """Follow one arc, and the transition that ends it."""
        times = self.times
        shift = self.t - times[arc.first]
        for row in range(arc.first, arc.last + 1):
            h = times[row] - times[row - 1] if row > arc.first else 0.0
            if h > 0 or (made and row == arc.last):
                self._expand(arc)
            y = self._at(h) if h > 0 else self.x
            self._enter(row, self.run.values[row], y)
            if made and row == arc.last:
                self._jump(arc, made, h, y)
            elif h > 0:
                self.x, self.t = y, times[row] + shift

    def _enter(self, row: int, x: Any, y: State) -> None:
        if not all(map(isfinite, y)):
            raise _Lost
        away = np.abs(np.asarray(x[: len(y)], dtype=float) - y)
        self.apart[row, : len(y)] = np.fmax(self.apart[row, : len(y)], away)

    def _expand(self, arc: Arc) -> None:
        series = self.problem.kernel.taylor(self.modes[arc.mode], self.problem.timeline.segments[0].data)
        if series is None:
            raise _Lost
        self.stages = terms(series, self.order, self.t, self.x)

    def _at(self, s: float) -> State:
        z = self.stages[-1] if self.x else ()
        for c in reversed((self.x, *self.stages[:-1])):
            z = tuple(a + s * b for a, b in zip(c, z, strict=True))
        return z

    def _jump(self, arc: Arc, made: Transition, s: float, y: State) -> None:
        """Make a transition where the companion crosses its surface, close to the time s of its series."""
        mode = self.problem.program.modes[self.modes[arc.mode]]
        kernel = self.problem.kernel.bind(self.modes[arc.mode], self.problem.timeline.segments[0].data)
        found = [k for k, edge in enumerate(mode.edges) if edge.name == made.edge]
        k = min(found, key=lambda k: abs(kernel.surfaces(made.time, *made.before.values())[k]))
        tie, change = float(self.problem.tie(self.t)), np.inf
        for _ in range(MOST_ROUNDS):
            value, rate = kernel.surfaces(self.t + s, *y)[k], kernel.rates[k](self.t + s, *y)[0]
            if not rate > 0:
                raise _Lost
            change = value / rate
            s -= change
            y = self._at(s)
            if abs(change) <= CLOSED_IN * tie:
                break
        if not abs(change) <= tie:
            raise _Lost
        self._enter(arc.last, list(made.before.values()), y)
        self.t += s
        self.late.append(abs(float(made.time) - self.t))
        self.x = kernel.resets[k](self.t, *y)


def accompany(problem: Problem, run: Execution) -> Companion:
    """Follow a run that has a companion."""
    on_its_way, arcs = _Follower(problem, run), run.arcs
    lost = None
    for arc, following in zip(arcs, (*arcs[1:], None), strict=True):
        if problem.program.modes[on_its_way.modes[arc.mode]].final:
            break
        leaves = arc.jump < len(run.transitions) and (following is None or following.jump > arc.jump)
        try:
            on_its_way.arc(arc, run.transitions[arc.jump] if leaves else None)
        except (_Lost, *DOMAIN_ERRORS):
            lost = float(run.times[arc.first])
            break
    late = np.maximum.accumulate([float(problem.tie(run.times[-1])), *on_its_way.late])[1:]
    missing = np.full(len(run.transitions) + 1 - len(late), np.inf)
    return Companion(on_its_way.apart, np.append(late, missing), lost)
