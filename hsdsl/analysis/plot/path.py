# pyright: reportUnknownMemberType=false
"""A picture of a shortest path through modes of two coordinates: a panel for each mode, passages as numbered jumps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.metrics.formulas import Formula
from hsdsl.analysis.metrics.geometry import Array, Domain, Gate, Space
from hsdsl.analysis.metrics.line import interval_of
from hsdsl.analysis.metrics.paths import PathPiece
from hsdsl.analysis.plot.style import ALARM, FAINT, INK, to_file
from hsdsl.base.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GRID = 160  # points of a panel's side at which domains and curved guards are evaluated
MARGIN = 0.25  # of a path's extent, around it


@to_file
def plot_path(space: Space, pieces: Sequence[PathPiece], title: str) -> Figure:
    """Draw domains, guards, their images and the pieces of a path.

    Raises UsageError: no path, a mode on it that has not two coordinates, an unknown suffix, or a file that cannot be
    written.
    """
    modes = _visited(space, pieces)
    from matplotlib.figure import Figure

    columns = min(3, len(modes))
    rows = -(-len(modes) // columns)
    figure = Figure(figsize=(1.5 + 4.2 * columns, 0.6 + 3.8 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for axis, mode in zip(axes, modes, strict=False):
        _panel(axis, space, mode, pieces)
    for axis in axes[len(modes) :]:
        axis.set_visible(False)
    figure.suptitle(title, x=0.01, ha="left", parse_math=False)
    return figure


def _visited(space: Space, pieces: Sequence[PathPiece]) -> list[int]:
    if not pieces:
        raise UsageError("there is no path to draw: either none was found or the points are the same")
    modes = [space.mode_index(name) for name in dict.fromkeys(piece.mode for piece in pieces)]
    for mode in modes:
        names = space.domains[mode].coordinates
        if len(names) != 2:
            has = f"mode {space.modes[mode]} has {len(names)}: {', '.join(names) or 'none'}"
            raise UsageError(f"a path is drawn in modes of two coordinates, and {has}")
    return modes


def _panel(axis: Any, space: Space, mode: int, pieces: Sequence[PathPiece]) -> None:
    domain = space.domains[mode]
    own: Array = np.array([x for piece in pieces if piece.mode == domain.mode for x in (piece.start, piece.end)])
    extent = max(float(np.max(own.max(axis=0) - own.min(axis=0))), 1e-9 * (1 + float(np.abs(own).max())))
    middle = (own.max(axis=0) + own.min(axis=0)) / 2
    low, high = middle - (0.5 + MARGIN) * extent, middle + (0.5 + MARGIN) * extent
    x: Array = np.linspace(float(low[0]), float(high[0]), GRID)
    y: Array = np.linspace(float(low[1]), float(high[1]), GRID)
    axis.contourf(x, y, _beyond(domain, x, y), levels=[-np.inf, 0], colors=["#eef4fa"])
    for gate in space.gates:
        if gate.source == mode:
            _line(axis, gate, gate.sides[0], extent, own, "-", f"guard of {gate.edge}")
        if gate.target == mode:
            _line(axis, gate, gate.sides[1], extent, own, ":", f"image of {gate.edge}")
    for gate in space.curved_gates:
        if gate.source == mode:
            _curve(axis, x, y, gate.surface, gate.conditions)
        if gate.target == mode and gate.marks.value(own[0]).size:
            _curve(axis, x, y, gate.marks, None)
    _pieces(axis, domain.mode, pieces)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axis.set_xlabel(domain.coordinates[0], parse_math=False)
    axis.set_ylabel(domain.coordinates[1], parse_math=False)
    axis.set_title(domain.mode, loc="left", parse_math=False)
    axis.set_aspect("equal", adjustable="box")
    if axis.get_legend_handles_labels()[0]:
        axis.legend(frameon=False, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)


def _grid(x: Array, y: Array) -> Array:
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _beyond(domain: Domain, x: Array, y: Array) -> Array:
    """How far each point of a grid is beyond the domain: positive outside."""
    points = _grid(x, y)
    worst = np.max(points @ domain.normals.T - domain.levels, axis=1, initial=-1.0)
    for formula in domain.curved:
        worst = np.maximum(worst, [formula(point) for point in points])
    return np.nan_to_num(worst, nan=1.0).reshape(len(y), len(x))


def _line(axis: Any, gate: Gate, side: Array, extent: float, own: Array, style: str, label: str) -> None:
    """A guard or image: a segment, cut off some way outside the panel."""
    base, frame = side[:, 0], side[:, 1:]
    if not np.any(frame):
        axis.plot(*base, marker="s", color=FAINT, label=label, linestyle="none")
        return
    slope = frame[:, 0]
    middle = float((own.mean(axis=0) - base) @ slope / (slope @ slope))
    reach = 4 * extent / float(np.linalg.norm(slope))
    ends = np.clip(interval_of(gate.normals, gate.levels), middle - reach, middle + reach)
    at = base + np.outer(ends, slope)
    axis.plot(at[:, 0], at[:, 1], style, color=FAINT, linewidth=2.0, label=label, zorder=1)


def _curve(axis: Any, x: Array, y: Array, surface: Formula, conditions: Formula | None) -> None:
    points = _grid(x, y)
    values = np.array([surface(point) for point in points])
    if conditions is not None:
        allowed = np.array([np.all(conditions.value(point) <= 1e-2 * np.ptp(x)) for point in points])
        values = np.where(allowed, values, np.nan)
    if np.nanmin(values, initial=1) < 0 < np.nanmax(values, initial=-1):
        style = "solid" if conditions is not None else "dotted"
        axis.contour(x, y, values.reshape(len(y), len(x)), levels=[0], colors=[FAINT], linestyles=[style])


def _pieces(axis: Any, mode: str, pieces: Sequence[PathPiece]) -> None:
    """The straight pieces in one mode, with the numbers of the passages they end at and come from."""
    number = 0
    for k, piece in enumerate(pieces):
        came, number = number, number + (piece.edge is not None)
        if piece.mode != mode:
            continue
        axis.plot(*zip(piece.start, piece.end, strict=True), color=INK, linewidth=1.8, zorder=3)
        if k == 0:
            _mark(axis, piece.start, "from", INK)
        elif pieces[k - 1].edge is not None:
            _mark(axis, piece.start, str(came), ALARM)
        if piece.edge is not None:
            _mark(axis, piece.end, str(number), ALARM)
        elif k == len(pieces) - 1:
            _mark(axis, piece.end, "to", INK)


def _mark(axis: Any, at: tuple[float, ...], text: str, colour: str) -> None:
    axis.plot(*at, marker="o", color=colour, markersize=6, zorder=4)
    axis.annotate(text, at, xytext=(6, 6), textcoords="offset points", color=colour, fontweight="bold", zorder=5)
