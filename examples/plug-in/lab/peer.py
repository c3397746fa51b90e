"""A peer: SciPy's LSODA, restarted after each event."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hsdsl.interface.chart.scene import Refused, Result, Scene
from hsdsl.interface.chart.translation import ToolArc, as_function, by_arcs, translate


def prepare(scene: Scene) -> Callable[[float], Result]:
    """Translate a scene once; return a function that runs it with a tolerance."""
    model = translate(scene)

    def of_vector(function: Callable[..., Any], first: bool = False) -> Any:
        return lambda t, x: function(t, *x)[0] if first else function(t, *x)

    flows = [of_vector(as_function(mode, mode.flow)) for mode in model.modes]
    events = [[of_vector(as_function(mode, (edge.guard,)), True) for edge in mode.edges] for mode in model.modes]
    for event in (event for found in events for event in found):
        event.terminal, event.direction = True, 1.0

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Any, until: float) -> ToolArc:
        """Follow mode k from (t, x) until an event or ``until``, with samples at ``times``."""
        at = np.append(times[times < until], until)
        run: Any = solve_ivp(
            flows[k], (t, until), x, method="LSODA", t_eval=at, rtol=tolerance, atol=tolerance, events=events[k]
        )
        if run.status < 0:
            raise Refused(run.message)
        if run.status == 0:
            return ToolArc(until, run.y[:, -1], None, run.y.T[: len(times)])
        fired = next(i for i, found in enumerate(run.t_events) if len(found))
        samples = run.y.T if len(run.t) else np.empty((0, len(x)))
        return ToolArc(run.t_events[fired][-1], run.y_events[fired][-1], fired, samples)

    return by_arcs(scene, model, integrate)
