"""Executions by SciPy's DOP853 at 1e-13, each step's dense output sampled for crossings: nothing of hsdsl is used.

A scene is Python text for every flow, surface, condition and reset; it is evaluated by Python itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

SAMPLES = 200  # of each step
NAMES: dict[str, Any] = {
    name: getattr(math, name) for name in ("sin", "cos", "exp", "sqrt", "tanh", "log", "pi", "atan")
}


@dataclass(frozen=True)
class Edge:
    """``when`` is the surface function, positive beyond the guard."""

    name: str
    when: str
    to: str
    reset: dict[str, str] = field(default_factory=dict)
    condition: str = "True"


@dataclass(frozen=True)
class Mode:
    """Flow by state, edges, and walls as surface functions."""

    flow: dict[str, str]
    edges: tuple[Edge, ...] = ()
    walls: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """Edges with their times, and how the run ended."""

    edges: tuple[str, ...]
    times: tuple[float, ...]
    stop: str


def execute(
    modes: dict[str, Mode], initial: tuple[str, dict[str, float]], until: float, values: dict[str, Any],
    cuts: tuple[float, ...] = (), most: int = 500,
) -> Outcome:  # fmt: skip
    """Follow an execution; ``cuts`` are times that no step crosses."""
    mode, state = initial
    t, edges, times = 0.0, list[str](), list[float]()
    while len(edges) < most:
        found = _flow(modes[mode], mode, state, t, until, values, cuts)
        if found is None:
            return Outcome(tuple(edges), tuple(times), "until")
        t, state, edge = found
        if edge is None:
            return Outcome(tuple(edges), tuple(times), "left_domain")
        edges.append(edge.name)
        times.append(t)
        scope = {**NAMES, **values, **state, "t": t}
        after = {name: float(eval(text, scope)) for name, text in edge.reset.items()}
        mode, state = edge.to, {**state, **after}
    raise AssertionError("too many transitions")


def _function(text: str, names: tuple[str, ...], values: dict[str, Any]) -> Callable[..., float]:
    return eval(f"lambda t, {', '.join(names)}: {text}", {**NAMES, **values})


def _flow(
    mode: Mode, name: str, state: dict[str, float], t: float, until: float, values: dict[str, Any],
    cuts: tuple[float, ...],
) -> tuple[float, dict[str, float], Edge | None] | None:  # fmt: skip
    """The first crossing: its time, the state there, and the edge (None for a wall); None at the end."""
    names = tuple(state)
    rates = [_function(mode.flow[n], names, values) for n in names]
    surfaces = [_function(e.when, names, values) for e in mode.edges] + [
        _function(w, names, values) for w in mode.walls
    ]
    conditions = [_function(e.condition, names, values) for e in mode.edges]
    x = np.array(list(state.values()))
    for end in sorted({*(c for c in cuts if t < c < until), until}):
        begin = t
        solver = DOP853(
            lambda s, y, b=begin, e=end: [f(min(max(s, np.nextafter(b, e)), np.nextafter(e, b)), *y) for f in rates],
            t, x, end, rtol=1e-13, atol=1e-15, max_step=(until / 20),
        )  # fmt: skip
        inside = [g(t, *x) < 0 for g in surfaces]
        while solver.status == "running":
            solver.step()
            dense, low, high = solver.dense_output(), solver.t_old, solver.t
            hits: list[tuple[float, int]] = []
            grid = np.linspace(low, high, SAMPLES + 1)[1:]
            along = dense(grid).T.tolist()
            for k, g in enumerate(surfaces):
                before = low
                for s, y in zip(grid.tolist(), along, strict=True):
                    value = g(s, *y)
                    if inside[k] and value > 0:
                        root = brentq(lambda u, g=g, y=dense: g(u, *y(u)), before, s, xtol=1e-15, rtol=1e-15)
                        if k >= len(mode.edges) or conditions[k](root, *dense(root)):
                            hits.append((root, k))
                            break
                    inside[k] = inside[k] or value < 0
                    if value > 0:
                        inside[k] = False
                    before = s
            if hits:
                time, k = min(hits)
                q = dict(zip(names, map(float, dense(time)), strict=True))
                return time, q, mode.edges[k] if k < len(mode.edges) else None
        t, x = end, solver.y
    return None
