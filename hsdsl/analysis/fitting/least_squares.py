"""Least squares over executions by SciPy's trust region method, with the derivatives of the executions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from hsdsl.analysis.fitting.data import Measurements
from hsdsl.analysis.fitting.fit import Fit
from hsdsl.analysis.fitting.objective import Objective
from hsdsl.analysis.fitting.wrong_sides import MOST_SIDES, UNKNOWN, steps_across, wrong_sides
from hsdsl.analysis.sensitivity.result import SampleSlopes, Sensitivity
from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Array
from hsdsl.engine.simulate.stops import show

SHARES = (0.25, 0.5)  # of the time: fits of the beginning of the measurements, from which the whole is tried as well
PRECISE = 1e-15  # changes of values and of the sum that end a fit
LARGEST = 1e100  # the weighted size of a column: its residuals have squares
MOST_NAMED = 3
AT_BOUND = 1e-12  # of a value: how near it comes to the bound that keeps it
MOST_CROSSED = 32  # measurements that transitions pass


def fitted(
    objective: Objective, bounds: Mapping[str, tuple[float, float]], sigma: bool, scales: Mapping[str, float]
) -> Fit:
    """Fit; ``sigma`` says that weights are inverse standard deviations.

    A scale of zero is replaced by the size of the state in the first run.

    Raises UsageError: the run with the first values does not reach the measurements, or these are too large.
    """
    first = np.array([*objective.start.values()])
    for name in objective.measured.columns:
        if objective.size(name) > LARGEST:
            raise UsageError(f"the numbers of column {name} are too large for its standard deviation or weight")
    _check_start(objective, first)
    sizes = {f"{INITIAL}{name}": size for name, size in objective.run(first).execution.sizes().items()}
    scales = {name: scale or sizes.get(name, 0.0) or 1.0 for name, scale in scales.items()}
    results = [_solved(objective, first, bounds, scales)]
    begun = first
    for share in SHARES:
        begun = _beginning(objective, share, begun, bounds, scales)
    if not np.array_equal(begun, first):
        results.append(_solved(objective, begun, bounds, scales))
    return _fit(objective, min(results, key=lambda result: result.cost), bounds, sigma)


def _solved(
    objective: Objective, first: Array, bounds: Mapping[str, tuple[float, float]], scales: Mapping[str, float]
) -> Any:
    """A minimum near values, from which no transition is better off beyond the measurement next to it."""
    sizes: Array = np.array([scales[name] for name in objective.start])
    limits: Array = np.array([*bounds.values()], float)
    best = _minimum(objective, first, limits, sizes)
    for _ in range(MOST_CROSSED):
        tried = (_minimum(objective, best.x + step, limits, sizes) for step in steps_across(objective, best.x, sizes))
        better = next((each for each in tried if each.cost < (1 - PRECISE) * best.cost), None)
        if better is None:
            break
        best = better
    return best


def _minimum(objective: Objective, first: Array, limits: Array, sizes: Array) -> Any:
    """SciPy's result of a fit to values as shares of their sizes, with the values themselves."""
    lower: Array = limits[:, 0]
    upper: Array = limits[:, 1]

    def values(x: Array) -> Array:
        return np.clip(x * sizes, lower, upper)

    def residuals(x: Array) -> Array:
        return objective.residuals(values(x))

    def slopes(x: Array) -> Array:
        return objective.slopes(values(x)) * sizes

    solve: Any = least_squares  # pyright: ignore[reportUnknownVariableType]
    start, within = np.clip(first, lower, upper) / sizes, (lower / sizes, upper / sizes)
    result: Any = solve(residuals, start, jac=slopes, bounds=within, ftol=PRECISE, xtol=PRECISE, gtol=PRECISE)
    shares: Array = np.asarray(result.x, float)
    pushed: Array = np.where(np.asarray(result.grad, float) < 0, upper, lower)  # the sum falls towards it
    at = np.abs(pushed / sizes - shares) <= AT_BOUND * np.maximum(1.0, np.abs(shares))  # SciPy stays inside
    result.x = np.where(at, pushed, values(shares))
    return result


def _beginning(
    objective: Objective, share: float, first: Array, bounds: Mapping[str, tuple[float, float]], scales: Any
) -> Array:
    """Fit the measurements of the first share of the time: less can go wrong there."""
    measured = objective.measured
    early = measured.times <= share * float(measured.times.max())
    part = Measurements(measured.times[early], {name: column[early] for name, column in measured.columns.items()})
    if part.count <= len(first):
        return first
    beginning = replace(objective, measured=part, bumps=[], _last=None)
    found: Array = np.asarray(_solved(beginning, first, bounds, scales).x)
    objective.evaluations = beginning.evaluations
    return found


