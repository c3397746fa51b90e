# pyright: reportUnknownMemberType=false
"""Time against error, log-log: a column for each scene, a line for each method; crosses mark wrong results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.plot.style import FAINT, PALETTE, to_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^vP*hXp<>"
LEAST_ERROR = 1e-16
WORST = 30  # times the largest error of a right result: larger errors are drawn there
ABREAST = 2  # single panels in a row


@dataclass(frozen=True)
class Mark:
    """One run: its error (NaN: unknown), its median seconds, and whether it is right, wrong or failed."""

    error: float
    seconds: float
    verdict: str


@dataclass(frozen=True)
class Line:
    """The runs of one tool and method, in the order of rising effort."""

    label: str
    group: str
    marks: Sequence[Mark]


@dataclass(frozen=True)
class Panel:
    """One scene and one measure of error."""

    title: str
    measure: str
    lines: Sequence[Line]


@to_file
def plot_work_precision(columns: Sequence[Sequence[Panel]]) -> Figure:
    """Draw panels, a column for each scene."""
    labels = list(dict.fromkeys(line.label for column in columns for panel in column for line in panel.lines))
    groups = {line.label: line.group for column in columns for panel in column for line in panel.lines}
    places, down, across = _places(columns)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * across + 2.4, 3.7 * down + 0.3), layout="constrained")
    axes = figure.subplots(down, across, squeeze=False)
    for place, axis in np.ndenumerate(axes):
        if place in places:
            _draw(axis, places[place], labels, groups, ylabel=place[1] == 0)
        else:
            axis.axis("off")
    _legend(figure, labels, groups)
    return figure


def _places(columns: Sequence[Sequence[Panel]]) -> tuple[dict[tuple[int, int], Panel], int, int]:
    """Panels by row and column, and the numbers of rows and columns; single panels go two in a row."""
    if len(columns) > ABREAST and all(len(column) == 1 for column in columns):
        flat = [column[0] for column in columns]
        return {divmod(n, ABREAST): panel for n, panel in enumerate(flat)}, -(-len(flat) // ABREAST), ABREAST
    placed = {(k, i): panel for i, column in enumerate(columns) for k, panel in enumerate(column)}
    return placed, max(len(column) for column in columns), len(columns)


def _look(label: str, labels: Sequence[str], groups: dict[str, str]) -> dict[str, Any]:
    names = list(dict.fromkeys(groups[name] for name in labels))
    inside = [name for name in labels if groups[name] == groups[label]]
    return {
        "color": PALETTE[names.index(groups[label]) % len(PALETTE)],
        "marker": MARKERS[inside.index(label) % len(MARKERS)],
        "markersize": 5,
        "linewidth": 1.3,
    }


def _draw(axis: Axes, panel: Panel, labels: Sequence[str], groups: dict[str, str], ylabel: bool) -> None:
    right_errors = [m.error for line in panel.lines for m in line.marks if m.verdict == "right" and isfinite(m.error)]
    largest = WORST * max([LEAST_ERROR, *right_errors]) if right_errors else inf
    for line in panel.lines:
        look = _look(line.label, labels, groups)
        known = [m for m in line.marks if isfinite(m.error)]
        right = [(max(m.error, LEAST_ERROR), m.seconds) for m in known if m.verdict == "right"]
        wrong = [(min(max(m.error, LEAST_ERROR), largest), m.seconds) for m in known if m.verdict != "right"]
        if right:
            axis.plot(*zip(*right, strict=True), **look)
        if wrong:
            crosses: dict[str, Any] = {**look, "marker": "x", "linestyle": "none"}
            axis.plot(*zip(*wrong, strict=True), **crosses)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.invert_xaxis()
    axis.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.set_xlabel(panel.measure)
    if ylabel:
        axis.set_ylabel("seconds, warm")
    axis.set_title(panel.title, loc="left", parse_math=False, fontsize=9.5)
    silent = [line.label for line in panel.lines if not any(isfinite(m.error) for m in line.marks)]
    if silent:
        text = "no answer: " + ", ".join(silent)
        axis.text(0.02, 0.02, text, transform=axis.transAxes, fontsize=7, color=FAINT, wrap=True)


def _legend(figure: Figure, labels: Sequence[str], groups: dict[str, str]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label=label, **_look(label, labels, groups)) for label in labels]
    handles.append(Line2D([], [], color=FAINT, marker="x", linestyle="none", label="another execution, or no end"))
    figure.legend(handles=handles, loc="outside right upper", frameon=False, fontsize=8)
