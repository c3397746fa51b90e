# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 17: both strides, as the runner at every transition."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hsdsl.analysis.plot.style import INK
from paper.drawing.axes import letter
from paper.drawing.body import draw_ground, draw_runner, phase_colours
from paper.runner import Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES = {
    "A": r"$\dot\theta_0 = 0$: both feet touch down together, and lift off together",
    "B": r"$\dot\theta_0 = -0.4$: leg by leg",
}
APART = 1.95  # metres between snapshots
TALLEST = 1.5


def draw(poses: Mapping[str, Sequence[Pose]]) -> Figure:
    """Draw a row for each stride; snapshots stand further apart than they are."""
    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    axes = figure.subplots(len(poses), 1)
    widest = max(len(sequence) for sequence in poses.values())
    for axis, (name, sequence) in zip(axes, poses.items(), strict=True):
        draw_row(axis, sequence, widest)
        letter(axis, f"Stride {name}, {TITLES[name]}")
    handles = [Line2D([], [], color=colour, linewidth=6, label=phase) for phase, colour in phase_colours().items()]
    handles.append(
        Line2D([], [], color=INK, alpha=0.35, linewidth=1.1, label="pale: a leg that is spent for this stride")
    )
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def draw_row(axis: Axes, poses: Sequence[Pose], widest: int) -> None:
    """Draw snapshots side by side, each where its own column is; ``x`` under each is where it really is."""
    right = APART * (widest - 0.5) + 0.35
    draw_ground(axis, -0.95, APART * (len(poses) - 0.5) + 0.35)
    for k, pose in enumerate(poses):
        draw_runner(axis, pose, across=APART * k - pose.x)
        when = f"$t = {pose.time:.4f}$ s\n$x = {pose.x:.3f}$ m"
        axis.text(APART * k + 0.1, -0.27, pose.event, ha="center", va="baseline", fontsize=8.5, fontweight="bold")
        axis.text(APART * k + 0.1, -0.34, when, ha="center", va="top", fontsize=8.5, linespacing=1.35)
    axis.set(xlim=(-0.95, right), ylim=(-0.7, TALLEST), aspect="equal")
    axis.set_yticks([0, 0.5, 1.0, 1.5])
    axis.set_ylabel("height $z$ [m]")
    axis.xaxis.set_visible(False)
    axis.spines["bottom"].set_visible(False)
    axis.spines["left"].set_bounds(0, TALLEST)
