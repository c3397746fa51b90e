"""Fits of a model to measurements: what a call means, from names and data to values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.fitting.fit import Fit, Measurements, measurements
from hsdsl.analysis.fitting.least_squares import Objective, Progress, fitted
from hsdsl.analysis.sensitivity.result import Sensitivity
from hsdsl.analysis.sensitivity.targets import Target
from hsdsl.base.errors import UsageError
from hsdsl.base.names import counted, did_you_mean
from hsdsl.engine.execution import Array
from hsdsl.engine.preparation.options import check_arguments, overrides_of
from hsdsl.interface.model.differentiate import start_by, varied

if TYPE_CHECKING:
    from hsdsl.interface.model.runs import Runs

REFUSED = ("step", "scheme", "samples", "precision", "until")


def fit(
    model: Runs,
    data: Any,
    wrt: str | Sequence[str],
    sigma: Mapping[str, float] | float | None,
    weights: Mapping[str, float] | float | None,
    level: float | None,
    starts: int,
    progress: Progress | None,
    arguments: Mapping[str, Any],
) -> Fit:
    """Fit a model; see `Model.fit`."""
    check_arguments(arguments, "a fit", REFUSED)
    if level is not None and not 0 < level < 1:
        raise UsageError(f"intervals: expected a level between 0 and 1, got {level:g}", "for example 0.95")
    if sigma and weights:
        raise UsageError("expected sigma or weights, got both", "a weight is one over a standard deviation")
    if starts < 1:
        raise UsageError(f"starts: expected at least 1, got {starts}")
    measured = measurements(data, model.columns)
    values = model.pipeline.values(parameters=overrides_of(arguments, "parameters", model.program))
    by, start = start_by(wrt, arguments, values)
    if measured.count < len(by):
        raise UsageError(f"{counted(measured.count, 'measurement')} cannot determine {counted(len(by), 'value')}")
    if level is not None and not sigma and measured.count == len(by):
        reason = f"{counted(measured.count, 'measurement')} of {counted(len(by), 'value')} leave nothing over"
        raise UsageError(f"intervals: {reason} to judge by", "give sigma")
    bounds = {t.label: _bounds(values, t) for t in by}
    labels = [t.label for t in by]

    def evaluate(given: Mapping[str, float], until: float) -> Sensitivity:
        return model.sensitivity(labels, **varied({**arguments, "until": until}, by, given, model.program))

    own = _weights(measured, _by_column(measured, sigma), _by_column(measured, weights))
    objective = Objective(evaluate, measured, own, start, progress)
    scales = {label: abs(value) or _span(bounds[label]) for label, value in start.items()}
    return replace(fitted(objective, bounds, bool(sigma), scales, level, starts), units=model.program.units)


def _bounds(values: Any, target: Target) -> tuple[float, float]:
    """The bounds that the file gives a parameter."""
    if target.initial:
        return -np.inf, np.inf
    i = values.program.parameters.index(target.name)
    low, high = (
        float(values.constant(name)[0]) if values.has(name) else limit
        for name, limit in ((f"minimum_{i}", -np.inf), (f"maximum_{i}", np.inf))
    )
    return low, high


def _span(bounds: tuple[float, float]) -> float:
    span = bounds[1] - bounds[0]
    return span if np.isfinite(span) else 0.0


def _by_column(measured: Measurements, given: Mapping[str, float] | float | None) -> Mapping[str, float] | None:
    """Numbers by column; a number alone is that of the only one."""
    if given is None or isinstance(given, Mapping):
        return given
    if len(measured.columns) > 1:
        raise UsageError(f"expected a number for each of {', '.join(measured.columns)}, got {given} alone")
    return dict.fromkeys(measured.columns, given)


def _weights(
    measured: Measurements, sigma: Mapping[str, float] | None, weights: Mapping[str, float] | None
) -> dict[str, float]:
    """One over the standard deviation, or the weight that is given, or one over the largest size of the column."""
    for given in (sigma, weights):
        for name, value in (given or {}).items():
            if name not in measured.columns:
                raise UsageError(f"there are no measurements of '{name}'", did_you_mean(name, measured.columns))
            if not 0 < value < np.inf:
                raise UsageError(f"expected a positive number for {name}, got {value}")
    if sigma and (missing := [name for name in measured.columns if name not in sigma]):
        raise UsageError(f"there is no standard deviation of {', '.join(missing)}", "give one for every column")

    def weight(name: str, column: Array) -> float:
        if sigma:
            return 1 / float(sigma[name])
        size = float(np.nanmax(np.abs(column)))
        return float((weights or {}).get(name, 1 / size if size > 0 else 1.0))

    return {name: weight(name, column) for name, column in measured.columns.items()}
