"""Weighted residuals of executions at measurements, and their derivatives by what a fit varies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hsdsl.analysis.fitting.data import Measurements
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.engine.execution import Array

Evaluate = Callable[[Mapping[str, float], float], Sensitivity]
Progress = Callable[[int, Mapping[str, float], float], None]
TOO_FAR = 1e3  # times the size of a column: the residual of a run that ends before a measurement


@dataclass
class Objective:
    """Weighted residuals of runs and their derivatives; the last run is kept.

    ``start`` has the values of the names by which runs are changed, ``weights`` a factor for each column.
    """

    evaluate: Evaluate
    measured: Measurements
    weights: Mapping[str, float]
    start: Mapping[str, float]
    progress: Progress | None = None
    evaluations: int = 0
    bumps: list[str] = field(default_factory=list[str])
    _last: tuple[bytes, Array, Array, Sensitivity] | None = None

    def residuals(self, x: Array) -> Array:
        """The residuals of a run with these values, weighted, one behind the other."""
        return self._at(x)[1]

    def slopes(self, x: Array) -> Array:
        """Their derivatives, (number of residuals, number of values)."""
        return self._at(x)[2]

    def run(self, x: Array) -> Sensitivity:
        """The run."""
        return self._at(x)[3]

    def _at(self, x: Array) -> tuple[bytes, Array, Array, Sensitivity]:
        key = np.asarray(x, float).tobytes()
        if self._last is None or self._last[0] != key:
            self._last = (key, *self._computed(x))
            self.evaluations += 1
            if self.progress is not None:
                self.progress(self.evaluations, self.named(x), float(np.sum(self._last[1] ** 2)))
        return self._last

    def size(self, name: str) -> float:
        """The largest size of a column, weighted."""
        column = self.measured.columns[name]
        with np.errstate(over="ignore"):
            return float(self.weights[name] * np.max(np.abs(column[np.isfinite(column)]), initial=0.0))

    def named(self, x: Array) -> dict[str, float]:
        """Values by name."""
        return dict(zip(self.start, np.asarray(x, float).tolist(), strict=True))

    def _computed(self, x: Array) -> tuple[Array, Array, Sensitivity]:
        times = self.measured.times
        found = self.evaluate(self.named(x), float(times.max()))
        if found.breaks:
            self.bumps += [reason for _, reason in found.breaks if reason not in self.bumps]
        reached = times <= float(found.execution.times[-1])
        table = found.as_made().sample(times[reached]) if reached.any() else None
        residuals: list[Array] = []
        slopes: list[Array] = []
        for name, column in self.measured.columns.items():
            weight, known = self.weights[name], np.isfinite(column)
            far = TOO_FAR * (self.size(name) or 1.0)
            off, moves = np.full(len(times), far), np.zeros((len(times), len(self.start)))
            if table is not None and name in table.values:
                there = np.asarray(table.values[name], float)
                off[reached] = np.where(np.isfinite(there), weight * (there - column[reached]), far)
                moves[reached] = np.nan_to_num(weight * np.asarray(table.slopes[name], float), posinf=0, neginf=0)
            residuals.append(off[known])
            slopes.append(moves[known])
        return np.concatenate(residuals), np.concatenate(slopes), found
