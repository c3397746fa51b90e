"""Our own runs: schemes, methods and engines, at tolerances or steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from hsdsl.chart.result import Attempt, Result
from hsdsl.chart.scene import Scene, sampled
from hsdsl.errors import UsageError
from hsdsl.integrators import METHODS, ButcherTableau
from hsdsl.simulate import SCHEMES as ALL_SCHEMES

SCHEMES = tuple(name for name in ALL_SCHEMES if name != "paoli-schatzman")
ENGINES = ("c", "python")
SHARES = tuple(10.0 ** -(k / 2) for k in range(5, 10))  # steps as shares of a run
LEAST_RELAXATION = 1e-12


def own_runs(
    scene: Scene,
    schemes: Sequence[str],
    methods: Sequence[str],
    engines: Sequence[str],
    tolerances: Sequence[float],
    steps: Sequence[float],
    remarks: list[str],
) -> Iterator[Attempt]:
    """List what can run, in the order of rising effort; what cannot leaves its reason in ``remarks``."""
    length = float(scene.grid[-1])
    for scheme in schemes:
        for method in methods or METHODS:
            adaptive = METHODS[method].adaptive
            size = "tolerance" if adaptive else "step"
            values = sorted(tolerances if adaptive else steps or (length * share for share in SHARES), reverse=True)
            for engine in engines:
                asked = {"scheme": scheme, "method": method, "engine": engine}
                if refusal := _refusal(scene, asked, size, values[0]):
                    remarks.append(f"{scheme} {method} {engine}: {refusal}")
                    continue
                for value in values:
                    yield _attempt(scene, asked, size, value)


def _attempt(scene: Scene, asked: dict[str, Any], size: str, value: float) -> Attempt:
    if asked["scheme"] == "relaxed":
        asked = asked | {"relaxation": relaxation(asked["method"], value)}
    run = partial(_run, scene, asked | {size: value})
    return Attempt(f"hsdsl {asked['engine']}", asked["scheme"], asked["method"], size, value, run)


def relaxation(method: str, value: float) -> float:
    """Return a relaxation whose error is below that of the tolerance or step it goes with."""
    chosen = METHODS[method]
    order = min(chosen.order, 2) if isinstance(chosen, ButcherTableau) and not chosen.adaptive else 1
    return max(LEAST_RELAXATION, 0.01 * value**order)


def _refusal(scene: Scene, asked: dict[str, Any], size: str, value: float) -> str:
    asked = asked | {size: value}
    try:
        scene.model.simulate(0, **asked, parameters=scene.parameters, initial=scene.initial)
    except UsageError as error:
        return str(error)
    return ""


def _run(scene: Scene, asked: dict[str, Any]) -> Result:
    numbers: dict[str, Any] = {"parameters": scene.parameters or None, "initial": scene.initial or None}
    execution = scene.model.simulate(float(scene.grid[-1]), **asked, **numbers)
    values, modes = sampled(execution, scene.grid, scene.states)
    problem = None if execution.stop.complete else execution.stop.message
    return Result(values, modes, lambda: execution.made, problem, execution)
