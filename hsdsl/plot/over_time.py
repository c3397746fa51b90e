# pyright: reportUnknownMemberType=false
"""A picture of distances over time: lower and upper bounds, on a logarithmic scale."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from hsdsl.plot.style import legend_below, to_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = npt.NDArray[Any]
COLOURS = ("#0b5394", "#c8c8c8", "#b45f06")
DECADES = 12  # below the largest value: smaller ones are drawn there


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
        colour, front = COLOURS[k % len(COLOURS)], 10 - k
        axis.plot(times, np.maximum(upper, floor), color=colour, linewidth=1.2, label=name, zorder=front)
        ends = np.maximum(lower, floor), np.maximum(upper, floor)
        axis.fill_between(times, *ends, color=colour, alpha=0.3, linewidth=0, zorder=front)
    axis.set_yscale("log")
    axis.set_xlabel("time t")
    axis.set_ylabel("distance")
    axis.set_title(title, loc="left", parse_math=False)
    legend_below(figure, axis.get_legend_handles_labels()[0], 9.0)
    return figure
