# pyright: reportUnknownMemberType=false
"""The shapes of a scene at one time, from the outputs of a run, and how they look."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.style import ALARM, INK, RUNS
from hsdsl.engine.execution import Array, Samples

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COILS = 8  # of a spring


@dataclass(frozen=True)
class Drawn:
    """A shape at one time: its kind, its points (n, 2), and its sizes."""

    kind: str
    points: Array
    sizes: tuple[float, ...]

    @property
    def outline(self) -> Array:
        """The corners of a box, the zigzag of a spring, else the points."""
        if self.kind == "box":
            width, height, angle = self.sizes
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, height / 2)
            turned = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
            return self.points[0] + corners @ turned
        return _zigzag(*self.points) if self.kind == "spring" else self.points

    def reach(self, point: Array) -> float:
        """How far its farthest coordinate is from that of a point."""
        return float(np.abs(self.extent - point).max())

    @property
    def extent(self) -> Array:
        """Points that a picture must have room for."""
        if self.kind == "circle":
            return np.concatenate([self.points - self.sizes[0], self.points + self.sizes[0]])
        return self.points if self.kind == "spring" else self.outline


def _zigzag(start: Array, end: Array) -> Array:
    along = end - start
    across = np.array([-along[1], along[0]]) * 0.06
    shares = np.linspace(0.12, 0.88, 2 * COILS + 1)
    sides = np.array([0, *([1, -1] * COILS)[: 2 * COILS - 1], 0])
    return np.concatenate([[start], start + np.outer(shares, along) + np.outer(sides, across), [end]])


def shapes_at(samples: Samples, shapes: Sequence[Any], row: int) -> Iterator[Drawn]:
    """Give the shapes at a row that have all their numbers; these are the outputs ``scene 0``, ``scene 1``, ..."""
    at = 0
    for shape in shapes:
        numbers = np.array([float(samples[f"scene {k}"][row]) for k in range(at, at + shape.numbers)])
        at += shape.numbers
        if np.isfinite(numbers).all():
            points = numbers[: 2 * shape.points].reshape(-1, 2)
            yield Drawn(shape.kind, points, tuple(numbers[2 * shape.points :].tolist()))


def draw_shape(axis: Axes, drawn: Drawn) -> None:
    """Add a shape to an axis."""
    from matplotlib.patches import Circle, Polygon

    look: dict[str, Any] = {"edgecolor": INK, "facecolor": f"{RUNS[0]}59", "linewidth": 1.6}
    if drawn.kind == "circle":
        x, y = drawn.points[0].tolist()
        axis.add_patch(Circle((x, y), abs(drawn.sizes[0]), **look))
    elif drawn.kind == "box":
        axis.add_patch(Polygon(drawn.outline, closed=True, **look))
    elif drawn.kind == "point":
        axis.plot(*drawn.points.T, "o", color=ALARM, markersize=6)
    else:
        axis.plot(*drawn.outline.T, color=INK, linewidth=1.6, solid_joinstyle="round")
