# pyright: reportUnknownMemberType=false
"""A branch of periodic orbits over a parameter: stable orbits solid, others dashed, bifurcations marked."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import TYPE_CHECKING

from hsdsl.plot.style import PALETTE, legend_below, to_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKERS = {"fold": "o", "flip": "D", "torus": "s", "grazing": "X"}


@to_file
def plot_branch(
    parameter: str,
    state: str,
    points: Sequence[tuple[float, float, bool]],
    marks: Sequence[tuple[str, float, float]],
    title: str,
) -> Figure:
    """Draw points (parameter, state, stable) in their order, and marks (kind, parameter, state)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axis = figure.subplots()
    pieces = [(a, b) for a, b in pairwise(points)]
    for stable, part in groupby(pieces, key=lambda piece: piece[0][2] and piece[1][2]):
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
    axis.set_ylabel(f"{state} after the section", parse_math=False)
    axis.set_title(title, loc="left", fontsize=10, parse_math=False)
    return figure
