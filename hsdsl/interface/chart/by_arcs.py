"""The loop around a tool that integrates one mode and stops at its events: reset, change the mode, go on."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.interface.chart.result import Array, Result
from hsdsl.interface.chart.scene import Scene
from hsdsl.interface.chart.translation import PlainMode, PlainModel, as_function

MOST_SECONDS = 60.0


class ToolArc(NamedTuple):
    """An arc by a tool: its end, the event that ended it (None: the end of the run), and values at the samples."""

    end: float
    x: Sequence[float]
    edge: int | None
    values: Array


Integrate = Callable[[float, int, float, Sequence[float], Array, float], ToolArc]
"""``integrate(tolerance, mode, t, x, times, until)``: from t to the first event or ``until``, sampled at ``times``."""


def by_arcs(scene: Scene, model: PlainModel, integrate: Integrate) -> Callable[[float], Result]:
    """Make ``run(tolerance)``: one arc after the other, until the scene's end or a final mode."""
    choices = [[_alternatives(mode, edge.guard) for edge in mode.edges] for mode in model.modes]
    resets = [[as_function(mode, edge.reset) for edge in mode.edges] for mode in model.modes]
    places = [
        [(i, mode.states.index(name)) for i, name in enumerate(scene.states) if name in mode.states]
        for mode in model.modes
    ]
    flows = [as_function(mode, mode.flow) for mode in model.modes]
    grid, until = scene.grid, float(scene.grid[-1])
    tie = TIE * max(abs(float(grid[0])), abs(until))
    most = 10 * len(scene.exact.transitions) + 100

    def run(tolerance: float) -> Result:
        values = np.full((len(grid), len(scene.states)), np.nan)
        passed: list[tuple[int, int]] = []  # where each arc's samples end, and its mode
        t, x, k, first, count = float(grid[0]), model.x, model.start, 0, 0
        began = time.perf_counter()
        problem, passed_by = None, 0
        while True:
            mode, begin = model.modes[k], t
            arc = integrate(tolerance, k, t, x, grid[first:], until)
            last = first + len(arc.values)
            for i, j in places[k]:
                values[first:last, i] = arc.values[:, j]
            passed.append((last, k))
            first, t = last, arc.end
            if arc.edge is None:
                break
            taken = _taken(choices[k][arc.edge], t, arc.x)
            if taken is None:
                passed_by = passed_by + 1 if t <= begin else 0
                if passed_by > len(mode.edges):
                    problem = f"stays at t = {t:.6g}, at a guard whose conditions do not hold"
                    break
                t, x = _past(flows[k], t, arc.x, min(tie, until - t))
                if t >= until:
                    break
                continue
            count += 1
            x = resets[k][taken](t, *arc.x)
            k = mode.edges[taken].target
            if model.modes[k].final or t >= until:
                break
            if count > most or time.perf_counter() - began > MOST_SECONDS:
                problem = f"gave up at t = {t:.6g} after {count} transitions"
                break
        return Result(values, lambda: _modes(passed, model, len(grid)), lambda: count, problem)

    return run


Choice = tuple[int, Callable[..., tuple[bool]]]


def _alternatives(mode: PlainMode, guard: object) -> list[Choice]:
    """The edges with the same guard, in the order of the file, and their conditions."""
    edges = [i for i, edge in enumerate(mode.edges) if edge.guard == guard]
    return [(i, as_function(mode, (mode.edges[i].condition,))) for i in edges]


def _taken(choices: Sequence[Choice], t: float, x: Sequence[float]) -> int | None:
    """The edge that is taken where their guard is reached; None where no condition holds."""
    return next((i for i, holds in choices if holds(t, *x)[0]), None)


def _past(
    flow: Callable[..., tuple[float, ...]], t: float, x: Sequence[float], tie: float
) -> tuple[float, list[float]]:
    """A point right behind a surface that is passed, where the tool does not find it again."""
    return t + tie, [float(value) + tie * rate for value, rate in zip(x, flow(t, *x), strict=True)]


def _modes(passed: Sequence[tuple[int, int]], model: PlainModel, samples: int) -> Array:
    modes, first = np.full(samples, "", dtype=object), 0
    for last, k in passed:
        modes[first:last] = model.modes[k].name
        first = last
    return modes
