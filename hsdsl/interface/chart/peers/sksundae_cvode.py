# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""scikit-SUNDAE: CVODE with events that rise through zero, restarted after each (BDF, its default)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import sksundae as sun

from hsdsl.interface.chart.scene import Array, Refused, Result, Scene
from hsdsl.interface.chart.translation import PlainModel, ToolArc, as_function, by_arcs, translate

LEAST = 1e-14
EVENT = 2


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.interface.chart.peers`."""
    model = translate(scene)
    kept: dict[tuple[int, float], Any] = {}

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        if (k, tolerance) not in kept:
            kept[k, tolerance] = _solver(model, k, tolerance)
        instants = np.concatenate(([t], times[times > t]))
        if instants[-1] < until:
            instants = np.append(instants, until)
        if len(instants) < 2:
            return ToolArc(until, x, None, np.empty((0, len(x))))
        solution = kept[k, tolerance].solve(instants, np.array(x, dtype=float))
        if not solution.success:
            raise Refused(solution.message)
        skipped = 1 if not len(times) or times[0] > t else 0
        if solution.status != EVENT:  # `t_events` may still be those of the arc before
            return ToolArc(until, solution.y[-1], None, solution.y[skipped:][: len(times)])
        end = float(np.ravel(solution.t_events)[-1])
        fired = int(np.flatnonzero(np.atleast_2d(solution.i_events)[-1])[0])
        before = int(np.count_nonzero(times < end))
        return ToolArc(end, np.atleast_2d(solution.y_events)[-1], fired, solution.y[skipped : skipped + before])

    return by_arcs(scene, model, integrate)


def _solver(model: PlainModel, k: int, tolerance: float) -> Any:
    mode = model.modes[k]
    flow = as_function(mode, mode.flow)
    guards = as_function(mode, tuple(edge.guard for edge in mode.edges))

    def rhsfn(t: float, y: Array, yp: Array) -> None:
        yp[:] = flow(t, *y)

    def eventsfn(t: float, y: Array, events: Array) -> None:
        events[:] = guards(t, *y)

    count = len(mode.edges)
    eventsfn.terminal, eventsfn.direction = [True] * count, [1] * count
    events = {"eventsfn": eventsfn, "num_events": count} if count else {}
    limits = {"rtol": tolerance, "atol": max(tolerance, LEAST), "max_num_steps": 1_000_000}
    return sun.cvode.CVODE(rhsfn, **limits, **events)
