# pyright: reportUnknownMemberType=false
"""Pictures of fits: measurements with the run fitted to them, and residuals."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.analysis.plot.curves import curves, limits_of, line
from hsdsl.analysis.plot.style import FAINT, PALETTE, empty, label, legend_below, time_label, to_file
from hsdsl.analysis.report import words
from hsdsl.engine.execution import Array, Execution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_MARKED = 60  # transitions up to which each is marked


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
        axis.plot(*along, color=PALETTE[0], label="run")
        axis.plot(times, column, ".", color=PALETTE[1], markersize=max(3.0, 7.0 - len(times) / 50), label="measured")
        axis.set_ylabel(label(name, units), parse_math=False)
    axes[-1].set_xlabel(time_label(units), parse_math=False)
    figure.suptitle(words.heading(run), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    axes[0].set_title(fill(values, 110), loc="left", fontsize=8.5, color="#555555", parse_math=False)
    legend_below(figure, axes[0].get_legend_handles_labels()[0], 9.0)
    return figure


plot_measured = to_file(measured)


@to_file
def plot_residuals(
    run: Execution, times: Array, columns: Mapping[str, Array], units: Mapping[str, str], heading: str
) -> Figure:
    """Draw residuals over time and how often they occur, a row for each column; dotted lines are transitions."""
    figure = empty(9, 1.3 + 2.2 * len(columns))
    axes = figure.subplots(len(columns), 2, squeeze=False, sharey="row", width_ratios=[4, 1])
    made = np.array([float(each.time) for each in run.transitions])
    made = made[made <= times.max()] if len(made) <= MOST_MARKED else made[:0]
    for (axis, often), (name, column) in zip(axes, columns.items(), strict=True):
        known = column[np.isfinite(column)]
        axis.axhline(0, color=FAINT, linewidth=0.9)
        axis.plot(times, column, ".", color=PALETTE[1], markersize=max(3.0, 7.0 - len(times) / 50))
        for time in made.tolist():
            axis.axvline(time, color=FAINT, linewidth=0.9, linestyle="dotted")
        often.hist(known, bins="auto", orientation="horizontal", color=PALETTE[1])
        often.tick_params(labelleft=False)
        axis.set_ylabel("residual of " + label(name, units), parse_math=False)
    axes[-1, 0].set_xlabel(time_label(units), parse_math=False)
    axes[-1, 1].set_xlabel("measurements")
    figure.suptitle(words.heading(run), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    axes[0, 0].set_title(fill(heading, 90), loc="left", fontsize=8.5, color="#555555", parse_math=False)
    return figure
