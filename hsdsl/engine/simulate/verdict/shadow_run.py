"""The shadow run of a run on its way, in Python: its mode, time and state, and how far it is from the run.

Along a step its series differ from the run's by less and less from term to term. Only so many terms are made that all
steps of the run together leave out little of the difference; of the others it has the run's own. Where the run has no
series, its steps are corrected.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from hsdsl.engine.execution import Arc, Execution, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.integrators.taylor import terms
from hsdsl.engine.simulate.moving import flow_roundoff, moved_reset, surface_roundoff
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.transitions import Tails
from hsdsl.engine.simulate.verdict.correction import Array, corrected

MOST_CHANGES = 8  # of Newton's method
CLOSED_IN = 2.0**-10  # of the tie tolerance: a crossing's time is found
ROUNDED = 2.0**-52  # of a state that moves, in each step
FEWEST, MORE_TERMS = 3, 2  # the order of the first series, and by how much it grows where that is not enough


class Lost(ValueError):
    """The shadow run cannot follow."""


class ShadowRun:
    """The shadow run on its way: its time and state; ``order`` is the most that its series have, None for no series."""

    def __init__(self, problem: Problem, run: Execution, order: int | None) -> None:
        self.problem, self.run, self.most = problem, run, order
        self.order = min(FEWEST, order or 0)
        self.modes = {mode.name: k for k, mode in enumerate(problem.program.modes)}
        self.state_errors = np.zeros((len(run.times), run.values.shape[1]))
        self.times: list[float] = run.times.tolist()
        self.time_errors: list[float] = []
        self.t: float = float(run.times[0])
        self.x: State = problem.start.x
        self.data, self.moved = problem.timeline.segments[0].data, problem.start.data
        self.tails = Tails(problem.waits)

    def follow(self, arc: Arc, made: Transition | None) -> None:
        """Follow one arc, and the transition that ends it."""
        times, mode = self.times, self.modes[arc.mode]
        shift = self.t - times[arc.first]
        for row in range(arc.first, arc.last + 1):
            h = times[row] - times[row - 1] if row > arc.first else 0.0
            if h > 0:
                self.x, self.t = self._end(mode, row - 1, h, row == arc.first + 1), times[row] + shift
            self._compare(row, self.run.values[row], self.x)
        if made:
            self._jump(arc, made)

    def _end(self, mode: int, row: int, h: float, begins: bool) -> State:
        """Where the run's step from a row takes it; where an arc begins, its states are rounded."""
        x, end = np.asarray(self.run.values[row : row + 2, : len(self.x)], dtype=float)
        piece = np.asarray(self.run.coefficients[row][:, : len(self.x)], dtype=float)
        kernel, t1 = self.problem.kernel, self.times[row + 1]
        slope = np.array(kernel.bind(mode, self.data).flow(t1, *end.tolist()))
        off = flow_roundoff(kernel, mode, self.data, t1, tuple(end.tolist()))
        if off is None:
            raise Lost
        noise = np.array(off)
        moves = slope != 0
        noise += np.where(moves, ROUNDED * np.abs(end) / h, 0.0)
        if begins:
            away = np.array(self.x) - x
            self.x = tuple((x + away + np.copysign(np.where(moves, ROUNDED * np.abs(x), 0.0), away)).tolist())
        if self.most is None:
            away = np.array(self.x) - x
            inside, further = self._corrected(mode, x, piece, h, end, np.copysign(h * noise, away))
            self._compare(row + 1, x, tuple((x + away + inside).tolist()))
            return tuple((end + (away + further)).tolist())
        away = self._away(mode, x, piece, h).sum(axis=0)
        away += self._left_out(mode, t1, end, piece, h, slope)
        return tuple((end + away + np.copysign(h * noise, away)).tolist())

    def _corrected(self, mode: int, x: Array, piece: Array, h: float, end: Array, moved: Array) -> tuple[Array, Array]:
        """How much further away a step takes it, inside and at the end; what is moved goes on as the flow does."""
        flow, jacobian = self.problem.kernel.bind(mode, self.moved).flow, self.problem.kernel.jacobian(mode, self.moved)
        slopes = np.array(jacobian(self.t + h, *end.tolist()), dtype=float).reshape(len(end), len(end))

        def defect(s: float, away: Array, rate: Array) -> Array:
            powers = np.arange(1, len(piece) + 1)
            at = x + s**powers @ piece + away
            slope = powers * s ** (powers - 1) @ piece + rate
            return h * np.array(flow(self.t + s * h, *at.tolist())) - slope + moved

        return corrected(defect, np.array(self.x) - x, h * slopes)

    def _away(self, mode: int, x: Array, piece: Array, h: float) -> Array:
        """How far its terms are from the run's, so many that all steps together leave out little of it."""
        while True:
            stages = self._expanded(mode)
            powers = np.cumprod(np.full(len(stages), h))  # as the run in C does
            away = np.vstack([np.array(self.x) - x, stages * powers[:, None] - piece[: len(stages)]])
            sizes = np.abs(away)
            settled = np.all(len(self.times) * sizes[-2:].sum(axis=0) <= sizes.sum(axis=0))
            if settled or self.most is None or self.order == self.most:
                return away
            self.order = min(self.order + MORE_TERMS, self.most)

    def _expanded(self, mode: int) -> Array:
        series = self.problem.kernel.taylor(mode, self.moved)
        if series is None:
            raise Lost
        return np.array(terms(series, self.order, self.t, self.x), dtype=float).reshape(self.order + 1, len(self.x))

    def _left_out(self, mode: int, t: float, x: Array, piece: Array, h: float, slope: Array) -> Array:
        """What the run's polynomial X leaves out by the end of its step, where the flow is ``slope``.

        With d = X' - f(X) at the end and J the derivatives of f, e' = J e - d for what is left out, e: it is close to
        -h d/order, and what follows from J e is close to h (J e)/(order + 1).
        """
        order = len(piece) + 1
        e = (h * slope - np.arange(1, order) @ piece) / order
        flow = self.problem.kernel.bind(mode, self.data).flow(t, *(x + e).tolist())
        return e + h * (np.array(flow) - slope) / (order + 1)

    def _compare(self, row: int, x: Any, y: State) -> None:
        if not all(map(isfinite, y)):
            raise Lost
        away = np.abs(np.asarray(x[: len(y)], dtype=float) - y)
        self.state_errors[row, : len(y)] = np.fmax(self.state_errors[row, : len(y)], away)

    def _jump(self, arc: Arc, made: Transition) -> None:
        """Make a transition where it crosses the surface but for its round-off, on a straight line from where it is."""
        mode, y = self.problem.program.modes[self.modes[arc.mode]], self.x
        index = self.modes[arc.mode]
        kernel = self.problem.kernel.bind(index, self.moved)
        found = [k for k, edge in enumerate(mode.edges) if edge.name == made.edge]
        k = min(found, key=lambda k: abs(kernel.surfaces(made.time, *made.before.values())[k]))
        tie, change, s = float(self.problem.tie(max(self.t, self.times[-1]))), np.inf, 0.0
        slope, beyond = kernel.flow(self.t, *y), surface_roundoff(self.problem.kernel, index, k, self.moved, self.t, y)
        for _ in range(MOST_CHANGES):
            value, rate = kernel.surfaces(self.t + s, *y)[k], kernel.rates[k](self.t + s, *y)[0]
            if not rate > 0:
                raise Lost
            change = (value + beyond) / rate
            s -= change
            y = tuple(a + s * b for a, b in zip(self.x, slope, strict=True))
            if abs(change) <= CLOSED_IN * tie:
                break
        if not abs(change) <= tie:
            raise Lost
        self._compare(arc.last, list(made.before.values()), y)
        self.t += s
        self.time_errors.append(abs(float(made.time) - self.t))
        after = moved_reset(self.problem.kernel, index, k, self.moved, self.t, y) or ()
        if not after and mode.edges[k].target_states:
            raise Lost
        self.x = self.tails.advance(mode, y, self.problem.program.modes[mode.edges[k].target], after)
