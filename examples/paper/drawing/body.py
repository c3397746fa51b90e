# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""The runner as a picture: body, springs, feet, ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.analysis.plot.style import INK, colours, curve
from paper.runner import Leg, Pose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COILS = 5
PHASES = ("no foot down", "one foot down", "both feet down")
FOLDED = 0.42  # of its length: how a spent leg is drawn, which the model says nothing about


def phase_colours() -> dict[str, str]:
    """Give each number of feet on the ground a colour."""
    return {phase: curve(colour) for phase, colour in colours(PHASES).items()}


def draw_ground(axis: Axes, left: float, right: float, depth: float = 0.07) -> None:
    """Draw the ground with hatching below."""
    axis.fill_between([left, right], -depth, 0, facecolor="#f3f3f3", hatch="////", edgecolor="#b8b8b8", linewidth=0)
    axis.plot([left, right], [0, 0], color="#555555", linewidth=1.1, zorder=2)


def draw_runner(axis: Axes, pose: Pose, across: float = 0.0, colour: str | None = None) -> None:
    """Draw the runner, moved by ``across`` along the ground."""
    shade = colour or phase_colours()[PHASES[pose.feet_down]]
    for leg in pose.legs:
        draw_leg(axis, leg, across, shade)
    ends = np.array([leg.hip for leg in pose.legs]) + np.array([across, 0.0])
    axis.plot(ends[:, 0], ends[:, 1], color=shade, linewidth=6, solid_capstyle="round", zorder=5)
    axis.plot(ends[:, 0], ends[:, 1], "o", color="white", markersize=3.2, zorder=6)
    axis.plot(pose.x + across, pose.z, "o", color="white", markeredgecolor=INK, markersize=5.5, zorder=6)


def draw_leg(axis: Axes, leg: Leg, across: float, colour: str) -> None:
    """Draw a leg as a spring with a foot; a spent one pale and folded."""
    hip, foot = np.array(leg.hip), np.array(leg.foot)
    if leg.doing == "spent":
        foot = hip + FOLDED * (foot - hip)
    points = spring(hip, foot) + np.array([across, 0.0])
    faint = 0.35 if leg.doing == "spent" else 1.0
    axis.plot(points[:, 0], points[:, 1], color=INK, linewidth=1.1, alpha=faint, zorder=4, solid_joinstyle="round")
    full = leg.doing == "stance"
    axis.plot(foot[0] + across, foot[1], "o", color=colour, markerfacecolor=colour if full else "white",
              markersize=5, alpha=faint, zorder=5)  # fmt: skip


def spring(start: Sequence[float] | np.ndarray, end: Sequence[float] | np.ndarray, width: float = 0.05) -> np.ndarray:
    """Return the points of a spring between two points: straight ends, coils between, shape (n, 2)."""
    a, b = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    along = b - a
    normal = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-12)
    peaks = 0.18 + 0.64 * (np.arange(2 * COILS) + 0.5) / (2 * COILS)
    at = np.concatenate([[0, 0.18], peaks, [0.82, 1]])
    side = np.concatenate([[0, 0], width * (-1.0) ** np.arange(2 * COILS), [0, 0]])
    return a + at[:, None] * along + side[:, None] * normal
