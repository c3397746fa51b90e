# The peers are optional and untyped.
# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""heyoka: an adaptive Taylor integrator a mode with terminal events; a reset to the same mode is its callback."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import heyoka as hy
import numpy as np
import sympy as sp

from hsdsl.chart.by_arcs import ToolArc, by_arcs
from hsdsl.chart.result import Array, Refused, Result
from hsdsl.chart.scene import Scene
from hsdsl.chart.translation import PlainMode, PlainModel, T, as_function, translate


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.chart.peers`."""
    model = translate(scene)
    kept: dict[tuple[int, float], Any] = {}
    counted = [0]

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        if (k, tolerance) not in kept:
            kept[k, tolerance] = _integrator(model, k, tolerance, counted)
        ta = kept[k, tolerance]
        ta.time = t
        ta.state[:] = x
        if ta.with_events:
            ta.reset_cooldowns()
        ahead = np.concatenate(([t], times[times > t]))
        outcome, *_, values = ta.propagate_grid(ahead)
        number = int(outcome)
        if outcome == hy.taylor_outcome.err_nf_state:
            raise Refused("the state is not finite")
        skipped = 1 if not len(times) or times[0] > t else 0
        edge = None if outcome == hy.taylor_outcome.time_limit else -number - 1
        rows = values[skipped : skipped + int(np.count_nonzero(times <= ta.time))]
        return ToolArc(float(ta.time), ta.state.copy(), edge, rows[np.isfinite(rows).all(axis=1)])

    run = by_arcs(scene, model, integrate)

    def counting(tolerance: float) -> Result:
        counted[0] = 0
        result = run(tolerance)
        inside = counted[0]
        return replace(result, count=lambda: (result.transitions or 0) + inside)

    return counting


def _integrator(model: PlainModel, k: int, tolerance: float, counted: list[int]) -> Any:
    mode = model.modes[k]
    variables = hy.make_vars(*(s.name for s in mode.symbols)) if len(mode.symbols) > 1 else [hy.make_vars("x0")]
    names = dict(zip(mode.symbols, variables, strict=True)) | {T: hy.time}
    system = list(zip(variables, (hy.from_sympy(f, names) for f in mode.flow), strict=True))
    events = [_event(mode, i, k, names, counted) for i in range(len(mode.edges))]
    return hy.taylor_adaptive(system, [0.0] * len(variables), tol=tolerance, t_events=events)


def _event(mode: PlainMode, i: int, k: int, names: Any, counted: list[int]) -> Any:
    edge = mode.edges[i]
    guard = hy.from_sympy(edge.guard, names)
    rising = hy.event_direction.positive
    if edge.target != k or edge.condition != sp.true:
        return hy.t_event(guard, direction=rising)
    reset = as_function(mode, edge.reset)

    def callback(ta: Any, _: int) -> bool:
        ta.state[:] = reset(ta.time, *ta.state)
        counted[0] += 1
        return True

    return hy.t_event(guard, direction=rising, callback=callback)
