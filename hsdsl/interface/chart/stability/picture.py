# pyright: reportUnknownMemberType=false
"""Outcomes over a plane, a panel for each tool: colours tell what came, shades how near converged runs are."""

from __future__ import annotations

from math import isfinite, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.analyses import edges
from hsdsl.analysis.plot.style import heading, to_file
from hsdsl.interface.chart.stability import Axis, Panel, StabilityMap
from hsdsl.interface.chart.stability.cells import CONVERGED, UNKNOWN, Cell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS: dict[str, str] = {
    "converged": "#0072b2",
    "inaccurate": "#e69f00",
    "wrong transitions": "#d55e00",
    "blown up": "#000000",
    "stuck": "#cc79a7",
    "refused": "#bbbbbb",
    "no reference": "#ffffff",
}
HATCH, HATCHED = "////", "#999999"  # of what has no reference: white alone is the paper's
LIMIT = "#f0e442"
PALEST = 0.75  # how much white is in the colour of the least accurate converged run


@to_file
def plot_stability(found: StabilityMap) -> Figure:
    """Draw a map to a .png or .svg file: shades are of rho where most converged runs have it, else of the error."""
    from matplotlib.figure import Figure

    panels = found.panels
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(max(4.2, 3.3 * columns + 0.4), 2.9 * rows + 0.9), layout="constrained")
    cells = [cell for panel in found.panels for row in panel.cells for cell in row if cell.word == CONVERGED]
    measure = "rho" if 2 * sum(isfinite(cell.rho) for cell in cells) > len(cells) else "error"
    shades = [s for panel in panels for row in panel.cells for cell in row if (s := _shade(cell, measure)) is not None]
    span = (min(shades), max(shades)) if shades else (0.0, 1.0)
    grid: Any = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, panel in zip(grid.flat, panels, strict=False):
        _draw(axes, found, panel, measure, span)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes in list(grid.flat[: len(panels)])[-columns:]:  # the lowest of each column
        axes.xaxis.set_tick_params(labelbottom=True)
        axes.set_xlabel(found.x.label, parse_math=False)
    for axes in grid[:, 0]:
        axes.set_ylabel(found.y.label, parse_math=False)
    heading(figure, found.name)
    shown = f"{measure} 1e{span[0]:.0f} (dark) to 1e{span[1]:.0f} (pale)" if shades else ""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    present = {cell.word for panel in found.panels for row in panel.cells for cell in row}
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor="#888888", label=word, hatch=HATCH if word == UNKNOWN else None)
        for word, colour in COLOURS.items()
        if word in present
    ]
    if shown and handles:
        handles[0].set_label(f"converged, {shown}")
    if any(_has_limit(panel, found.x) for panel in found.panels):
        handles.append(Line2D([], [], color=LIMIT, linewidth=2.2, label="limit of linear stability"))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns + (columns > 2), frameon=False, fontsize=8)
    return figure


def _shade(cell: Cell, measure: str) -> float | None:
    """The logarithm of a measure of a converged run; None of any other."""
    size = getattr(cell, measure)
    return log10(max(size, 1e-15)) if cell.word == CONVERGED and isfinite(size) else None


def _draw(axes: Axes, found: StabilityMap, panel: Panel, measure: str, span: tuple[float, float]) -> None:
    from matplotlib.collections import PolyCollection

    x, y = found.x, found.y
    across, up = (edges(axis.values, axis.logarithmic) for axis in (x, y))
    colours = [[_shaded(cell.word, _shade(cell, measure), span) for cell in row] for row in panel.cells]
    axes.pcolormesh(across, up, np.array(colours), rasterized=True)
    unknown = [(i, j) for j, row in enumerate(panel.cells) for i, cell in enumerate(row) if cell.word == UNKNOWN]
    boxes = [[(across[i + a], up[j + b]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))] for i, j in unknown]
    axes.add_collection(PolyCollection(boxes, facecolor="none", edgecolor=HATCHED, hatch=HATCH, linewidth=0))
    if x.logarithmic:
        axes.set_xscale("log")
    if y.logarithmic:
        axes.set_yscale("log")
    axes.set_title(panel.tool.label, fontsize=9)
    if _has_limit(panel, x):
        known = [(h, value) for h, value in zip(panel.limit or (), y.values, strict=True) if h]
        axes.plot(*zip(*known, strict=True), color=LIMIT, linewidth=2.2)
    axes.set_xlim(across[0], across[-1])
    axes.set_ylim(up[0], up[-1])


def _has_limit(panel: Panel, x: Axis) -> bool:
    """Whether its limit lies in the picture."""
    across = edges(x.values, x.logarithmic)
    return any(h is not None and across[0] <= h <= across[-1] for h in panel.limit or ())


def _shaded(word: str, shade: float | None, span: tuple[float, float]) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    colour = np.array(to_rgb(COLOURS[word]))
    if shade is None and word == CONVERGED:
        shade = (span[0] + span[1]) / 2  # by how much is not known
    if shade is None:
        return tuple(colour)
    white = PALEST * (shade - span[0]) / (span[1] - span[0] or 1.0)
    return tuple(colour * (1 - white) + white)
