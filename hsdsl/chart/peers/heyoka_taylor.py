# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""heyoka: an adaptive Taylor integrator a mode with terminal events; a reset to the same mode is its callback.

Where an arc ends is found first, since a grid that goes on beyond it takes longer than to integrate twice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import heyoka as hy
import numpy as np

from hsdsl.chart.by_arcs import ToolArc, by_arcs
from hsdsl.chart.result import Array, Refused, Result
from hsdsl.chart.scene import Scene
from hsdsl.chart.translation import PlainEdge, PlainMode, PlainModel, T, as_function, translate

NOTHING = np.empty((0, 0))


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.chart.peers`."""
    model = translate(scene)
    kept: dict[tuple[int, float], Any] = {}
    counted = [0]
    stops = [any(_stops(edge, k) for edge in mode.edges) for k, mode in enumerate(model.modes)]

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        if (k, tolerance) not in kept:
            kept[k, tolerance] = _integrator(model, k, tolerance, counted)
        ta, end = kept[k, tolerance], None
        if stops[k]:
            end = _reached(_begun(ta, t, x).propagate_until(until)[0], ta)
            times = times[: int(np.searchsorted(times, end.end, side="right"))]
        ahead = times if len(times) and times[0] == t else np.concatenate(([t], times))
        outcome, *_, values = _begun(ta, t, x).propagate_grid(ahead)
        return (end or _reached(outcome, ta))._replace(values=values[len(ahead) - len(times) :])

    run = by_arcs(scene, model, integrate)

    def counting(tolerance: float) -> Result:
        counted[0] = 0
        result = run(tolerance)
        inside = counted[0]
        return replace(result, count=lambda: (result.transitions or 0) + inside)

    return counting


def _begun(ta: Any, t: float, x: Sequence[float]) -> Any:
    """Put an integrator to a point."""
    ta.time = t
    ta.state[:] = x
    if ta.with_events:
        ta.reset_cooldowns()
    return ta


def _reached(outcome: Any, ta: Any) -> ToolArc:
    """Where an integrator has stopped; without samples."""
    if outcome == hy.taylor_outcome.err_nf_state:
        raise Refused("the state is not finite")
    edge = None if outcome == hy.taylor_outcome.time_limit else -int(outcome) - 1
    return ToolArc(float(ta.time), ta.state.copy(), edge, NOTHING)


def _stops(edge: PlainEdge, k: int) -> bool:
    """Whether the integrator stops at an edge of mode k; any other is a reset in its own loop."""
    return edge.target != k or edge.conditional


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
    if _stops(edge, k):
        return hy.t_event(guard, direction=rising)
    reset = as_function(mode, edge.reset)

    def callback(ta: Any, _: int) -> bool:
        ta.state[:] = reset(ta.time, *ta.state)
        counted[0] += 1
        return True

    return hy.t_event(guard, direction=rising, callback=callback)
