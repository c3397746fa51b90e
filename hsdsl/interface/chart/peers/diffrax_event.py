# pyright: basic, reportMissingImports=false, reportAttributeAccessIssue=false, reportCallIssue=false, reportArgumentType=false
"""diffrax: ``diffeqsolve`` (Tsit5, PID steps) with an event that a Newton solve locates, compiled, mode by mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import diffrax as dx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from hsdsl.interface.chart.scene import Array, Refused, Result, Scene
from hsdsl.interface.chart.translation import PlainMode, ToolArc, as_function, by_arcs, translate

MOST_STEPS = 1 << 14
FUNCTIONS = {
    **{name: getattr(jnp, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")},
    **{name: getattr(jnp, name) for name in ("asin", "acos", "atan", "asinh", "acosh", "atanh", "atan2", "floor")},
    **{"abs": jnp.abs, "sign": jnp.sign, "max": jnp.maximum, "min": jnp.minimum, "pow": jnp.power},
    "below": lambda number, bound, one, other: jnp.where(number < bound, one, other),
}


def prepare(scene: Scene) -> Callable[[float], Result]:
    """See `hsdsl.interface.chart.peers`."""
    jax.config.update("jax_enable_x64", True)
    model = translate(scene)
    solvers = [_solver(mode) if mode.flow else None for mode in model.modes]

    def integrate(tolerance: float, k: int, t: float, x: Sequence[float], times: Array, until: float) -> ToolArc:
        solver = solvers[k]
        assert solver is not None, "the loop enters no final mode"
        solution = solver(t, until, jnp.asarray(x, dtype=float), tolerance)
        if solution.result not in (dx.RESULTS.successful, dx.RESULTS.event_occurred):
            raise Refused(str(solution.result))
        end, z = float(solution.ts[-1]), np.asarray(solution.ys[-1])
        fired = np.flatnonzero(np.asarray(solution.event_mask)) if model.modes[k].edges else []
        inside = times[times <= end]
        values = np.asarray(_evaluate(solution, _padded(inside, t)))[: len(inside)]
        return ToolArc(end, z, int(fired[0]) if len(fired) else None, values)

    return by_arcs(scene, model, integrate)


def _solver(mode: PlainMode) -> Any:
    flow = as_function(mode, mode.flow, FUNCTIONS)
    guards = [as_function(mode, (edge.guard,), FUNCTIONS) for edge in mode.edges]
    term = dx.ODETerm(lambda t, y, args: jnp.stack([jnp.asarray(v, float) for v in flow(t, *y)]))
    conditions = [lambda t, y, args, guard=guard, **_: guard(t, *y)[0] for guard in guards]

    @jax.jit
    def solve(t: Any, until: Any, x: Any, tolerance: Any) -> Any:
        event = None
        if conditions:
            finder = optx.Newton(tolerance, tolerance, optx.rms_norm)
            event = dx.Event(conditions, finder, direction=[True] * len(conditions))
        return dx.diffeqsolve(
            term,
            dx.Tsit5(),
            t,
            until,
            None,
            x,
            saveat=dx.SaveAt(t1=True, dense=True),
            stepsize_controller=dx.PIDController(rtol=tolerance, atol=tolerance),
            event=event,
            max_steps=MOST_STEPS,
            throw=False,
        )

    return solve


@jax.jit
def _evaluate(solution: Any, times: Any) -> Any:
    return jax.vmap(solution.evaluate)(times)


def _padded(times: Array, filler: float) -> Array:
    """Lengths are powers of two, so that few shapes are compiled."""
    length = 1 << max(0, len(times) - 1).bit_length()
    return np.concatenate((times, np.full(length - len(times), filler)))
