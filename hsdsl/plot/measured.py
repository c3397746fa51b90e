# pyright: reportUnknownMemberType=false
"""Measurements and the run that was fitted to them, a panel for each column."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.execution import Array, Execution
from hsdsl.plot.style import PALETTE, legend_below, to_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 2000


@to_file
def plot_measured(run: Execution, times: Array, columns: Mapping[str, Array]) -> Figure:
    """Draw them to a .png or .svg file; jumps are not joined."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 1 + 2.4 * len(columns)), layout="constrained")
    axes = figure.subplots(len(columns), 1, squeeze=False, sharex=True)[:, 0]
    cuts = [float(run.times[0]), *(float(made.time) for made in run.transitions), float(run.times[-1])]
    for axis, (name, column) in zip(axes, columns.items(), strict=True):
        for start, end in pairwise(cuts):
            dense = np.linspace(start, end, max(2, int(POINTS * (end - start) / (cuts[-1] or 1))))[:-1]
            if len(dense):
                axis.plot(dense, run.sample(dense)[name].astype(float), color=PALETTE[0], label="run")
        axis.plot(times, column, ".", color=PALETTE[1], markersize=3, label="measured")
        axis.set_ylabel(name, parse_math=False)
    axes[-1].set_xlabel("time t")
    drawn = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))  # one for all pieces of the run
    legend_below(figure, list(drawn.values()), 9.0)
    return figure
