"""The error of a result, and whether it is the right execution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from hsdsl.analysis.metrics import Interval
from hsdsl.engine.execution import Execution
from hsdsl.interface.chart.result import Result
from hsdsl.interface.chart.scene import Scene
from hsdsl.interface.model.distances import distance

OUT_OF_SCALE = 0.1  # of the span of the states: a larger error is a wrong result


@dataclass(frozen=True)
class Judgement:
    """``verdict`` is ``right``, ``wrong`` (another execution) or ``failed`` (no end); ``why`` is the reason.

    ``error`` is the largest difference of any state over the samples clear of jumps at which both have it, NaN where
    no sample compares.
    """

    verdict: str
    error: float
    transitions: int | None
    why: str = ""
    rho: Interval | None = None

    def with_rho(self, rho: Interval | None) -> Judgement:
        """Add a distance of executions."""
        return replace(self, rho=rho)


def judge(scene: Scene, result: Result) -> Judgement:
    """Compare a result with the exact execution."""
    clear = scene.clear
    apart = np.abs(scene.exact_values[clear] - result.values[clear])
    error = float(np.nanmax(np.where(np.isfinite(apart), apart, nan), initial=-inf))
    error = nan if error == -inf else error
    if result.problem:
        return Judgement("failed", error, result.transitions, result.problem)
    others = int(np.count_nonzero(scene.exact_modes[clear] != result.modes[clear]))
    why = _wrong(scene, result, error, others)
    return Judgement("wrong" if why else "right", error, result.transitions, why)


def _wrong(scene: Scene, result: Result, error: float, others: int) -> str:
    fewest, most = scene.countable
    if result.transitions is not None and not fewest <= result.transitions <= most:
        return f"{result.transitions} transitions instead of {most:g}"
    if others:
        return f"another mode at {others} of {len(scene.grid)} samples"
    span = float(np.nanmax(scene.exact_values) - np.nanmin(scene.exact_values)) or 1.0
    if not error <= OUT_OF_SCALE * span:
        return f"an error of {error:.2g} where the states span {span:.2g}"
    return ""


def rho(scene: Scene, execution: Execution, seconds: float) -> Interval | None:
    """Return the distance to the exact execution; None where the run does not get to its end."""
    if not execution.stop.complete:
        return None
    return distance(execution, scene.exact, model=scene.model, seconds=seconds)
