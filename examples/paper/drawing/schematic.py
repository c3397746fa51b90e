# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 15: what the runner's letters mean."""

from __future__ import annotations

from math import cos, degrees, pi, sin
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.patches import Arc

from hsdsl.analysis.plot.style import INK
from paper.drawing.body import draw_ground, draw_runner
from paper.runner import PSI, Pose, pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TILT = 0.22
HEIGHT = 0.78
GREY = "#888888"


def draw() -> Figure:
    """Draw one pose, the right foot on the ground, with its coordinates and lengths."""
    figure = Figure(figsize=(6.4, 3.1), layout="constrained")
    axis = figure.subplots()
    runner = pose("right", 0.0, {"x": 0.0, "z": HEIGHT, "th": TILT, "pr": 0.02}, "")
    draw_ground(axis, -1.1, 1.75)
    draw_runner(axis, runner)
    _pitch(axis, runner)
    _leg_angle(axis, runner)
    _lengths(axis, runner)
    _words(axis, runner)
    axis.annotate("", (-0.9, 0.85), (-0.9, 1.15), arrowprops={"arrowstyle": "-|>", "color": INK})
    axis.text(-0.86, 1.0, "$g$", fontsize=11)
    axis.set(xlim=(-1.1, 1.75), ylim=(-0.1, 1.2), aspect="equal")
    axis.set_axis_off()
    return figure


def _pitch(axis: Axes, runner: Pose) -> None:
    """Draw theta at the right hip, between the horizontal and the body."""
    x, z = runner.legs[1].hip
    axis.plot([x, 0.12], [z, z], "--", color=GREY, linewidth=0.8)
    axis.add_patch(Arc((x, z), 0.84, 0.84, theta1=0, theta2=degrees(TILT), color=INK, linewidth=0.9))
    axis.text(x + 0.46, z + 0.015, r"$\theta$", fontsize=11)


def _leg_angle(axis: Axes, runner: Pose) -> None:
    """Draw psi at the left hip, between the body's perpendicular and the swinging leg."""
    x, z = runner.legs[0].hip
    axis.plot([x, x + 0.75 * sin(TILT)], [z, z - 0.75 * cos(TILT)], "--", color=GREY, linewidth=0.8)
    start, middle = degrees(TILT - pi / 2), TILT - pi / 2 + PSI / 2
    axis.add_patch(Arc((x, z), 1.1, 1.1, theta1=start, theta2=start + degrees(PSI), color=INK, linewidth=0.9))
    axis.text(x + 0.64 * cos(middle), z + 0.64 * sin(middle), r"$\psi$", fontsize=11, ha="center", va="center")


def _lengths(axis: Axes, runner: Pose) -> None:
    """Draw the two halves of the body's length, beside it."""
    arrow = {"arrowstyle": "<->", "color": INK, "shrinkA": 0, "shrinkB": 0, "linewidth": 0.8}
    up = -0.16 * sin(TILT), 0.16 * cos(TILT)
    for leg in runner.legs:
        x, z = leg.hip
        axis.annotate("", (x + up[0], z + up[1]), (up[0], HEIGHT + up[1]), arrowprops=arrow)
        at = x / 2 + 1.6 * up[0], (HEIGHT + z) / 2 + 1.6 * up[1]
        axis.text(*at, "$d/2$", ha="center", va="center", fontsize=10)


def _words(axis: Axes, runner: Pose) -> None:
    left, right = runner.legs
    axis.text(0.02, 0.6, "$(x, z)$\n$m, I$", ha="left", va="top", fontsize=10)
    axis.text(left.hip[0] + 0.5, left.hip[1] - 0.25, r"$\ell, k$", fontsize=10)
    axis.text(right.hip[0] - 0.02, 0.3, r"$\ell, k$", fontsize=10, ha="right")
    small: dict[str, Any] = {"fontsize": 8.5, "va": "center", "color": "#555555"}
    axis.text(left.foot[0] + 0.07, left.foot[1], "left leg\n(in front)", **small)
    axis.text(right.foot[0] + 0.07, 0.06, "right foot, pinned at $(p_r, 0)$", **small)
