# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""heyoka: an adaptive Taylor integrator a mode with terminal events; a reset to the same mode is its callback.

Where an arc ends is found first, since a grid that goes on beyond it takes longer than to integrate twice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import heyoka as hy
import numpy as np

from hsdsl.interface.chart.scene import Array, NotFinite, Result, Scene
from hsdsl.interface.chart.translation import PlainEdge, PlainMode, ToolArc, as_function, by_arcs, translate

NOTHING = np.empty((0, 0))


def _of_constants_too(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda argument: function(hy.expression(argument))


_NAMES = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh")
FUNCTIONS = {
    **{name: _of_constants_too(getattr(hy, name)) for name in (*_NAMES, "exp", "log", "sqrt")},
    "atan2": lambda y, x: hy.atan2(hy.expression(y), hy.expression(x)),
    "pow": lambda base, exponent: hy.expression(base) ** hy.expression(exponent),
}
"""Its own functions, but for those with kinks and jumps: a Taylor series has neither."""


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.interface.chart.peers`."""
    model = translate(scene)
    kept: dict[tuple[int, float], Any] = {}
    counted = [0]
    stops = [any(_stops(edge, k) for edge in mode.edges) for k, mode in enumerate(model.modes)]
    systems = [_system(mode) for mode in model.modes]

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        if (k, tolerance) not in kept:
            system = systems[k]
            flow = list(zip(system.variables, system.flow, strict=True))
            events = [_event(model.modes[k], i, k, guard, counted) for i, guard in enumerate(system.guards)]
            kept[k, tolerance] = hy.taylor_adaptive(flow, [0.0] * len(flow), tol=tolerance, t_events=events)
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
        raise NotFinite("the state is not finite")
    edge = None if outcome == hy.taylor_outcome.time_limit else -int(outcome) - 1
    return ToolArc(float(ta.time), ta.state.copy(), edge, NOTHING)


def _stops(edge: PlainEdge, k: int) -> bool:
    """Whether the integrator stops at an edge of mode k; any other is a reset in its own loop."""
    return edge.target != k or edge.conditional


class System(NamedTuple):
    """A mode in its expressions: variables, their derivatives, and guards."""

    variables: Sequence[Any]
    flow: Sequence[Any]
    guards: Sequence[Any]


def _system(mode: PlainMode) -> System:
    variables = [hy.expression(s.name) for s in mode.symbols]

    def expressions(of: tuple[Any, ...]) -> list[Any]:
        return [hy.expression(value) for value in as_function(mode, of, FUNCTIONS)(hy.time, *variables)]

    return System(variables, expressions(mode.flow), expressions(tuple(edge.guard for edge in mode.edges)))


def _event(mode: PlainMode, i: int, k: int, guard: Any, counted: list[int]) -> Any:
    edge = mode.edges[i]
    rising = hy.event_direction.positive
    if _stops(edge, k):
        return hy.t_event(guard, direction=rising)
    reset = as_function(mode, edge.reset)

    def callback(ta: Any, _: int) -> bool:
        ta.state[:] = reset(ta.time, *ta.state)
        counted[0] += 1
        return True

    return hy.t_event(guard, direction=rising, callback=callback)
