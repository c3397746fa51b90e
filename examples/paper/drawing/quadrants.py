# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 1 and Sec. V-A: three executions in the plane, and their distances against delta."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from hsdsl.analysis.plot.style import INK, band, colours
from hsdsl.engine.execution import Execution
from paper.drawing.axes import MARKERS, letter, loglog, order, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 1.4
CORNERS = {"D0": (-SIZE, -SIZE), "D1": (-SIZE, 0), "D2": (0, -SIZE), "D3": (0, 0)}  # lower left ones
RIVALS = {"sup": "sup-norm", "skorokhod": "Skorokhod", "tau-epsilon": r"$(\tau, \varepsilon)$-closeness"}


def draw(runs: Mapping[str, Execution], rows: Sequence[tuple[Any, ...]]) -> Figure:
    """Draw both panels; ``rows`` as `paper.quadrants` measures them."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    plane, chart = figure.subplots(1, 2, width_ratios=[1, 1.25])
    draw_plane(plane, runs)
    draw_chart(chart, rows)
    return figure


def draw_plane(axis: Axes, runs: Mapping[str, Execution]) -> None:
    """Draw the quadrants, the field in each, and the executions through them."""
    for mode, colour in colours(list(CORNERS)).items():
        x, y = CORNERS[mode]
        axis.fill_between([x, x + SIZE], y, y + SIZE, color=band(colour), linewidth=0)
        axis.text(1.25 if x == 0 else -1.25, 1.25 if y == 0 else -1.25, f"$D_{mode[1]}$", fontsize=10, ha="center",
                  va="center")  # fmt: skip
    names = {"x": "$x$", "y": r"$y_\delta$", "z": r"$z_\delta$"}
    for (name, run), colour in zip(runs.items(), shades(["a", "b", "c"]).values(), strict=True):
        points = run.sample(np.unique(run.times))
        shade = INK if name == "x" else colour
        axis.plot(points["x"], points["y"], color=shade, linewidth=1.7, label=names[name])
        axis.plot(points["x"][0], points["y"][0], "o", color=shade, markersize=4)
        axis.plot(points["x"][-1], points["y"][-1], marker=(3, 0, -45), color=shade, markersize=8, linestyle="")
    axis.axhline(0, color="#555555", linewidth=0.9)
    axis.axvline(0, color="#555555", linewidth=0.9)
    axis.set(xlim=(-SIZE, SIZE), ylim=(-SIZE, SIZE), xlabel=r"$\xi_1$", ylabel=r"$\xi_2$", aspect="equal")
    axis.legend(loc=(0.76, 0.2), frameon=False)
    letter(axis, r"Three executions, $\delta = 1/4$, until $t = 2$")


def draw_chart(axis: Axes, rows: Sequence[tuple[Any, ...]]) -> None:
    """Draw distances against delta: ours as lines through exact executions, relaxed ones as crosses."""
    loglog(axis, r"$\delta$", "distance")
    pairs = {"x y": r"$\rho(x, y_\delta)$", "x z": r"$\rho(x, z_\delta)$", "y z": r"$\rho(y_\delta, z_\delta)$"}
    palette = shades([*pairs, *RIVALS])
    for marker, (pair, label) in zip(MARKERS, pairs.items(), strict=False):
        for kind, style in (("exact", "-"), ("relaxed", "")):
            delta, value = _column(rows, kind, pair, "rho")
            shape = marker if kind == "exact" else "x"
            axis.plot(delta, value, style, marker=shape, markersize=4.5 if kind == "exact" else 6, color=palette[pair],
                      label=label if kind == "exact" else None, markerfacecolor="white")  # fmt: skip
    for marker, size, (metric, label) in zip(MARKERS, (9, 6, 3.5), RIVALS.items(), strict=False):
        delta, value = _column(rows, "exact", "y z", metric)
        axis.plot(delta, value, "--", marker=marker, markersize=size, color=palette[metric],
                  label=rf"{label} of $y_\delta, z_\delta$")  # fmt: skip
    axis.plot([], [], "x", color="#555555", label="the same, relaxed scheme")
    axis.set_ylim(3e-7, 30)
    order(axis, 4e-6, 3e-4, 1)
    axis.legend(frameon=False, fontsize=8, loc="lower right")
    letter(axis, r"The space's own metric against three on trajectories")


def _column(rows: Sequence[tuple[Any, ...]], kind: str, pair: str, metric: str) -> tuple[list[float], list[float]]:
    chosen = [row for row in rows if (row[0], row[2], row[3]) == (kind, pair, metric)]
    return [row[1] for row in chosen], [row[5] for row in chosen]
