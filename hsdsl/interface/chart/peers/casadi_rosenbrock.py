# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""CasADi: its Rosenbrock integrator on the samples' grid, with zero-crossing functions and a transition function.

Events are experimental there; the mode is one more state, which only transitions change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from hsdsl.interface.chart.scene import Array, Refused, Result, Scene
from hsdsl.interface.chart.translation import PlainModel, as_function, translate

FUNCTIONS = {
    **{name: getattr(ca, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    **{name: getattr(ca, name) for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh", "atan2", "floor")},
    **{"abs": ca.fabs, "sign": ca.sign, "max": ca.fmax, "min": ca.fmin, "pow": ca.power},
    "below": lambda number, bound, one, other: ca.if_else(number < bound, one, other),
}


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.interface.chart.peers`."""
    model = translate(scene)
    if model.conditional:
        raise Refused("an `if` on a guard is not translated for its transition function")
    occupied = [mode for mode in model.modes if not mode.final]
    if len({mode.states for mode in occupied}) > 1 or len(occupied) < len(model.modes):
        raise Refused("its integrator has one set of states for all modes, and no final mode")
    dae, transition = _problem(model)
    grid, n = scene.grid, len(model.x)
    columns = [model.modes[0].states.index(name) for name in scene.states]
    start = np.array([*model.x, float(model.start)])
    most = 10 * len(scene.exact.transitions) + 100
    kept: dict[float, Any] = {}

    def run(tolerance: float) -> Result:
        if tolerance not in kept:
            options = {"transition": transition, "reltol": tolerance, "abstol": tolerance, "max_events": most}
            options |= {"control_group_size": [len(grid)], "max_num_steps": 1_000_000}
            kept[tolerance] = ca.integrator("run", "rosenbrock", dae, float(grid[0]), grid, options)
        result: Array = np.asarray(kept[tolerance](x0=start)["xf"]).T
        return Result(result[:, columns], lambda: _modes(result[:, n], model), lambda: None)

    return run


def _modes(numbers: Array, model: PlainModel) -> Array:
    names = [mode.name for mode in model.modes]
    return np.array([names[round(k)] if np.isfinite(k) else "" for k in numbers], dtype=object)


def _problem(model: PlainModel) -> tuple[dict[str, Any], Any]:
    n = len(model.x)
    t, x, index = ca.SX.sym("t"), ca.SX.sym("x", n + 1), ca.SX.sym("index")
    parts = [x[i] for i in range(n)]
    mode = x[n]
    ode, zero, after = ca.SX.zeros(n + 1), [], x
    for k, plain in enumerate(model.modes):
        flow = _column(as_function(plain, plain.flow, FUNCTIONS)(t, *parts))
        ode = ca.if_else(mode == k, ca.vertcat(flow, 0), ode) if len(model.modes) > 1 else ca.vertcat(flow, 0)
        for edge in plain.edges:
            guard = _column(as_function(plain, (edge.guard,), FUNCTIONS)(t, *parts))
            reset = _column(as_function(plain, edge.reset, FUNCTIONS)(t, *parts))
            after = ca.if_else(index == len(zero), ca.vertcat(reset, edge.target), after)
            zero.append(-(ca.if_else(mode == k, guard, -1) if len(model.modes) > 1 else guard))
    nothing = [ca.SX(0, 1)] * 3
    names = ["index", "t", "x", "z", "p", "u"], ["post_x", "post_z"]
    transition = ca.Function("transition", [index, t, x, *nothing], [after, ca.SX(0, 1)], *names)
    return {"t": t, "x": x, "ode": ode, "zero": ca.vertcat(*zero)}, transition


def _column(values: Sequence[Any]) -> Any:
    return ca.vertcat(*values)
