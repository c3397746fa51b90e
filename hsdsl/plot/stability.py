# pyright: reportUnknownMemberType=false
"""Outcomes over a plane, a panel for each tool: colours tell what came, shades how near converged runs are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.plot.style import to_file

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
LIMIT = "#f0e442"
PALEST = 0.75  # how much white is in the colour of the least accurate converged run


@dataclass(frozen=True)
class Scale:
    """An axis: its name, its values, and whether they are spaced logarithmically."""

    name: str
    values: Sequence[float]
    logarithmic: bool

    @property
    def edges(self) -> Any:
        """Where cells begin and end, one more than values."""
        at = np.log10(self.values) if self.logarithmic else np.array(self.values, dtype=float)
        middle = (at[1:] + at[:-1]) / 2
        edges = np.concatenate([[at[0] - (middle[0] - at[0])], middle, [at[-1] + (at[-1] - middle[-1])]])
        return 10.0**edges if self.logarithmic else edges


@dataclass(frozen=True)
class Panel:
    """A tool's words, shades (logarithms; None: none) and limits, ``words[j][i]`` at value j of y and i of x."""

    title: str
    words: Sequence[Sequence[str]]
    shades: Sequence[Sequence[float | None]]
    limit: Sequence[float | None] | None


@to_file
def plot_stability(name: str, x: Scale, y: Scale, panels: Sequence[Panel], shaded: str = "rho") -> Figure:
    """Draw the panels to a .png or .svg file; ``shaded`` says what the shades are of."""
    from matplotlib.figure import Figure

    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(max(4.2, 3.3 * columns + 0.4), 2.9 * rows + 0.9), layout="constrained")
    shades = [s for panel in panels for row in panel.shades for s in row if s is not None]
    span = (min(shades), max(shades)) if shades else (0.0, 1.0)
    grid: Any = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, panel in zip(grid.flat, panels, strict=False):
        _draw(axes, panel, x, y, span)
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for axes in grid[-1]:
        axes.set_xlabel(x.name)
    for axes in grid[:, 0]:
        axes.set_ylabel(y.name)
    figure.suptitle(name, fontsize=10)
    limited = any(_has_limit(panel, x) for panel in panels)
    _legend(
        figure,
        panels,
        limited,
        columns + (columns > 2),
        f"{shaded} 1e{span[0]:.0f} (dark) to 1e{span[1]:.0f} (pale)" if shades else "",
    )
    return figure


def _draw(axes: Axes, panel: Panel, x: Scale, y: Scale, span: tuple[float, float]) -> None:
    colours = [
        [_shaded(word, shade, span) for word, shade in zip(words, shades, strict=True)]
        for words, shades in zip(panel.words, panel.shades, strict=True)
    ]
    axes.pcolormesh(x.edges, y.edges, np.array(colours), rasterized=True)
    if x.logarithmic:
        axes.set_xscale("log")
    if y.logarithmic:
        axes.set_yscale("log")
    axes.set_title(panel.title, fontsize=9)
    if _has_limit(panel, x):
        known = [(h, value) for h, value in zip(panel.limit or (), y.values, strict=True) if h]
        axes.plot(*zip(*known, strict=True), color=LIMIT, linewidth=2.2)
    axes.set_xlim(x.edges[0], x.edges[-1])
    axes.set_ylim(y.edges[0], y.edges[-1])


def _has_limit(panel: Panel, x: Scale) -> bool:
    """Whether its limit lies in the picture."""
    return any(h is not None and x.edges[0] <= h <= x.edges[-1] for h in panel.limit or ())


def _shaded(word: str, shade: float | None, span: tuple[float, float]) -> tuple[float, ...]:
    from matplotlib.colors import to_rgb

    colour = np.array(to_rgb(COLOURS[word]))
    if shade is None and word == "converged":
        shade = (span[0] + span[1]) / 2  # by how much is not known
    if shade is None:
        return tuple(colour)
    white = PALEST * (shade - span[0]) / (span[1] - span[0] or 1.0)
    return tuple(colour * (1 - white) + white)


def _legend(figure: Figure, panels: Sequence[Panel], limited: bool, columns: int, shades: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    present = {word for panel in panels for row in panel.words for word in row}
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor="#888888", label=word) for word, colour in COLOURS.items() if word in present
    ]
    if shades and handles:
        handles[0].set_label(f"converged, {shades}")
    if limited:
        handles.append(Line2D([], [], color=LIMIT, linewidth=2.2, label="limit of linear stability"))
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=8)
