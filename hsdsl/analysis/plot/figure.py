# pyright: reportUnknownMemberType=false
"""The figure of one run or of several: its panels, their sizes, headings and legend."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hsdsl.analysis.plot.curves import Curves, GuardLine, curves, modes_of
from hsdsl.analysis.plot.panel import (
    MOST_BANDS,
    MOST_ROWS,
    draw_panel,
    draw_ribbons,
    draw_rows,
    name_bands,
    raise_of,
    rows_of,
    time_label,
)
from hsdsl.analysis.plot.phase import draw_phase
from hsdsl.analysis.plot.style import fills, legend_below, looks
from hsdsl.analysis.plot.view import Pair, View
from hsdsl.analysis.report import words
from hsdsl.base.names import shown
from hsdsl.base.parts import short_names
from hsdsl.engine.execution import Execution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

MARGIN = 0.9  # inches for title and time axis
HEIGHTS = {1: 3.2, 2: 2.3, 3: 1.9, 4: 1.7}  # of a panel, by panels on top of each other
LOWEST = 1.5
WIDTHS = {1: 9.0, 2: 13.0, 3: 16.0}  # of the panels, by panels side by side
RIBBON, LINE = 0.28, 0.2  # inches of a run's ribbon, and of a line of text
SMALLEST, LARGEST = 3.6, 5.2  # of a phase plot
LONGEST = 40  # letters of a name in the legend


@dataclass(frozen=True)
class Plan:
    """The rows and columns of panels and of phase plots, and the inches that they take."""

    across: int
    down: int
    phase_across: int
    phase_down: int
    ribbon: float
    width: float
    phase: float
    height: float

    @classmethod
    def of(cls, names: int, pairs: int, rows: int) -> Plan:
        """Give every panel room to be read; ``rows`` of bars above them show modes."""
        across = 1 if names <= 6 else 2 if names <= 16 else 3
        down = max(1, -(-names // across))
        ribbon = RIBBON * min(rows, MOST_ROWS) + LINE if rows > 1 else 0.0
        height = down * HEIGHTS.get(down, LOWEST) + ribbon
        phase_down = min(pairs, max(1, round(height / LARGEST), ceil(sqrt(pairs))))
        phase_across = -(-pairs // phase_down) if pairs else 0
        phase = min(max(height / phase_down, SMALLEST), LARGEST) if pairs else 0.0
        return cls(
            across, down, phase_across, phase_down, ribbon, WIDTHS[across], phase, max(height, phase * phase_down)
        )

    @property
    def room(self) -> float:
        """The inches of a panel's width."""
        return self.width / self.across - 0.8

    @property
    def size(self) -> tuple[float, float]:
        """The inches of the whole figure."""
        return self.width + self.phase * self.phase_across, self.height + MARGIN


def picture(runs: Sequence[Execution], view: View) -> Figure:
    """Draw runs to a figure of their own."""
    figure = Figure(figsize=size_of(runs, view), layout="constrained")
    draw(runs, view, figure)
    return figure


def size_of(runs: Sequence[Execution], view: View) -> tuple[float, float]:
    """Return the inches that a figure of runs takes."""
    many = len(runs) == 1 and len({arc.mode for arc in runs[0].arcs}) > MOST_BANDS
    rows = _rows([curves(runs[0])]) if many else 0 if len(runs) == 1 else len(runs)
    return Plan.of(len(view.names(runs)), len(view.pairs(runs)), rows).size


def _rows(data: Sequence[Curves]) -> int:
    """How many rows of bars show modes: one for each of several runs; of one run, where it has many modes."""
    if len(data) > 1:
        return len(data)
    return max(2, len(rows_of(data[0]))) if len(data[0].modes) > MOST_BANDS else 0


def draw(runs: Sequence[Execution], view: View, figure: FigureBase) -> list[Axes]:
    """Draw runs to a figure; return the axes: panels over time, then phase plots."""
    names, pairs, labels = view.names(runs), view.pairs(runs), view.called(runs)
    data = [curves(run) for run in runs]
    plan = Plan.of(len(names), len(pairs), _rows(data))
    visited = {arc.mode for run in runs for arc in run.arcs}
    guards = [guard for guard in view.guards if guard.mode in visited]
    widths = [plan.width, plan.phase * plan.phase_across] if pairs else [1]
    outer = figure.add_gridspec(1, len(widths), width_ratios=widths)
    ribbon, panels = _panels(figure, outer[0, 0], plan, max(1, len(names)))
    for name, axis in zip(names, panels, strict=False):
        draw_panel(axis, data, name, [guard for guard in guards if guard.state == name], view, plan.room)
    _time_labels(panels, plan.across, view)
    rows: list[Patch] | None = None
    if ribbon is not None and len(data) == 1:
        rows = draw_rows(ribbon, data[0])
    elif ribbon is not None:
        draw_ribbons(ribbon, data, labels)
    phases = _phases(figure, outer[0, 1], plan, pairs, data, guards, view) if pairs else []
    _headings(figure, ribbon or panels[0], runs, view, plan)
    _legend(figure, panels[0], data, labels, plan, rows)
    if isinstance(figure, Figure):
        figure.align_ylabels(panels)
    return [*panels, *phases]


