# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""The figure of a run: its panels, their sizes and headings."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec
from matplotlib.patches import Patch

from hsdsl.execution import Execution
from hsdsl.plot.curves import Curves, GuardLine, curves
from hsdsl.plot.panel import draw_panel, name_bands
from hsdsl.plot.phase import draw_phase, has_phase
from hsdsl.plot.style import band, colours
from hsdsl.report import words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN = 0.9  # inches for title and time axis
HEIGHTS = {1: 3.2, 2: 2.3, 3: 1.9, 4: 1.7}  # of a panel, by panels on top of each other
LOWEST = 1.5


def draw(execution: Execution, *, guards: Sequence[GuardLine], units: Mapping[str, str], title: str | None) -> Figure:
    """Draw the whole figure."""
    data = curves(execution)
    names = data.samples.names
    across = 1 if len(names) <= 6 else 2 if len(names) <= 16 else 3
    down = max(1, -(-len(names) // across))
    height = MARGIN + down * HEIGHTS.get(down, LOWEST)
    phase = has_phase(execution)
    width = {1: 9.0, 2: 13.0, 3: 16.0}[across]
    phase_width = min(max(height - MARGIN, 3.6), 5.2) if phase else 0.0
    figure = Figure(figsize=(width + phase_width, max(height, phase_width + MARGIN)), layout="constrained")
    outer = figure.add_gridspec(1, 2 if phase else 1, width_ratios=[width, phase_width] if phase else [1])
    inner = GridSpecFromSubplotSpec(down, across, subplot_spec=outer[0, 0])
    axes = _panels(figure, inner, names, across)
    visited = {arc.mode for arc in execution.arcs}
    lines = [guard for guard in guards if guard.mode in visited]
    ends_badly = not execution.stop.complete
    for name, axis in zip(names, axes, strict=False):
        draw_panel(axis, data, name, [g for g in lines if g.state == name], units, ends_badly)
    _time_labels(axes, across, units)
    if phase:
        draw_phase(figure.add_subplot(outer[0, 1]), data, lines, units, ends_badly)
    _headings(figure, axes[0], execution, data, title, width / across)
    figure.align_ylabels(axes)
    return figure


def _panels(figure: Figure, grid: GridSpecFromSubplotSpec, names: Sequence[str], across: int) -> list[Axes]:
    axes: list[Axes] = []
    for i in range(max(1, len(names))):
        shared = axes[0] if axes else None
        axes.append(figure.add_subplot(grid[i // across, i % across], sharex=shared))
    return axes


def _time_labels(axes: Sequence[Axes], across: int, units: Mapping[str, str]) -> None:
    for i, axis in enumerate(axes):
        if i + across < len(axes):
            axis.tick_params(labelbottom=False)
        else:
            axis.set_xlabel(f"time t [{units['t']}]" if "t" in units else "time t", parse_math=False)


def _headings(figure: Figure, top: Axes, execution: Execution, data: Curves, title: str | None, width: float) -> None:
    figure.suptitle(
        title or words.heading(execution), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False
    )
    count = len(execution.transitions)
    facts = f"{execution.scheme} {execution.method}, {count:,} transition{'' if count == 1 else 's'}, "
    if execution.stop.complete:
        how = "until" if execution.stop.reason == "until" else "final mode entered at"
        facts += f"{how} t = {words.number(execution.stop.time, 8)}"
    else:
        facts += f"stopped: {words.stop(execution)}"
    top.set_title(
        textwrap.fill(facts, int(width * 14)), loc="left", fontsize=8.5, color="#555555", pad=16, parse_math=False
    )
    if len(data.modes) == 0 or name_bands(top, data, width - 0.8):
        return
    patches = [
        Patch(facecolor=band(colour, len(data.modes) == 1), label=mode) for mode, colour in colours(data.modes).items()
    ]
    legend = figure.legend(
        handles=patches, loc="outside upper right", ncols=min(8, len(patches)), frameon=False, fontsize=8.5
    )
    for text in legend.get_texts():
        text.set_parse_math(False)
