"""What a fit found: values with their covariance, what is left over, and where it is not smooth."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hsdsl.analysis.fitting.data import Measurements
from hsdsl.analysis.report.alike import condensed
from hsdsl.analysis.report.json_form import plain
from hsdsl.analysis.report.words import number
from hsdsl.base.names import called, checks_methods, counted, visible
from hsdsl.engine.execution import Array, Execution


@checks_methods
@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """Values of parameters and initial states that measurements agree with best.

    Attributes
    ----------
    values : dict
        By name, as they were given in ``wrt``.
    covariance : array, shape (n, n)
        Of the values in their order: from the standard deviations of the measurements where these were given, else from
        what is left over. Infinite where the measurements do not determine a value.
    residuals : dict of array
        What the run is above each measurement, by column; NaN where nothing was measured, or the run has ended.
    deviation : float
        The root of the weighted mean square of residuals, over the degrees of freedom.
    success : bool
        Whether the method came to a minimum; ``message`` says how it ended.
    at_bound : tuple of str
        The values that are at a bound of the file.
    nonsmooth : tuple of str
        What is not smooth at the values found, so that the covariance may not hold, and what was met on the way.
    execution : Execution
        The run with these values.
    units : mapping
        The units that the model gives.
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
        """The object of `fit --json`; what is not determined is null."""
        names = ("values", "deviations", "covariance", "deviation", "success", "message", "evaluations", "at_bound")
        known = {name: getattr(self, name) for name in names}
        return plain(known | {"measurements": self.measured.count, "nonsmooth": self.nonsmooth})

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
            known = f"+- {number(deviation, 3)}" if determined else "not determined by the measurements"
            bound = ", at its bound" if name in self.at_bound else ""
            yield f"  {name:{width}}  {number(value, 12 if determined else 3)} {known}{bound}"
        yield f"left over: {number(self.deviation, 4)} (weighted root mean square)"
        yield f"{'ended' if self.success else 'did not end'} well: {self.message}"
        yield from (f"not smooth: {reason}" for reason in condensed(self.nonsmooth))

    def plot(self, path: str | os.PathLike[str]) -> None:
        """Draw the measurements and the run to a .png or .svg file."""
        from hsdsl.analysis.plot.analyses import plot_measured

        values = ", ".join(f"{name} = {number(value, 6)}" for name, value in self.values.items())
        heading = (
            f"fit to {counted(self.measured.count, 'measurement')}: {values}; left over {number(self.deviation, 4)}"
        )
        plot_measured(path, self.execution, self.measured.times, self.measured.columns, self.units, heading)
