"""How wrong a result is, and whether it is the right execution at all."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np

from hsdsl.chart.result import Result
from hsdsl.chart.scene import Scene
from hsdsl.execution import Execution
from hsdsl.metrics import Interval
from hsdsl.model.distances import distance

OUT_OF_SCALE = 0.1  # an error beyond this share of what the states span is a wrong answer, whatever else is right


@dataclass(frozen=True)
class Judgement:
    """``verdict`` is ``right``, ``wrong`` (another execution) or ``failed`` (no end); ``why`` says what of.

    ``error`` is the largest difference of any state over the samples clear of jumps
    (of states that both have there, whatever the modes), NaN where no sample compares.
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
    exact, found = scene.exact_values[clear], result.values[clear]
    same = scene.exact_modes[clear] == result.modes[clear]
    comparable = np.isfinite(exact) & np.isfinite(found)
    error = float(np.abs(exact - found)[comparable].max()) if comparable.any() else nan
    if result.problem:
        return Judgement("failed", error, result.transitions, result.problem)
    if wrong := _wrong(scene, result, error, int(np.count_nonzero(~same))):
        return Judgement("wrong", error, result.transitions, wrong)
    return Judgement("right", error, result.transitions)


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


def rho(scene: Scene, execution: Execution) -> Interval | None:
    """Return the distance to the exact execution, None where there is none to be had."""
    if not execution.stop.complete:
        return Interval(nan, inf)
    return distance(execution, scene.exact, model=scene.model)
