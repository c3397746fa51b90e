"""Measurements over time, and the result of a fit to them: values with their covariance, and residuals."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isinf
from pathlib import Path
from typing import Any, cast

import numpy as np

from hsdsl.analysis.report.json_form import named, plain
from hsdsl.analysis.report.words import condensed, number
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, checks_methods, counted, did_you_mean, shown, visible
from hsdsl.engine.execution import HYBRID_TIME, Array, Execution


@checks_methods
@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """The values of parameters and initial states that agree best with measurements.

    Attributes
    ----------
    values : dict
        The values by name, as given in ``wrt``.
    covariance : array, shape (n, n)
        The covariance of the values in their order. It follows from the standard deviations of the measurements, if
        these were given, or else from the residuals. It is infinite if the measurements do not determine a value.
    residuals : dict of array
        Each measurement minus the run, by column; NaN if nothing was measured, or the run has ended.
    deviation : float
        The root of the weighted sum of squared residuals per degree of freedom.
    success : bool
        Whether the method reached a minimum; ``message`` says how it ended.
    at_bound : tuple of str
        The values that are at a bound of the file.
    nonsmooth : tuple of str
        The places without a derivative, at the values found and during the search; the covariance may be wrong there.
    execution : Execution
        The run with these values.
    units : mapping
        The units that the model gives.
    level, intervals : float or None, dict of (float, float)
        Intervals of this level by profile likelihood, if requested: the values up to which the other values can
        compensate for a change. If the measurements do not limit an end, it is the bound of the file, or infinite.
    bounds : mapping
        The least and the largest value that the file allows.
    chance : float or None
        If standard deviations were given: the probability that chance alone makes residuals at least this large.
    """

    values: dict[str, float]
    covariance: Array
    residuals: dict[str, Array]
    deviation: float
    success: bool
    message: str
    evaluations: int
    at_bound: tuple[str, ...]
    nonsmooth: tuple[str, ...]
    measured: Measurements = field(repr=False)
    execution: Execution = field(repr=False)
    units: Mapping[str, str] = field(default_factory=dict[str, str], repr=False)
    level: float | None = None
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]], repr=False)
    chance: float | None = None

    def __repr__(self) -> str:
        values = ", ".join(f"{name} {number(value, 6)}" for name, value in self.values.items())
        of = visible(called(self.execution.title, self.execution.model))
        return f"<Fit of {of}: {visible(values)}, {self._counts}>"

    @property
    def _counts(self) -> str:
        return f"{counted(self.measured.count, 'measurement')}, {counted(self.evaluations, 'run')}"

    def _repr_html_(self) -> str:
        """Show the values and a picture in notebooks."""
        from hsdsl.analysis.plot.notebook import measured_html

        return measured_html(self.summary, self.execution, self.measured.times, self.measured.columns, self.units)

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviation of each value."""
        return dict(zip(self.values, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    def as_json(self) -> dict[str, Any]:
        """Return the object of `fit --json`; values that are not determined are null."""
        known = named(self, "values deviations covariance deviation success message evaluations at_bound")
        known |= {"intervals": self.intervals, "level": self.level} if self.level else {}
        known |= {"chance": self.chance, "warnings": self.warnings} if self.chance is not None else {}
        return plain(known | {"measurements": self.measured.count, "nonsmooth": condensed(self.nonsmooth)})

    @property
    def warnings(self) -> tuple[str, ...]:
        """What makes the deviations and intervals mean little: residuals far larger than standard deviations allow."""
        if self.chance is None or self.chance >= UNLIKELY:
            return ()
        free = self.measured.count - len(self.values)
        squares = f"chi2 = {number(free * self.deviation**2, 4)} with {counted(free, 'degree')} of freedom"
        return (
            f"the model does not explain the data: {squares} (probability below {UNLIKELY:g}); "
            "deviations and intervals mean little",
        )

    @property
    def summary(self) -> str:
        """The fit as lines of text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        run = self.execution
        yield f"{called(run.title, run.model)}: {self._counts}"
        width = max(map(len, self.values))
        for name, value in self.values.items():
            deviation = self.deviations[name]
            determined = bool(np.isfinite(deviation))
            known = f"+- {_digits(deviation, 2)}" if determined else "not determined by the measurements"
            bound = ", at its bound" if name in self.at_bound else ""
            yield f"  {name:{width}}  {self._rounded(name, value)} {known}{self._interval(name)}{bound}"
        for name in self.at_bound:
            which = "min" if self.values[name] == self.bounds[name][0] else "max"
            yield f"{name} is at its {which}: a fit without this bound would be closer to the measurements"
        yield f"residual: {number(self.deviation, 4)} (weighted root mean square)"
        yield f"{'converged' if self.success else 'did not converge'}: {self.message}"
        yield from (f"warning: {reason}" for reason in self.warnings)
        yield from (f"not smooth: {reason}" for reason in condensed(self.nonsmooth))

    def _rounded(self, name: str, x: float) -> str:
        """Write a value, or an end of its interval, as precisely as its deviation to two digits."""
        deviation = self.deviations[name]
        if not np.isfinite(deviation) or x == 0:
            return number(x, 3)
        if deviation == 0:
            return number(x, MOST_DIGITS)
        place = [int(f"{each:.1e}".partition("e")[2]) for each in (x, deviation)]
        return _digits(x, min(max(1, place[0] - place[1] + 2), MOST_DIGITS))

    def _interval(self, name: str) -> str:
        if name not in self.intervals:
            return ""
        ends = [
            "unbounded" if isinf(end) else self._rounded(name, end) + " (its bound)" * (end in self.bounds[name])
            for end in self.intervals[name]
        ]
        return f"; {100 * (self.level or 0):.4g} %: {ends[0]} to {ends[1]}"

    def plot_residuals(self, path: str | os.PathLike[str]) -> None:
        """Draw the residuals, measurements minus run, to a .png or .svg file: over time, and as a histogram."""
        from hsdsl.analysis.plot.ensembles import plot_residuals

        heading = f"{counted(self.measured.count, 'measurement')} minus the run; dotted: transitions"
        plot_residuals(path, self.execution, self.measured.times, self.residuals, self.units, heading)

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the measurements and the run to a .png or .svg file."""
        from hsdsl.analysis.plot.ensembles import plot_measured

        values = ", ".join(f"{name} = {number(value, 6)}" for name, value in self.values.items())
        heading = (
            f"fit to {counted(self.measured.count, 'measurement')}: {values}; residual {number(self.deviation, 4)}"
        )
        plot_measured(path, self.execution, self.measured.times, self.measured.columns, self.units, heading)


def _digits(x: float, digits: int) -> str:
    """Write a number to so many significant digits, zeros at its end among them."""
    place = int(f"{x:.{digits - 1}e}".partition("e")[2])
    if digits <= place + 1 <= FIXED_DIGITS:
        return f"{round(x, digits - 1 - place):.0f}"
    return f"{x:#.{digits}g}".replace(".e", "e")


UNLIKELY = 1e-3  # residuals of a lower probability: the model does not explain the data
MOST_DIGITS = 12
FIXED_DIGITS = 6  # before the point; longer numbers have an exponent
TIMES = ("t", "time")
LEAST_ROWS = 1


@dataclass(frozen=True)
class Measurements:
    """Times, shape (n,), and columns by the name of a state or output, (n,); NaN where nothing was measured."""

    times: Array
    columns: dict[str, Array]

    @property
    def count(self) -> int:
        """How many numbers were measured."""
        return sum(int(np.isfinite(column).sum()) for column in self.columns.values())


def measurements(given: Any, known: Sequence[str]) -> Measurements:
    """Read measurements of the states and outputs in ``known``.

    Parameters
    ----------
    given : path, mapping or DataFrame
        A CSV file whose first row has names, or columns by name; ``t`` or ``time`` has the times. An empty cell was not
        measured. The columns ``mode`` and ``j`` of a run's own file are passed over.

    Raises UsageError: a column that is neither or comes twice, no times, or a cell that is no finite number.
    """
    if isinstance(given, Measurements):
        return given
    name, columns = _columns(given)
    timed = [c for c in columns if c.lower() in TIMES and c not in known]
    if len(timed) != 1:
        got = "both " + " and ".join(timed) if timed else ", ".join(columns) or "none"
        hint = "separate columns by commas" if any(";" in c for c in columns) else None
        raise UsageError(f"{name}: expected a column t or time with the times, got {got}", hint)
    (time,) = timed
    measured = [c for c in columns if c != time and c not in HYBRID_TIME]
    for column in measured:
        if column not in known:
            raise UsageError(f"{name}: the model has no state or output '{shown(column)}'", did_you_mean(column, known))
    if not measured:
        raise UsageError(f"{name}: no column is a state or output", f"known here: {', '.join(known)}")
    times = _numbers(name, time, columns[time])
    found = {column: _numbers(name, column, columns[column]) for column in measured}
    if any(len(column) != len(times) for column in found.values()):
        raise UsageError(f"{name}: columns differ in length")
    if not (times >= 0).all():
        raise UsageError(f"{name}: expected times that are not negative, got {times[~(times >= 0)][0]}")
    result = Measurements(times, found)
    if not result.count:
        raise UsageError(f"{name}: nothing was measured")
    return result


def _columns(given: Any) -> tuple[str, dict[str, Sequence[Any]]]:
    if isinstance(given, (str, Path)):
        path = Path(given)
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = [row for row in csv.reader(file) if row]
        except UnicodeDecodeError:
            raise UsageError(f"{path} cannot be read: it is no text in UTF-8") from None
        except (OSError, csv.Error) as error:
            raise UsageError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
        if not rows:
            raise UsageError(f"{path} is empty", "its first row has the names of columns")
        names = _single(str(path), [name.strip() for name in rows[0]])
        for k, row in enumerate(rows[1:], 2):
            if len(row) != len(names):
                raise UsageError(f"{path}: row {k} has {len(row)} cells, and the first one has {len(names)}")
        return str(given), {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)}
    if hasattr(given, "columns") or isinstance(given, Mapping):
        table = cast(Any, given)
        names = _single("data", [*getattr(table, "columns", table)])
        return "data", {str(name): list(table[name]) for name in names}
    raise UsageError(f"data: expected a CSV file, a mapping or a DataFrame, got {type(given).__name__}")


def _single(source: str, names: list[Any]) -> list[Any]:
    """The names, unless one comes twice."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise UsageError(f"{source}: expected a column once, got '{shown(str(name))}' twice")
    return names


def _numbers(name: str, column: str, cells: Sequence[Any]) -> Array:
    found: list[float] = []
    for k, cell in enumerate(cells):
        text = cell.strip() if isinstance(cell, str) else cell
        try:
            found.append(float("nan") if text in ("", None) else float(text))
        except (TypeError, ValueError):
            found.append(inf)  # no number either
        if isinf(found[-1]):
            place = f"column {column}, row {k + 2}"
            reason = f"{name}: expected a finite number in {place}, got '{shown(str(cell))}'"
            raise UsageError(reason, "leave the cell empty if nothing was measured")
    return np.array(found)
