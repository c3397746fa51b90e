# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 14a: a mass on a spring and a damper, driven by a force, before a stop."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from hsdsl.analysis.plot.style import ALARM, INK, band, colours
from paper.drawing.body import spring


def draw() -> Figure:
    """Draw the mechanism."""
    figure = Figure(figsize=(6.0, 2.7), layout="constrained")
    axis = figure.subplots()
    axis.fill_between([-0.12, 0], 0, 1.3, facecolor="#f3f3f3", hatch="////", edgecolor="#b8b8b8", linewidth=0)
    axis.plot([0, 0], [0, 1.3], color="#555555", linewidth=1.2)
    axis.fill_between([0, 4.6], -0.12, 0, facecolor="#f3f3f3", hatch="////", edgecolor="#b8b8b8", linewidth=0)
    axis.plot([0, 4.6], [0, 0], color="#555555", linewidth=1.2)
    coil = spring((0, 0.85), (1.7, 0.85), 0.11)
    axis.plot(coil[:, 0], coil[:, 1], color=INK, linewidth=1.2)
    axis.text(0.85, 1.03, "$k$", ha="center", va="bottom", fontsize=11)
    axis.plot([0, 0.72], [0.35, 0.35], color=INK, linewidth=1.2)
    axis.plot([1.1, 0.72, 0.72, 1.1], [0.47, 0.47, 0.23, 0.23], color=INK, linewidth=1.2)
    axis.plot([0.95, 0.95], [0.28, 0.42], color=INK, linewidth=1.6)
    axis.plot([0.95, 1.7], [0.35, 0.35], color=INK, linewidth=1.2)
    axis.text(0.9, 0.53, r"$\mu$", ha="center", va="bottom", fontsize=11)
    colour = next(iter(colours(["mass"]).values()))
    axis.add_patch(Rectangle((1.7, 0.08), 0.95, 1.0, facecolor=band(colour), edgecolor=INK, linewidth=1.3))
    axis.text(2.175, 0.58, "$m$", ha="center", va="center", fontsize=13)
    axis.annotate("", (3.4, 0.58), (2.65, 0.58), arrowprops={"arrowstyle": "-|>", "color": INK})
    axis.text(3.05, 0.64, "$u(t)$", ha="center", va="bottom", fontsize=11)
    axis.fill_between([4.1, 4.6], 0, 1.3, facecolor=band(ALARM), hatch="////", edgecolor=ALARM, linewidth=0)
    axis.plot([4.1, 4.1], [0, 1.3], color=ALARM, linewidth=1.6)
    axis.plot([2.65, 2.65], [1.12, 1.62], color="#888888", linewidth=0.8)
    axis.annotate("", (3.2, 1.5), (2.65, 1.5), arrowprops={"arrowstyle": "->", "color": INK})
    axis.text(3.25, 1.5, "$x$", va="center", fontsize=11)
    axis.text(4.1, 1.4, "stop at $x_{max}$", ha="center", va="bottom", fontsize=10, color=ALARM)
    axis.set(xlim=(-0.15, 4.75), ylim=(-0.15, 1.75), aspect="equal")
    axis.set_axis_off()
    return figure