def _panels(figure: FigureBase, place: Any, plan: Plan, count: int) -> tuple[Axes | None, list[Axes]]:
    """Add the axes of the ribbons, where there are any, and of the panels."""
    ratios = [plan.ribbon, *[(plan.height - plan.ribbon) / plan.down] * plan.down][plan.ribbon == 0 :]
    grid = GridSpecFromSubplotSpec(len(ratios), plan.across, subplot_spec=place, height_ratios=ratios)
    first = len(ratios) - plan.down
    axes: list[Axes] = []
    for i in range(count):
        shared = axes[0] if axes else None
        axes.append(figure.add_subplot(grid[first + i // plan.across, i % plan.across], sharex=shared))
    return (figure.add_subplot(grid[0, :], sharex=axes[0]) if first else None), axes


def _phases(
    figure: FigureBase,
    place: Any,
    plan: Plan,
    pairs: Sequence[Pair],
    data: Sequence[Curves],
    guards: Sequence[GuardLine],
    view: View,
) -> list[Axes]:
    grid = GridSpecFromSubplotSpec(plan.phase_down, plan.phase_across, subplot_spec=place)
    axes = [figure.add_subplot(grid[i % plan.phase_down, i // plan.phase_down]) for i in range(len(pairs))]
    for axis, pair in zip(axes, pairs, strict=True):
        draw_phase(axis, data, pair, guards, view)
    return axes


def _time_labels(axes: Sequence[Axes], across: int, view: View) -> None:
    for i, axis in enumerate(axes):
        if i + across < len(axes):
            axis.tick_params(labelbottom=False)
        else:
            axis.set_xlabel(time_label(view.units), parse_math=False)


def _headings(figure: FigureBase, top: Axes, runs: Sequence[Execution], view: View, plan: Plan) -> None:
    heading = view.title or ", ".join(dict.fromkeys(map(words.heading, runs)))
    heading = textwrap.fill(heading, int(plan.size[0] * 10))
    figure.suptitle(heading, x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    facts = _facts(runs[0]) if len(runs) == 1 else _facts_of_several(runs)
    facts = textwrap.fill(facts, int(plan.width / (plan.across if len(runs) == 1 else 1) * 14))
    pad = 16 + raise_of(top) if plan.ribbon == 0 else 6
    top.set_title(facts, loc="left", fontsize=8.5, color="#555555", pad=pad, parse_math=False)


def _facts(run: Execution) -> str:
    count = len(run.transitions)
    made = f"{run.scheme} {run.method}, {count:,} transition{'' if count == 1 else 's'}"
    if not run.stop.complete:
        return f"{made}, stopped: {words.stop(run)}"
    how = "until" if run.stop.reason == "until" else "final mode entered at"
    return f"{made}, {how} t = {words.number(run.stop.time, 8)}"


def _facts_of_several(runs: Sequence[Execution]) -> str:
    badly = sum(not run.stop.complete for run in runs)
    return f"{len(runs)} runs" + (f", {badly} stopped before the end" if badly else "")


def _legend(
    figure: FigureBase,
    top: Axes,
    data: Sequence[Curves],
    labels: Sequence[str],
    plan: Plan,
    rows_shown: list[Patch] | None,
) -> None:
    """Write names of modes above their bands, or in a legend below everything, where it covers nothing."""
    modes = modes_of(data)
    names = short_names(modes)
    handles: list[Any] = []
    if rows_shown is not None:
        handles = [*rows_shown]
    elif len(data) > 1:
        handles = [
            Line2D([], [], linewidth=1.6, label=shown(label, LONGEST), **look)
            for label, look in zip(labels, looks(len(data)), strict=True)
        ]
        handles += [
            Patch(label=shown(names[mode], LONGEST), **fill) for mode, fill in fills(modes, light=False).items()
        ]
    elif modes and not name_bands(top, data[0], plan.room):
        handles = [Patch(label=shown(names[mode], LONGEST), **fill) for mode, fill in fills(modes).items()]
    rows = legend_below(figure, handles, plan.size[0])
    if isinstance(figure, Figure):
        figure.set_figheight(figure.get_figheight() + rows * LINE)
