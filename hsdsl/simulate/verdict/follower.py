"""The companion of a run on its way, in Python: its mode, time and state, moved by what round-off may do."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np

from hsdsl.enclosures import Range, as_range
from hsdsl.execution import Arc, Execution, Transition
from hsdsl.integrators.stepper import State
from hsdsl.integrators.taylor import terms
from hsdsl.kernel import ModeKernel
from hsdsl.simulate.problem import Problem

MOST_ROUNDS = 8  # of Newton's method
CLOSED_IN = 2.0**-10  # of the tie tolerance: a crossing's time is found


class Lost(ValueError):
    """The companion cannot follow."""


class Follower:
    """The companion on its way: its mode, time and state, and the series from there."""

    def __init__(self, problem: Problem, run: Execution, order: int) -> None:
        self.problem, self.run, self.order = problem, run, order
        self.modes = {mode.name: k for k, mode in enumerate(problem.program.modes)}
        self.apart = np.zeros((len(run.times), run.values.shape[1]))
        self.times: list[float] = run.times.tolist()
        self.late: list[float] = []
        self.t: float = float(run.times[0])
        self.x: State = tuple(run.values[0, : len(run.arcs[0].states)].tolist())
        self.stages: Sequence[State] = ()
        self.enclosing: dict[int, ModeKernel] = {}

    def follow(self, arc: Arc, made: Transition | None) -> None:
        """Follow one arc, and the transition that ends it."""
        times = self.times
        shift = self.t - times[arc.first]
        for row in range(arc.first, arc.last + 1):
            h = times[row] - times[row - 1] if row > arc.first else 0.0
            if h > 0:
                self._round(arc, self.run.values[row - 1].tolist(), h)
            if h > 0 or (made and row == arc.last):
                self._expand(arc)
            y = self._at(h) if h > 0 else self.x
            self._compare(row, self.run.values[row], y)
            if made and row == arc.last:
                self._jump(arc, made, h, y)
            elif h > 0:
                self.x, self.t = y, times[row] + shift

    def _round(self, arc: Arc, x: State, h: float) -> None:
        """Move away from the run, which is at x, by what round-off of the flow may do in a step."""
        box = [Range(float(value), float(value)) for value in (self.t, *self.x)]
        flow = map(as_range, self._enclosing(self.modes[arc.mode]).flow(*box))
        moved = [h * float(f.high - f.low) / 2 for f in flow]
        if not all(map(isfinite, moved)):
            raise Lost
        self.x = tuple(a - e if a < b else a + e for a, b, e in zip(self.x, x, moved, strict=False))

    def _enclosing(self, mode: int) -> ModeKernel:
        if mode not in self.enclosing:
            data = [Range(float(value), float(value)) for value in self.problem.timeline.segments[0].data]
            self.enclosing[mode] = self.problem.kernel.enclosing.bind(mode, data)
        return self.enclosing[mode]

    def _compare(self, row: int, x: Any, y: State) -> None:
        if not all(map(isfinite, y)):
            raise Lost
        away = np.abs(np.asarray(x[: len(y)], dtype=float) - y)
        self.apart[row, : len(y)] = np.fmax(self.apart[row, : len(y)], away)

    def _expand(self, arc: Arc) -> None:
        series = self.problem.kernel.taylor(self.modes[arc.mode], self.problem.timeline.segments[0].data)
        if series is None:
            raise Lost
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
                raise Lost
            change = value / rate
            s -= change
            y = self._at(s)
            if abs(change) <= CLOSED_IN * tie:
                break
        if not abs(change) <= tie:
            raise Lost
        self._compare(arc.last, list(made.before.values()), y)
        self.t += s
        self.late.append(abs(float(made.time) - self.t))
        self.x = kernel.resets[k](self.t, *y)
