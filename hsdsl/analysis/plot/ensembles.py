# pyright: reportUnknownMemberType=false
"""Pictures of ensembles, as medians with bands of samples over time, and of fits, with measurements and residuals."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hsdsl.analysis.plot.curves import checked, curves, limits_of, line
from hsdsl.analysis.plot.style import FAINT, RUNS, empty, heading, label, legend_below, time_label, to_file
from hsdsl.analysis.report import words
from hsdsl.base.errors import UsageError
from hsdsl.base.names import called, counted
from hsdsl.base.numbers.arithmetic import TIE
from hsdsl.engine.execution import Array, Ensemble, Execution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_MARKED = 60  # transitions up to which each is marked


class Spread(NamedTuple):
    """Quantiles of a column at each time: the median, and by share the two that hold it, the widest first."""

    median: Array
    bands: dict[float, tuple[Array, Array]]

    @classmethod
    def of(cls, values: Array, shares: Sequence[float]) -> Spread:
        """The quantiles over the first axis of those runs that have a number; not-a-number where none has."""
        known = ~np.isnan(values).all(axis=0)

        def quantile(q: float) -> Array:
            found = np.full(values.shape[1], np.nan)
            found[known] = np.nanquantile(values[:, known], q, axis=0)
            return found

        bands = {p: (quantile((1 - p) / 2), quantile((1 + p) / 2)) for p in sorted(shares, reverse=True)}
        return cls(quantile(0.5), bands)


def ensemble_plot(
    ensemble: Ensemble, path: str | os.PathLike[str], columns: Sequence[str] | None, shares: Sequence[float]
) -> None:
    """Draw the samples of an ensemble; see `Ensemble.plot`."""
    if not ensemble.samples:
        raise UsageError("the ensemble has no samples", "give samples=300 to `ensemble`")
    if wrong := [share for share in shares if not 0 < share < 1]:
        raise UsageError(f"expected shares between 0 and 1, got {wrong[0]:g}")
    names = [checked(name, [*ensemble.samples]) for name in (ensemble.samples if columns is None else columns)]
    times = ensemble.sample_times.reshape(ensemble.stop.size, -1)
    known = ~np.isnan(times).all(axis=0)
    latest, earliest = np.nanmax(times[:, known], axis=0), np.nanmin(times[:, known], axis=0)
    if np.any(latest - earliest > TIE * np.abs(latest)):
        raise UsageError("the sample times of the instances differ", "give samples= as a list of times")
    tables = {name: ensemble.samples[name].reshape(len(times), -1)[:, known].astype(float) for name in names}
    title = f"{called(ensemble.title, ensemble.model)}: {counted(len(times), 'run')}"
    if failed := int(ensemble.failed.sum()):
        title += f", {failed:,} of which did not reach the end"
    spreads = {label(name, ensemble.units): Spread.of(table, shares) for name, table in tables.items()}
    who = "the runs that have it" if any(np.isnan(table).any() for table in tables.values()) else "the runs"
    _draw(path, latest, spreads, title, time_label(ensemble.units), who)


@to_file
def _draw(times: Array, spreads: dict[str, Spread], title: str, time: str, who: str) -> Figure:
    figure = empty(9, 1.3 + 2.4 * len(spreads))
    axes = figure.subplots(len(spreads), 1, squeeze=False, sharex=True)[:, 0]
    for axis, (name, spread) in zip(axes, spreads.items(), strict=True):
        for k, (share, (low, high)) in enumerate(spread.bands.items()):
            alpha = 0.2 + 0.25 * k / max(1, len(spread.bands) - 1)
            held = f"{100 * share:.3g} % of {who}"
            axis.fill_between(times, low, high, color=RUNS[0], alpha=alpha, linewidth=0, label=held)
        axis.plot(times, spread.median, color=RUNS[0], linewidth=1.4, label="median")
        axis.set_ylabel(name, parse_math=False)
        axis.margins(x=0)
    axes[-1].set_xlabel(time, parse_math=False)
    heading(figure, title)
    legend_below(figure, axes[0].get_legend_handles_labels()[0], 9.0)
    return figure


def measured(
    run: Execution, times: Array, columns: Mapping[str, Array], units: Mapping[str, str], values: str = ""
) -> Figure:
    """Draw measurements and the run fitted to them, a panel for each column; ``values`` are what was fitted."""
    figure = empty(9, 1.3 + 2.4 * len(columns))
    axes = figure.subplots(len(columns), 1, squeeze=False, sharex=True)[:, 0]
    drawn = curves(run)
    for axis, (name, column) in zip(axes, columns.items(), strict=True):
        low, high = limits_of([drawn], name)
        along = line(drawn.samples.time, drawn.column(name), drawn.begins, (*drawn.span, low, high))
        axis.plot(*along, color=RUNS[0], label="run")
        axis.plot(times, column, ".", color=RUNS[1], markersize=max(3.0, 7.0 - len(times) / 50), label="measured")
        axis.set_ylabel(label(name, units), parse_math=False)
    axes[-1].set_xlabel(time_label(units), parse_math=False)
    heading(figure, words.heading(run), values, axes[0])
    legend_below(figure, axes[0].get_legend_handles_labels()[0], 9.0)
    return figure


plot_measured = to_file(measured)


@to_file
def plot_residuals(
    run: Execution, times: Array, columns: Mapping[str, Array], units: Mapping[str, str], facts: str
) -> Figure:
    """Draw residuals over time and how often they occur, a row for each column; dotted lines are transitions."""
    figure = empty(9, 1.3 + 2.2 * len(columns))
    axes = figure.subplots(len(columns), 2, squeeze=False, sharey="row", width_ratios=[4, 1])
    made = np.array([float(each.time) for each in run.transitions])
    made = made[made <= times.max()] if len(made) <= MOST_MARKED else made[:0]
    for (axis, often), (name, column) in zip(axes, columns.items(), strict=True):
        known = column[np.isfinite(column)]
        axis.axhline(0, color=FAINT, linewidth=0.9)
        axis.plot(times, column, ".", color=RUNS[1], markersize=max(3.0, 7.0 - len(times) / 50))
        for time in made.tolist():
            axis.axvline(time, color=FAINT, linewidth=0.9, linestyle="dotted")
        often.hist(known, bins="auto", orientation="horizontal", color=RUNS[1], edgecolor="white")
        often.tick_params(labelleft=False)
        axis.set_ylabel("residual of " + label(name, units), parse_math=False)
    axes[-1, 0].set_xlabel(time_label(units), parse_math=False)
    axes[-1, 1].set_xlabel("measurements")
    heading(figure, words.heading(run), facts, axes[0, 0])
    return figure
