# pyright: reportUnknownMemberType=false
"""Pictures of sweeps: a curve over one name, a map or points over two, a bifurcation diagram, curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.style import FAINT, PALETTE, curve, to_file, whole_ticks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_WORDS = 20  # of which each has a colour
MARGIN = 0.01  # beside the first and the last column of dots
DOT = 40_000  # dots from which on they are small and pale


@dataclass(frozen=True)
class Axis:
    """A varied name, the label with its unit, its value in each row, and its grid where it has one."""

    label: str
    values: Any
    grid: Sequence[float] | None
    logarithmic: bool


@dataclass(frozen=True)
class Quantity:
    """A column: its label, and its value in each row, a number or a word; None where there is none."""

    label: str
    values: Any

    @property
    def words(self) -> list[str]:
        """The different words; none where it has numbers."""
        return [] if self.values.dtype != object else sorted({str(v) for v in self.values if v is not None})


@to_file
def plot_curve(x: Axis, of: Quantity, title: str) -> Figure:
    """Draw a number over a name, in the order of the name; words as dots on lines of their own."""
    figure, axes = _empty()
    order = np.argsort(x.values, kind="stable")
    if of.words:
        numbers = [of.words.index(str(v)) if v is not None else np.nan for v in of.values[order]]
        axes.plot(x.values[order], numbers, ".", color=curve(PALETTE[5]))
        axes.set_yticks(range(len(of.words)), of.words, parse_math=False)
    else:
        line = "-" if x.grid is not None and len(x.grid) == len(x.values) else "."
        axes.plot(x.values[order], of.values[order], line, color=curve(PALETTE[5]), linewidth=1.2, markersize=2)
        whole_ticks(axes.yaxis, of.values)
    axes.set_ylabel(of.label, parse_math=False)
    return _labelled(figure, axes, x, title)


@to_file
def plot_dots(x: Axis, of: Quantity, where: Any, title: str) -> Figure:
    """Draw every number of rows with lists; ``where`` has the row of each."""
    (figure, axes), many = _empty(), len(of.values) > DOT
    size, alpha = (0.4, 0.35) if many else (1.2, 0.8)
    dots: dict[str, Any] = {"markersize": size, "alpha": alpha, "markeredgewidth": 0, "rasterized": True}
    axes.plot(x.values[where], of.values, "o", color=curve(PALETTE[5]), **dots)
    axes.set_ylabel(of.label, parse_math=False)
    whole_ticks(axes.yaxis, of.values)
    axes.margins(x=MARGIN)
    return _labelled(figure, axes, x, title)


@to_file
def plot_family(curves: Sequence[tuple[Any, Any]], by: Axis, label: str, title: str) -> Figure:
    """Draw a curve (times, values) for each row, in colours that rise with a name."""
    from matplotlib.collections import LineCollection

    figure, axes = _empty()
    known = by.values[np.isfinite(by.values)]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    lines = LineCollection([np.column_stack(each) for each in curves], cmap="viridis", linewidths=0.9)
    lines.set(array=by.values, norm="log" if by.logarithmic else None, clim=(low, high), rasterized=True)
    axes.add_collection(lines)
    axes.autoscale_view()
    figure.colorbar(lines, ax=axes).set_label(by.label, parse_math=False)
    axes.set_ylabel(label, parse_math=False)
    return _labelled(figure, axes, Axis("time t", None, None, False), title)


@to_file
def plot_map(x: Axis, y: Axis, of: Quantity, title: str) -> Figure:
    """Draw a number or a word over two names: cells where both have grids, else dots; grey where there is none."""
    figure, axes = _empty()
    axes.set_facecolor("#dddddd")
    shades: dict[str, Any] = {"cmap": "viridis"}
    values = of.values
    if of.words:
        values, shades = _by_words(of)
    if x.grid is None or y.grid is None:
        drawn: Any = axes.scatter(x.values, y.values, c=values, s=6, linewidths=0, **shades)
    else:
        drawn = axes.pcolormesh(*_cells(x, y, values), rasterized=True, **shades)
    _legend(figure, axes, drawn, of)
    axes.set_ylabel(y.label, parse_math=False)
    if y.logarithmic:
        axes.set_yscale("log")
    return _labelled(figure, axes, x, title)


def _empty() -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    return figure, figure.subplots()


def _labelled(figure: Figure, axes: Axes, x: Axis, title: str) -> Figure:
    if x.logarithmic:
        axes.set_xscale("log")
    axes.set_xlabel(x.label, parse_math=False)
    axes.set_title(title, loc="left", fontsize=10, parse_math=False)
    return figure


def _by_words(of: Quantity) -> tuple[Any, dict[str, Any]]:
    """Words as numbers, and their colours."""
    from matplotlib.colors import BoundaryNorm, ListedColormap

    words = of.words[:MOST_WORDS]
    numbers = np.array([words.index(v) if v in words else np.nan for v in of.values], dtype=float)
    colours = ListedColormap([PALETTE[i % len(PALETTE)] for i in range(len(words))])
    return numbers, {"cmap": colours, "norm": BoundaryNorm(np.arange(len(words) + 1) - 0.5, max(1, len(words)))}


def _cells(x: Axis, y: Axis, values: Any) -> tuple[Any, Any, Any]:
    """The edges of cells and the value in each; of several rows in a cell the last counts."""
    across, up = np.unique(x.values), np.unique(y.values)
    cells = np.full((len(up), len(across)), np.nan)
    cells[np.searchsorted(up, y.values), np.searchsorted(across, x.values)] = values
    return edges(across, x.logarithmic), edges(up, y.logarithmic), cells


def edges(values: Any, logarithmic: bool) -> Any:
    """Where the cells around rising values begin and end, one more than values."""
    at = np.log10(values) if logarithmic else np.asarray(values, dtype=float)
    if len(at) == 1:
        at = np.array([at[0] - 0.5, at[0] + 0.5])
        return 10.0**at if logarithmic else at
    middle = (at[1:] + at[:-1]) / 2
    found = np.concatenate([[2 * at[0] - middle[0]], middle, [2 * at[-1] - middle[-1]]])
    return 10.0**found if logarithmic else found


def _legend(figure: Figure, axes: Axes, drawn: Any, of: Quantity) -> None:
    if not of.words:
        bar = figure.colorbar(drawn, ax=axes)
        bar.set_label(of.label, parse_math=False)
        whole_ticks(bar.ax.yaxis, of.values)
        return
    from matplotlib.patches import Patch

    handles = [Patch(color=PALETTE[i % len(PALETTE)], label=word) for i, word in enumerate(of.words[:MOST_WORDS])]
    handles += [Patch(color="#dddddd", label="other")] if len(of.words) > MOST_WORDS else []
    legend = figure.legend(handles=handles, title=of.label, loc="outside right upper", frameon=False, edgecolor=FAINT)
    for text in legend.get_texts():
        text.set_parse_math(False)
