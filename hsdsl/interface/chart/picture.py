# pyright: reportUnknownMemberType=false
"""Time against error, log-log: a column for each scene, a line for each method; crosses mark wrong results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.style import FAINT, RUNS, empty, to_file
from hsdsl.interface.chart.rows import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^vP*hXp<>"
LEAST_ERROR = 1e-16
WORST = 30  # times the largest error of a right result: larger errors are drawn there
ABREAST = 2  # single panels in a row
Looks = dict[str, dict[str, Any]]  # by the label of a line
Panel = tuple[str, str, Sequence[Row]]  # the name of a scene, a measure of error, and the runs that have it


def _rho(row: Row) -> float:
    rho = row.judgement.rho
    return rho.upper if rho is not None and rho.upper < 1e300 else nan


MEASURES: dict[str, Callable[[Row], float]] = {
    "largest error of a state": lambda row: row.judgement.error,
    "rho, at most": _rho,
}


@to_file
def plot_work_precision(charted: Sequence[tuple[str, Sequence[Row]]]) -> Figure:
    """Draw the rows of scenes, a column for each: the states' error, and rho where it was computed."""
    columns = [_panels(name, rows) for name, rows in charted]
    groups: dict[tuple[str, str], dict[str, None]] = {}
    for row in [row for _, rows in charted for row in rows]:
        groups.setdefault((row.attempt.tool.name, row.attempt.tool.scheme), {})[row.attempt.tool.label] = None
    looks: Looks = {
        label: {
            "color": RUNS[group % len(RUNS)],
            "marker": MARKERS[method % len(MARKERS)],
            "markersize": 5,
            "linewidth": 1.3,
        }
        for group, labels in enumerate(groups.values())
        for method, label in enumerate(labels)
    }
    places, down, across = _places(columns)
    figure = empty(4.6 * across + 2.4, 3.7 * down + 0.3)
    axes = figure.subplots(down, across, squeeze=False)
    for place, axis in np.ndenumerate(axes):
        if place in places:
            _draw(axis, places[place], looks, ylabel=place[1] == 0)
        else:
            axis.axis("off")
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label=label, **look) for label, look in looks.items()]
    handles.append(Line2D([], [], color=FAINT, marker="x", linestyle="none", label="another execution, or no end"))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8)
    return figure


def _panels(name: str, rows: Sequence[Row]) -> list[Panel]:
    error, rho = MEASURES
    measured = [row for row in rows if row.judgement.rho is not None]
    return [(name, error, rows), *([(name, rho, measured)] if measured else [])]


def _places(columns: Sequence[Sequence[Panel]]) -> tuple[dict[tuple[int, int], Panel], int, int]:
    """Panels by row and column, and the numbers of rows and columns; single panels go two in a row."""
    if len(columns) > ABREAST and all(len(column) == 1 for column in columns):
        flat = [column[0] for column in columns]
        return {divmod(n, ABREAST): panel for n, panel in enumerate(flat)}, -(-len(flat) // ABREAST), ABREAST
    placed = {(k, i): panel for i, column in enumerate(columns) for k, panel in enumerate(column)}
    return placed, max(len(column) for column in columns), len(columns)


def _draw(axis: Axes, panel: Panel, looks: Looks, ylabel: bool) -> None:
    title, measure, rows = panel
    errors = [(row, MEASURES[measure](row)) for row in rows]
    known = [(row, error) for row, error in errors if isfinite(error)]
    right_errors = [error for row, error in known if row.judgement.verdict == "right"]
    largest = WORST * max([LEAST_ERROR, *right_errors]) if right_errors else inf
    labels = dict.fromkeys(row.attempt.tool.label for row in rows)
    for label in labels:
        own = [(row, max(error, LEAST_ERROR)) for row, error in known if row.attempt.tool.label == label]
        right = [(error, row.seconds) for row, error in own if row.judgement.verdict == "right"]
        wrong = [(min(error, largest), row.seconds) for row, error in own if row.judgement.verdict != "right"]
        if right:
            axis.plot(*zip(*right, strict=True), **looks[label])
        if wrong:
            crosses: dict[str, Any] = {**looks[label], "marker": "x", "linestyle": "none"}
            axis.plot(*zip(*wrong, strict=True), **crosses)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.invert_xaxis()
    axis.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.set_xlabel(measure)
    if ylabel:
        axis.set_ylabel("seconds, warm")
    axis.set_title(title, loc="left", parse_math=False, fontsize=10, fontweight="bold")
    silent = [label for label in labels if label not in {row.attempt.tool.label for row, _ in known}]
    if silent:
        text = "no answer: " + ", ".join(silent)
        axis.text(0.02, 0.02, text, transform=axis.transAxes, fontsize=7, color=FAINT, wrap=True)
