"""Least squares over executions by SciPy's trust region method, with the derivatives of the executions.

No derivative shows that a measurement agrees better with the other side of the transition next to it: such a transition
is moved over it, and the fit goes on from there. A fit that ends beside a jump goes on along it (`along_jump`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]
from scipy.special import chdtrc  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

from hsdsl.analysis.fitting.fit import Fit, Measurements
from hsdsl.analysis.fitting.jumps import (
    MOST_SIDES,
    UNKNOWN,
    along_jump,
    around,
    beside_jump,
    close_transitions,
    lowest,
    same_order,
    steps_across,
    wrong_sides,
)
from hsdsl.analysis.report.words import number
from hsdsl.analysis.sensitivity.result import SampleSlopes, Sensitivity
from hsdsl.base.errors import UsageError
from hsdsl.base.names import INITIAL
from hsdsl.engine.execution import Array
from hsdsl.engine.simulate.stops import show

SHARES = (0.25, 0.5)  # of the time: fits of the beginning of the measurements, from which the whole is tried as well
PRECISE = 1e-15  # changes of values and of the sum that end a fit
LARGEST = 1e100  # the weighted size of a column: its residuals have squares
AT_BOUND = 1e-12  # of a value: how near it comes to the bound that keeps it
MOST_CROSSED = 32  # measurements that transitions pass
FACTOR = 4.0  # by which first guesses of values without bounds differ at most from the given one
SEED = 20260101  # of first guesses
FEW = 2  # values of which each fit tries others further off
MOST_ROUNDS = 4  # of such tries
ENDS = (  # by SciPy's status
    "the number of runs is at its limit",
    "the sum of squares is level",
    "the sum of squares no longer changes",
    "the values no longer change",
    "neither the values nor the sum of squares change any more",
)
OTHERS = (
    "runs with other values make other transitions: this fit is the best for this order of transitions; "
    "try other first guesses (`--starts`)"
)


def fitted(
    objective: Objective,
    bounds: Mapping[str, tuple[float, float]],
    sigma: bool,
    scales: Mapping[str, float],
    level: float | None = None,
    starts: int = 1,
) -> Fit:
    """Fit; ``sigma`` says that weights are inverse standard deviations, ``level`` is that of profile intervals.

    ``starts`` counts the first guesses, the given one among them.

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
    guesses = _guesses(first, bounds, scales, starts - 1)
    results += [_solved(objective, guess, bounds, scales) for guess in guesses]
    best = min(results, key=lambda result: result.cost)
    if len(first) <= FEW or _leaves_order(objective, objective.order(best.x)):
        best = _further(objective, best, first, bounds, scales)
    best = _along_jump(objective, best, bounds, scales)
    found = _fit(objective, best, bounds, sigma, scales)
    if level is None:
        return replace(found, nonsmooth=(*_other_order(objective, found), *found.nonsmooth))
    from hsdsl.analysis.fitting.profile import Profile, rise_of

    sizes = np.array([scales[name] for name in found.values])
    profile = Profile(objective, _minimum, best.x, np.array([*bounds.values()], float), sizes, 2 * float(best.cost))
    rise = rise_of(level, found.deviation**2, objective.measured.count - len(sizes), sigma)
    known = profile.intervals([*found.values], found.covariance, rise)
    ends = {name: [f"{end:.4g}" for k, end in profile.jumps if k == i] for i, name in enumerate(known)}
    jumps = (f"the interval of {name} ends at a jump of the sum: {', '.join(at)}" for name, at in ends.items() if at)
    lower = sorted(profile.lower, key=lambda each: each[0])[:1]
    begin = [", ".join(f"{a} = {number(b, 6)}" for a, b in objective.named(x).items()) for _, x in lower]
    better = (f"the search for intervals met a lower sum: begin with {values}" for values in begin)
    reasons = (*_other_order(objective, found), *better, *jumps, *found.nonsmooth)
    return replace(found, level=level, intervals=known, evaluations=objective.evaluations, nonsmooth=reasons)


def _guesses(first: Array, bounds: Mapping[str, tuple[float, float]], scales: Mapping[str, float], n: int) -> Array:
    """Draw n first guesses: within finite bounds, by their logarithms if these are positive, else by a factor."""
    draw, found = np.random.default_rng(SEED).random((n, len(first))), np.empty((n, len(first)))
    for k, (value, (low, high), scale) in enumerate(zip(first, bounds.values(), scales.values(), strict=True)):
        share = draw[:, k]
        if np.isfinite(high - low):
            found[:, k] = low * (high / low) ** share if low > 0 else low + (high - low) * share
        else:
            drawn = value * FACTOR ** (2 * share - 1) if value else scale * (2 * share - 1)
            found[:, k] = np.clip(drawn, low, high)
    return found


