# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""SciPy: ``solve_ivp`` with terminal events that rise through zero, restarted after each; DOP853."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hsdsl.interface.chart.scene import Array, Refused, Result, Scene
from hsdsl.interface.chart.translation import ToolArc, as_function, by_arcs, translate


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.interface.chart.peers`."""
    model = translate(scene)
    flows = [as_function(mode, mode.flow) for mode in model.modes]
    events = [[_event(as_function(mode, (edge.guard,))) for edge in mode.edges] for mode in model.modes]

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        at = np.append(times, until) if not len(times) or times[-1] < until else times
        how = {"t_eval": at, "events": events[k], "rtol": tolerance, "atol": tolerance}
        solution: Any = solve_ivp(lambda t, x: flows[k](t, *x), (t, until), x, method="DOP853", **how)
        if solution.status < 0:
            raise Refused(solution.message)
        if solution.status == 0:
            return ToolArc(until, solution.y[:, -1], None, solution.y.T[: len(times)])
        fired = next(i for i, found in enumerate(solution.t_events) if len(found))
        end, z = solution.t_events[fired][-1], solution.y_events[fired][-1]
        return ToolArc(end, z, fired, solution.y.T if len(solution.t) else np.empty((0, len(x))))

    return by_arcs(scene, model, integrate)


def _event(function: Callable[..., Any]) -> Callable[..., Any]:
    def event(t: float, x: Sequence[float]) -> float:
        return function(t, *x)[0]

    event.terminal, event.direction = True, 1.0
    return event
