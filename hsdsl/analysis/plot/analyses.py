# pyright: reportUnknownMemberType=false
"""Pictures of analyses: distances over time, fitted measurements, runs from nearby, branches of periodic orbits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby, pairwise
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.analysis.plot.curves import curves, limits_of, line
from hsdsl.analysis.plot.panel import label, time_label
from hsdsl.analysis.plot.style import FAINT, PALETTE, legend_below, to_file
from hsdsl.analysis.report import words
from hsdsl.engine.execution import Array, Execution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BANDS = ("#0b5394", "#c8c8c8", "#b45f06")  # colours of distances over time
DECADES = 12  # below the largest value: smaller ones are drawn there
TITLE = 90  # letters of a line of a title
LONGEST = 40  # letters of a label of runs from nearby
MOST = 12  # sequences of transitions in their legend
MARKERS = {"fold": "o", "branch point": "P", "flip": "D", "torus": "s", "grazing": "X"}


@to_file
def plot_over_time(times: Array, bounds: dict[str, tuple[Array, Array]], title: str) -> Figure:
    """Draw bands of lower and upper bounds against time, by their names in the legend; the first is in front.

    ``times`` do not decrease; two equal ones mark a jump.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
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
    axis.set_title(title, loc="left", parse_math=False)
    legend_below(figure, axis.get_legend_handles_labels()[0], 9.0)
    return figure


def measured(
    run: Execution, times: Array, columns: Mapping[str, Array], units: Mapping[str, str], values: str = ""
) -> Figure:
    """Draw measurements and the run fitted to them, a panel for each column; ``values`` are what was fitted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 1.3 + 2.4 * len(columns)), layout="constrained")
    axes = figure.subplots(len(columns), 1, squeeze=False, sharex=True)[:, 0]
    drawn = curves(run)
    for axis, (name, column) in zip(axes, columns.items(), strict=True):
        low, high = limits_of([drawn], name)
        along = line(drawn.samples.time, drawn.column(name), drawn.begins, (*drawn.span, low, high))
        axis.plot(*along, color=PALETTE[0], label="run")
        axis.plot(times, column, ".", color=PALETTE[1], markersize=max(3.0, 7.0 - len(times) / 50), label="measured")
        axis.set_ylabel(label(name, units), parse_math=False)
    axes[-1].set_xlabel(time_label(units), parse_math=False)
    figure.suptitle(words.heading(run), x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    axes[0].set_title(fill(values, 110), loc="left", fontsize=8.5, color="#555555", parse_math=False)
    legend_below(figure, axes[0].get_legend_handles_labels()[0], 9.0)
    return figure


plot_measured = to_file(measured)


@to_file
def plot_nearby(points: Sequence[tuple[float, float, tuple[str, ...]]], title: str) -> Figure:
    """Draw points (radius, distance, transitions), a colour for each sequence of transitions.

    A run that ends elsewhere has no finite distance.
    """
    sequences = list(dict.fromkeys(made for *_, made in points))
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 5), layout="constrained")
    axis = figure.subplots()
    for k, sequence in enumerate(sequences):
        mine = [(r, d) for r, d, made in points if made == sequence and 0 < d < np.inf]
        label = ", ".join(sequence) or "no transition"
        label = label if k < MOST else "_"  # matplotlib leaves it out of the legend
        label = label if len(label) <= LONGEST else f"{label[: LONGEST - 3]}... ({len(sequence)})"
        axis.plot([r for r, _ in mine], [d for _, d in mine], "o", color=PALETTE[k % len(PALETTE)], label=label)
    radii = sorted({r for r, *_ in points})
    finite = [d for r, d, _ in points if r == radii[-1] and 0 < d < np.inf]
    if finite:
        axis.plot(radii, [max(finite) * r / radii[-1] for r in radii], "--", color=FAINT, label="as the radius")
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("radius, relative to the scales")
    axis.set_ylabel("distance of the executions, rho")
    axis.set_title(title, loc="left", fontsize=10, parse_math=False)
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
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axis = figure.subplots()
    pieces = [(a, b) for a, b in pairwise(points)]
    for stable, part in groupby(pieces, key=lambda piece: _stable(piece[0][2], piece[1][2])):
        along = list(part)
        line = [along[0][0], *(b for _, b in along)]
        style, colour = ("-", PALETTE[5]) if stable else ("--", PALETTE[6])
        label = "stable" if stable else "unstable"
        known = label in axis.get_legend_handles_labels()[1]
        axis.plot([p[0] for p in line], [p[1] for p in line], style, color=colour, label="_" if known else label)
    for kind, marker in MARKERS.items():
        found = [(p, x) for name, p, x in marks if name == kind]
        if found:
            axis.plot([p for p, _ in found], [x for _, x in found], marker, color=PALETTE[1], label=kind)
    legend_below(figure, axis.get_legend_handles_labels()[0], 8.0)
    axis.set_xlabel(parameter, parse_math=False)
    axis.set_ylabel(state, parse_math=False)
    axis.set_title(fill(title, TITLE), loc="left", fontsize=10, parse_math=False)
    return figure