def _other_order(objective: Objective, found: Fit) -> Sequence[str]:
    """What to say if runs of the search made other transitions; one more or less at the end makes no other order."""
    best = tuple(made.edge for made in found.execution.transitions)
    return [OTHERS] if _leaves_order(objective, best) else []


def _leaves_order(objective: Objective, best: tuple[str, ...] | None) -> bool:
    return best is None or not all(same_order(best, each) for each in objective.orders)


def _further(
    objective: Objective, best: Any, first: Array, bounds: Mapping[str, tuple[float, float]], scales: Any
) -> Any:
    """The best fit from values further off, where the sum is lower or the run makes other transitions."""
    sizes, limits = np.array([scales[name] for name in objective.start]), np.array([*bounds.values()], float)
    centres = [best.x, first] if _leaves_order(objective, objective.order(best.x)) else [best.x]
    for _ in range(MOST_ROUNDS):
        points = [x for centre in centres for x in around(centre, limits, sizes)]
        order, total = objective.order(best.x), 2 * best.cost
        firsts = [x for x, here, sum_ in lowest(objective, points) if sum_ < total or not same_order(here, order)]
        before = best
        for x in firsts[:MOST_SIDES]:
            seen = objective.seen
            tried = _solved(objective, x, bounds, scales)
            if tried.cost < (1 - PRECISE) * best.cost:
                best = tried
            else:
                objective.seen = seen
        if best is before:
            break
        centres = [best.x]
    return best


def _along_jump(objective: Objective, best: Any, bounds: Mapping[str, tuple[float, float]], scales: Any) -> Any:
    """The best fit, or a lower one along the jump of the sum of squares that it ended beside."""
    sizes, limits = np.array([scales[name] for name in objective.start]), np.array([*bounds.values()], float)
    x = along_jump(objective, best.x, limits, sizes)
    if np.array_equal(x, best.x):
        return best
    best.x, best.cost = x, float(np.sum(objective.residuals(x) ** 2)) / 2
    tried = _solved(objective, x, bounds, scales)
    return tried if tried.cost < (1 - PRECISE) * best.cost else best


def _solved(
    objective: Objective, first: Array, bounds: Mapping[str, tuple[float, float]], scales: Mapping[str, float]
) -> Any:
    """A minimum near values, from which no transition is better off beyond the measurement next to it."""
    sizes: Array = np.array([scales[name] for name in objective.start])
    limits: Array = np.array([*bounds.values()], float)
    functions = objective.residuals, objective.slopes
    best = _minimum(*functions, first, limits, sizes)
    for _ in range(MOST_CROSSED):
        tried = (_minimum(*functions, best.x + step, limits, sizes) for step in steps_across(objective, best.x, sizes))
        better = next((each for each in tried if each.cost < (1 - PRECISE) * best.cost), None)
        if better is None:
            break
        best = better
    return best


def _minimum(residuals: Numbers, slopes: Numbers, first: Array, limits: Array, sizes: Array) -> Any:
    """SciPy's result of a fit to values as shares of their sizes, with the values themselves."""
    lower: Array = limits[:, 0]
    upper: Array = limits[:, 1]

    def values(x: Array) -> Array:
        return np.clip(x * sizes, lower, upper)

    def there(x: Array) -> Array:
        return residuals(values(x))

    def scaled(x: Array) -> Array:
        return slopes(values(x)) * sizes

    solve: Any = least_squares  # pyright: ignore[reportUnknownVariableType]
    start, within = np.clip(first, lower, upper) / sizes, (lower / sizes, upper / sizes)
    with np.errstate(all="ignore"):  # squares of runs far off
        result: Any = solve(there, start, jac=scaled, bounds=within, ftol=PRECISE, xtol=PRECISE, gtol=PRECISE)
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


