# pyright: reportUnknownMemberType=false
"""Pictures of analyses: distances, shortest paths, runs from nearby, orbits and their branches, sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hsdsl.analysis.plot.style import (
    ALARM,
    FAINT,
    INK,
    RUNS,
    colours,
    curve,
    empty,
    heading,
    label,
    legend_below,
    pale,
    time_label,
    to_file,
    whole_ticks,
)
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hsdsl.analysis.metrics.geometry import Formula, Gate, Space
    from hsdsl.analysis.metrics.points import PathPiece
    from hsdsl.analysis.plot.curves import Curves, View


BANDS = ("#0b5394", "#c8c8c8", "#b45f06")  # colours of distances over time
DECADES = 12  # below the largest value: smaller ones are drawn there
LONGEST = 40  # letters of a label of runs from nearby
MOST = 12  # sequences of transitions in their legend
MARKERS = {"fold": "o", "branch point": "P", "flip": "D", "torus": "s", "grazing": "X"}


@to_file
def plot_over_time(times: Array, bounds: dict[str, tuple[Array, Array]], title: str) -> Figure:
    """Draw bands of lower and upper bounds against time, by their names in the legend; the first is in front.

    ``times`` do not decrease; two equal ones mark a jump.
    """
    figure = empty(9.0, 3.6)
    axis = figure.add_subplot()
    finite = [v[np.isfinite(v)] for pair in bounds.values() for v in pair]
    top = max((float(v.max()) for v in finite if len(v)), default=1.0) or 1.0
    floor = top * 10.0**-DECADES
    for k, (name, (lower, upper)) in enumerate(bounds.items()):
        colour, front = BANDS[k % len(BANDS)], 10 - k
        axis.plot(times, np.maximum(upper, floor), color=colour, linewidth=1.2, label=name, zorder=front)
        ends = np.maximum(lower, floor), np.maximum(upper, floor)
        axis.fill_between(times, *ends, color=colour, alpha=0.3, linewidth=0, zorder=front)
    axis.set_yscale("log")
    axis.set_xlabel("time t")
    axis.set_ylabel("distance")
    heading(figure, title)
    legend_below(figure, axis.get_legend_handles_labels()[0], 9.0)
    return figure


@to_file
def plot_nearby(points: Sequence[tuple[float, float, tuple[str, ...]]], title: str) -> Figure:
    """Draw points (radius, distance, transitions), a colour for each sequence of transitions.

    A run that ends elsewhere has no finite distance.
    """
    sequences = list(dict.fromkeys(made for *_, made in points))
    figure = empty(7, 5)
    axis = figure.subplots()
    for k, sequence in enumerate(sequences):
        mine = [(r, d) for r, d, made in points if made == sequence and 0 < d < np.inf]
        label = ", ".join(sequence) or "no transition"
        label = label if k < MOST else "_"  # matplotlib leaves it out of the legend
        label = label if len(label) <= LONGEST else f"{label[: LONGEST - 3]}... ({len(sequence)})"
        axis.plot([r for r, _ in mine], [d for _, d in mine], "o", color=RUNS[k % len(RUNS)], label=label)
    radii = sorted({r for r, *_ in points})
    finite = [d for r, d, _ in points if r == radii[-1] and 0 < d < np.inf]
    if finite:
        axis.plot(radii, [max(finite) * r / radii[-1] for r in radii], "--", color=FAINT, label="as the radius")
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("radius, relative to the scales")
    axis.set_ylabel("distance of the executions, rho")
    heading(figure, title)
    if len(sequences) > MOST:
        axis.plot([], [], "o", color="white", label=f"and {len(sequences) - MOST} other sequences")
    rows = legend_below(figure, axis.get_legend_handles_labels()[0], 7.0)
    figure.set_figheight(5 + 0.2 * rows)
    return figure


def _stable(*ends: bool | None) -> bool:
    """Whether the orbits between two points are stable."""
    return True in ends and False not in ends


@to_file
def plot_branch(
    parameter: str,
    state: str,
    points: Sequence[tuple[float, float, bool | None]],
    marks: Sequence[tuple[str, float, float]],
    title: str,
) -> Figure:
    """Draw points (parameter, state, stable) in their order, and marks (kind, parameter, state), with labels of axes.

    Stable orbits are solid, others dashed. A point that ends a stable or unstable piece has None.
    """
    figure = empty(8, 5)
    axis = figure.subplots()
    pieces = [(a, b) for a, b in pairwise(points)]
    for stable, part in groupby(pieces, key=lambda piece: _stable(piece[0][2], piece[1][2])):
        along = list(part)
        line = [along[0][0], *(b for _, b in along)]
        style, colour = ("-", RUNS[0]) if stable else ("--", RUNS[1])
        label = "stable" if stable else "unstable"
        known = label in axis.get_legend_handles_labels()[1]
        axis.plot([p[0] for p in line], [p[1] for p in line], style, color=colour, label="_" if known else label)
    for kind, marker in MARKERS.items():
        found = [(p, x) for name, p, x in marks if name == kind]
        if found:
            axis.plot([p for p, _ in found], [x for _, x in found], marker, color=RUNS[1], label=kind)
    legend_below(figure, axis.get_legend_handles_labels()[0], 8.0)
    axis.set_xlabel(parameter, parse_math=False)
    axis.set_ylabel(state, parse_math=False)
    heading(figure, title)
    return figure


@to_file
def plot_orbit(run: Curves, states: Sequence[str], multipliers: Array, view: View, section: str, facts: str) -> Figure:
    """Draw one lap of a run, coloured by mode, and the multipliers."""
    from matplotlib.lines import Line2D

    from hsdsl.analysis.plot.figure import draw_panel, draw_phase, marks, modes_named

    figure = empty(10, 4.8)
    left, right = figure.subplots(1, 2)
    plane = len(states) > 1
    if plane:
        draw_phase(left, [run], (states[0], states[1]), view)
        shades = colours(run.modes).items() if len(run.modes) > 1 else ()
        named: list[Any] = [Line2D([], [], color=curve(shade), label=mode) for mode, shade in shades]
    else:
        draw_panel(left, [run], states[:1], view, 3.5)
        left.set_xlabel(time_label(view.units), parse_math=False)
        left.set_ylabel(label(states[0], view.units), parse_math=False)
        named = modes_named(left, run, None, 4.0)
    angles = np.linspace(0, 2 * np.pi, 200)
    right.plot(np.cos(angles), np.sin(angles), color=FAINT)
    for inside, colour in ((True, RUNS[0]), (False, RUNS[1])):
        chosen = [complex(m) for m in multipliers.tolist() if (abs(m) < 1) is inside]
        right.plot([m.real for m in chosen], [m.imag for m in chosen], "o", color=colour)
    right.set_aspect("equal", "datalim")
    right.set_title("Floquet multipliers" if len(multipliers) else "no Floquet multipliers", fontsize=9)
    right.set_xlabel("real part")
    right.set_ylabel("imaginary part")
    heading(figure, view.title or "", facts, left, 6 if plane else 16)
    legend_below(figure, [*named, *marks([run], states[:2], plane, f"right after {section}")], 10.0)
    return figure


MOST_WORDS = 20  # of which each has a colour
MARGIN = 0.01  # beside the first and the last column of dots
DOT = 40_000  # dots from which on they are small and pale


class Axis(NamedTuple):
    """A varied name, the label with its unit, its value in each row, and its grid where it has one."""

    label: str
    values: Any
    grid: Sequence[float] | None
    logarithmic: bool


class Quantity(NamedTuple):
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
        axes.plot(x.values[order], numbers, ".", color=curve(RUNS[0]))
        axes.set_yticks(range(len(of.words)), of.words, parse_math=False)
    else:
        line = "-" if x.grid is not None and len(x.grid) == len(x.values) else "."
        axes.plot(x.values[order], of.values[order], line, color=curve(RUNS[0]), linewidth=1.2, markersize=2)
        whole_ticks(axes.yaxis, of.values)
    axes.set_ylabel(of.label, parse_math=False)
    return _labelled(figure, axes, x, title)


@to_file
def plot_dots(x: Axis, of: Quantity, where: Any, title: str) -> Figure:
    """Draw every number of rows with lists; ``where`` has the row of each."""
    (figure, axes), many = _empty(), len(of.values) > DOT
    size, alpha = (0.4, 0.35) if many else (1.2, 0.8)
    dots: dict[str, Any] = {"markersize": size, "alpha": alpha, "markeredgewidth": 0, "rasterized": True}
    axes.plot(x.values[where], of.values, "o", color=curve(RUNS[0]), **dots)
    axes.set_ylabel(of.label, parse_math=False)
    whole_ticks(axes.yaxis, of.values)
    axes.margins(x=MARGIN)
    return _labelled(figure, axes, x, title)


@to_file
def plot_family(curves: Sequence[tuple[Any, Any]], by: Axis, label: str, title: str, time: str) -> Figure:
    """Draw a curve (times, values) for each row, in colours that rise with a name."""
    from matplotlib.collections import LineCollection

    figure, axes = _empty()
    known = by.values[np.isfinite(by.values)]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    lines = LineCollection([np.column_stack(each) for each in curves], cmap="viridis", linewidths=0.9)
    lines.set(alpha=pale(len(curves)))
    lines.set(array=by.values, norm="log" if by.logarithmic else None, clim=(low, high), rasterized=True)
    axes.add_collection(lines)
    axes.autoscale_view()
    figure.colorbar(lines, ax=axes).set_label(by.label, parse_math=False)
    axes.set_ylabel(label, parse_math=False)
    return _labelled(figure, axes, Axis(time, None, None, False), title)


@to_file
def plot_map(x: Axis, y: Axis, of: Quantity, title: str) -> Figure:
    """Draw a number or a word over two names: cells where both have grids, else dots; grey where there is none."""
    figure, axes = _empty()
    shades: dict[str, Any] = {"cmap": "viridis"}
    values = of.values
    if of.words:
        from matplotlib.colors import BoundaryNorm, ListedColormap

        words = of.words[:MOST_WORDS]
        values = np.array([words.index(v) if v in words else np.nan for v in of.values], dtype=float)
        colours = ListedColormap([RUNS[i % len(RUNS)] for i in range(len(words))])
        shades = {"cmap": colours, "norm": BoundaryNorm(np.arange(len(words) + 1) - 0.5, max(1, len(words)))}
    if x.grid is None or y.grid is None:
        drawn: Any = axes.scatter(x.values, y.values, c=values, s=12, linewidths=0, **shades)
    else:
        axes.set_facecolor("#dddddd")
        drawn = axes.pcolormesh(*_cells(x, y, values), rasterized=True, **shades)
    _legend(figure, axes, drawn, of)
    axes.set_ylabel(y.label, parse_math=False)
    if y.logarithmic:
        axes.set_yscale("log")
    return _labelled(figure, axes, x, title)


def _empty() -> tuple[Figure, Axes]:
    figure = empty(8, 5)
    return figure, figure.subplots()


def _labelled(figure: Figure, axes: Axes, x: Axis, title: str) -> Figure:
    if x.logarithmic:
        axes.set_xscale("log")
    axes.set_xlabel(x.label, parse_math=False)
    heading(figure, title)
    return figure


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

    handles = [Patch(color=RUNS[i % len(RUNS)], label=word) for i, word in enumerate(of.words[:MOST_WORDS])]
    handles += [Patch(color="#dddddd", label="other")] if len(of.words) > MOST_WORDS else []
    legend = figure.legend(handles=handles, title=of.label, loc="outside right upper", frameon=False, edgecolor=FAINT)
    for text in legend.get_texts():
        text.set_parse_math(False)


GRID = 160  # points of a panel's side at which domains and curved guards are evaluated
AROUND = 0.25  # of a path's extent, around it


@to_file
def plot_path(space: Space, pieces: Sequence[PathPiece], title: str) -> Figure:
    """Draw domains, guards, their images and the pieces of a path.

    Raises UsageError: no path, a mode on it that has not two coordinates, an unknown suffix, or a file that cannot be
    written.
    """
    if not pieces:
        raise UsageError("there is no path to draw: either none was found or the points are the same")
    modes = [space.mode_index(name) for name in dict.fromkeys(piece.mode for piece in pieces)]
    for mode in modes:
        names = space.domains[mode].coordinates
        if len(names) != 2:
            has = f"mode {space.modes[mode]} has {len(names)}: {', '.join(names) or 'none'}"
            raise UsageError(f"a path is drawn in modes of two coordinates, and {has}")
    columns = min(3, len(modes))
    rows = -(-len(modes) // columns)
    figure = empty(1.5 + 4.2 * columns, 0.6 + 3.8 * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
    for axis, mode in zip(axes, modes, strict=False):
        _panel(axis, space, mode, pieces)
    for axis in axes[len(modes) :]:
        axis.set_visible(False)
    figure.suptitle(title, x=0.01, ha="left", parse_math=False)
    return figure


def _panel(axis: Any, space: Space, mode: int, pieces: Sequence[PathPiece]) -> None:
    domain = space.domains[mode]
    own: Array = np.array([x for piece in pieces if piece.mode == domain.mode for x in (piece.start, piece.end)])
    extent = max(float(np.max(own.max(axis=0) - own.min(axis=0))), 1e-9 * (1 + float(np.abs(own).max())))
    middle = (own.max(axis=0) + own.min(axis=0)) / 2
    low, high = middle - (0.5 + AROUND) * extent, middle + (0.5 + AROUND) * extent
    x: Array = np.linspace(float(low[0]), float(high[0]), GRID)
    y: Array = np.linspace(float(low[1]), float(high[1]), GRID)
    points = _grid(x, y)
    worst = np.max(points @ domain.normals.T - domain.levels, axis=1, initial=-1.0)
    for formula in domain.curved:
        worst = np.maximum(worst, [formula(point) for point in points])
    axis.contourf(x, y, np.nan_to_num(worst, nan=1.0).reshape(len(y), len(x)), levels=[-np.inf, 0], colors=["#eef4fa"])
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


def _line(axis: Any, gate: Gate, side: Array, extent: float, own: Array, style: str, label: str) -> None:
    """A guard or image: a segment, cut off some way outside the panel."""
    base, frame = side[:, 0], side[:, 1:]
    if not np.any(frame):
        axis.plot(*base, marker="s", color=FAINT, label=label, linestyle="none")
        return
    from hsdsl.analysis.metrics.gate_sequence import interval_of

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
