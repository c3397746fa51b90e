"""The runs of a chart: our schemes, methods and engines, and peers, at tolerances or steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from hsdsl.base.defaults import SCHEMES
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution
from hsdsl.engine.integrators import METHODS
from hsdsl.interface.chart.peers import prepare
from hsdsl.interface.chart.scene import Attempt, Refused, Result, Scene, Tool

OWN_SCHEMES = tuple(name for name in SCHEMES if name != "paoli-schatzman")
ENGINES = ("c", "python")
TOLERANCES = tuple(10.0**-k for k in range(3, 13))
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
                options = {"scheme": scheme, "method": method, "engine": engine}
                if refusal := _refusal(scene, options, size, values[0]):
                    remarks.append(f"{scheme} {method} {engine}: {refusal}")
                    continue
                for value in values:
                    yield _attempt(scene, options, size, value)


def peer_runs(scene: Scene, name: str, tolerances: Sequence[float], remarks: list[str]) -> list[Attempt]:
    """List the runs of a peer; a peer that cannot run the scene leaves its reason in ``remarks``."""
    try:
        run = prepare(name, scene)
    except Refused as refusal:
        remarks.append(f"{name}: {refusal}")
        return []
    return [Attempt(Tool(name), "tolerance", value, partial(run, value)) for value in tolerances]


def _attempt(scene: Scene, options: dict[str, Any], size: str, value: float) -> Attempt:
    if options["scheme"] == "relaxed":
        options = options | {"relaxation": relaxation(options["method"], value)}
    run = partial(_run, scene, options | {size: value})
    return Attempt(Tool(f"hsdsl {options['engine']}", options["scheme"], options["method"]), size, value, run)


def relaxation(method: str, value: float) -> float:
    """Return a relaxation whose error is below that of the tolerance or step it goes with."""
    chosen = METHODS[method]
    order = 1 if chosen.adaptive else min(chosen.order, 2)
    return max(LEAST_RELAXATION, 0.01 * value**order)


def _refusal(scene: Scene, options: dict[str, Any], size: str, value: float) -> str:
    try:
        _simulate(scene, 0, options | {size: value})
    except UsageError as error:
        return str(error)
    return ""


def _simulate(scene: Scene, until: float, options: dict[str, Any]) -> Execution:
    return scene.model.simulate(until, **options, initial=scene.initial or None, parameters=scene.parameters or None)


def _run(scene: Scene, options: dict[str, Any]) -> Result:
    return scene.result(_simulate(scene, float(scene.grid[-1]), options))