def _fit(
    objective: Objective,
    result: Any,
    bounds: Mapping[str, tuple[float, float]],
    sigma: bool,
    scales: Mapping[str, float],
) -> Fit:
    x: Array = np.asarray(result.x, float)
    residuals, slopes, found = objective.residuals(x), objective.slopes(x), objective.run(x)
    sizes, limits = np.array([scales[name] for name in objective.start]), np.array([*bounds.values()], float)
    beside = beside_jump(objective, x, limits, sizes)
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
        left_over[name][reached] = column[reached] - _column(table, name)
    ends = f"the run ends at t = {show(run.times[-1])} ({run.stop.reason}), before the last measurement"
    return Fit(
        values,
        covariance,
        left_over,
        variance**0.5,
        bool(result.success) and bool(reached.all()),
        ENDS[int(result.status)] if reached.all() else ends,
        objective.evaluations,
        at,
        (
            *beside,
            *close_transitions(found, objective.measured, covariance),
            *(each.sentence for each in wrong_sides(objective, x)[:MOST_SIDES]),
            *objective.bumps,
        ),
        objective.measured,
        found.run,
        bounds=bounds,
        chance=float(cast(Any, chdtrc)(free, free * variance)) if sigma and len(residuals) > len(x) else None,
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


Numbers = Callable[[Array], Array]
Evaluate = Callable[[Mapping[str, float], float], Sensitivity]
Progress = Callable[[int, Mapping[str, float], float], None]
TOO_FAR = 1e3  # times the size of a column: the residual of a run that ends before a measurement


@dataclass
class Objective:
    """Weighted differences of runs from measurements, and their derivatives; the last run is kept.

    ``start`` has the values of the names by which runs are changed, ``weights`` a factor for each column. ``orders``
    has the sequences of transitions that runs made.
    """

    evaluate: Evaluate
    measured: Measurements
    weights: Mapping[str, float]
    start: Mapping[str, float]
    progress: Progress | None = None
    evaluations: int = 0
    bumps: list[str] = field(default_factory=list[str])
    orders: set[tuple[str, ...]] = field(default_factory=set[tuple[str, ...]])
    _last: tuple[bytes, Array, Array, Sensitivity | None] | None = None

    @property
    def seen(self) -> tuple[list[str], set[tuple[str, ...]]]:
        """What the search has met so far, to return to it."""
        return [*self.bumps], {*self.orders}

    @seen.setter
    def seen(self, met: tuple[list[str], set[tuple[str, ...]]]) -> None:
        self.bumps, self.orders = met

    def residuals(self, x: Array) -> Array:
        """The run with these values minus the measurements, weighted, one after the other."""
        return self._at(x)[1]

    def slopes(self, x: Array) -> Array:
        """Their derivatives, (number of residuals, number of values)."""
        return self._at(x)[2]

    def order(self, x: Array) -> tuple[str, ...] | None:
        """The transitions of the run, or None if it does not reach the last measurement."""
        found = self._at(x)[3]
        if found is None or float(found.execution.times[-1]) < float(self.measured.times.max()):
            return None
        return tuple(made.edge for made in found.execution.transitions)

    def run(self, x: Array) -> Sensitivity:
        return self._at(x)[3] or self.evaluate(self.named(x), float(self.measured.times.max()))

    def tried(self, x: Array, until: float) -> Sensitivity | None:
        """A run, or None if the model has none with these values; there is one with the first values."""
        try:
            return self.evaluate(self.named(x), until)
        except UsageError:
            if not self.evaluations:
                raise
            return None

    def _at(self, x: Array) -> tuple[bytes, Array, Array, Sensitivity | None]:
        key = np.asarray(x, float).tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, *self._computed(x)
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

    def _computed(self, x: Array) -> tuple[Array, Array, Sensitivity | None]:
        times = self.measured.times
        found, reached, table = self.tried(x, float(times.max())), np.zeros(len(times), bool), None
        if found:
            self.bumps += [reason for _, reason in found.breaks if reason not in self.bumps]
            reached = times <= float(found.execution.times[-1])
            if reached.all():
                self.orders.add(tuple(made.edge for made in found.execution.transitions))
            table = found.as_made().sample(times[reached]) if reached.any() else None
        residuals: list[Array] = []
        slopes: list[Array] = []
        for name, column in self.measured.columns.items():
            weight, known = self.weights[name], np.isfinite(column)
            far = TOO_FAR * (self.size(name) or 1.0)
            off, moves = np.full(len(times), far), np.zeros((len(times), len(self.start)))
            if table is not None and name in table.values:
                there = np.asarray(table.values[name], float)
                with np.errstate(over="ignore", invalid="ignore"):
                    apart, by = weight * (there - column[reached]), weight * np.asarray(table.slopes[name], float)
                off[reached] = np.where(np.isfinite(there), np.clip(apart, -LARGEST, LARGEST), far)
                moves[reached] = np.where(np.abs(by) < LARGEST, by, 0)
            residuals.append(off[known])
            slopes.append(moves[known])
        return np.concatenate(residuals), np.concatenate(slopes), found