def _check_start(objective: Objective, first: Array) -> None:
    found, measured = objective.run(first), objective.measured
    run, end = found.execution, float(measured.times.max())
    if float(run.times[-1]) < end:
        raise UsageError(
            f"the run with the first values ends at t = {show(run.times[-1])} ({run.stop.reason}), before the last "
            f"measurement at t = {show(end)}",
            "begin with other values by --set NAME=VALUE",
        )
    table = found.as_made().sample(measured.times)
    for name, column in measured.columns.items():
        if not np.isfinite(_column(table, name)[np.isfinite(column)]).any():
            raise UsageError(
                f"the run with the first values has no {name} at any time at which it was measured",
                "begin with other values by --set NAME=VALUE, or leave the column out",
            )


def _column(table: SampleSlopes, name: str) -> Array:
    """A state or output at the times of a table, NaN where a mode lacks it."""
    return np.asarray(table.values.get(name, np.full(len(table.times), np.nan)), float)


def _fit(objective: Objective, result: Any, bounds: Mapping[str, tuple[float, float]], sigma: bool) -> Fit:
    x: Array = np.asarray(result.x, float)
    residuals, slopes, found = objective.residuals(x), objective.slopes(x), objective.run(x)
    free = max(1, len(residuals) - len(x))
    variance = float(np.sum(residuals**2)) / free
    covariance = _covariance(slopes) * (1.0 if sigma else variance)
    values = objective.named(x)
    at = tuple(name for name, value in values.items() if value in bounds[name])
    times, run = objective.measured.times, found.execution
    reached = times <= float(run.times[-1])
    table = found.as_made().sample(times[reached])
    measured = objective.measured.columns
    left_over = {name: np.full(len(times), np.nan) for name in measured}
    for name, column in measured.items():
        left_over[name][reached] = _column(table, name) - column[reached]
    ends = f"the run ends at t = {show(run.times[-1])} ({run.stop.reason}), before the last measurement"
    return Fit(
        values,
        covariance,
        left_over,
        variance**0.5,
        bool(result.success) and bool(reached.all()),
        str(result.message) if reached.all() else ends,
        objective.evaluations,
        at,
        (
            *_close_transitions(found, objective.measured, covariance),
            *(each.sentence for each in wrong_sides(objective, x)[:MOST_SIDES]),
            *objective.bumps,
        ),
        objective.measured,
        found.run,
    )


def _covariance(slopes: Array) -> Array:
    """The inverse of J^T J; infinite in directions that nothing determines."""
    largest = np.max(np.abs(slopes), axis=0, initial=0.0)  # whose square may be too small for a number
    norms = largest * np.linalg.norm(slopes / np.where(largest > 0, largest, 1.0), axis=0)
    scaled = slopes / np.where(norms > 0, norms, 1.0)
    _, sizes, rows = np.linalg.svd(scaled, full_matrices=False)
    known = sizes > UNKNOWN * sizes.max(initial=0.0)
    inverse = (rows[known].T / sizes[known] ** 2) @ rows[known]
    unknown = np.sum(rows[~known] ** 2, axis=0) > UNKNOWN
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        covariance = inverse / np.outer(norms, norms)
    for k in np.flatnonzero(unknown | (norms == 0)):
        covariance[k, :] = covariance[:, k] = 0.0
        covariance[k, k] = np.inf
    return covariance


def _close_transitions(found: Sensitivity, measured: Measurements, covariance: Array) -> Sequence[str]:
    """The transitions that the uncertainty of the values carries over a measurement."""
    close: list[str] = []
    spread, end = np.where(np.isfinite(covariance), covariance, 0.0), float(measured.times.max())
    for made, moves in zip(found.execution.transitions, found.as_made().transitions, strict=True):
        slope = np.array([moves.time[by] for by in found.wrt], float)
        reach = 2 * float(max(0.0, slope @ spread @ slope)) ** 0.5
        if reach <= TIE * max(abs(float(made.time)), end):
            continue  # its time depends on no value
        near = measured.times[np.abs(measured.times - made.time) <= reach]
        if len(near):
            where = f"t = {show(near[0])}" + (f" and {len(near) - 1} more" if len(near) > 1 else "")
            close.append(
                f"{made.edge} at t = {show(made.time)} is within its uncertainty of the measurement at {where}"
            )
    more = [f"and {len(close) - MOST_NAMED} more transitions so"] if len(close) > MOST_NAMED else []
    return [*close[:MOST_NAMED], *more]
