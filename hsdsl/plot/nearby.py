# pyright: reportUnknownMemberType=false
"""Distances of runs from nearby over their radius, log-log, a colour for each sequence of transitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.plot.style import FAINT, PALETTE, legend_below, to_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST = 40  # letters of a label
MOST = 12  # sequences in the legend


@to_file
def plot_nearby(points: Sequence[tuple[float, float, tuple[str, ...]]], title: str) -> Figure:
    """Draw points (radius, distance, transitions); a run that ends elsewhere has no finite distance."""
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
