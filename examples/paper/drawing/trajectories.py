# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 14b and 14c: the exact trajectories."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from hsdsl.analysis.plot.style import ALARM, FAINT, INK
from hsdsl.engine.execution import Execution
from paper.drawing.axes import letter

ZOOM = (4.6, 5.1, -0.8125, -0.7985)  # the first impacts and the Zeno point of example 2


def draw(runs: Mapping[int, Execution], stops: Mapping[int, float]) -> Figure:
    """Draw the position over time of both examples, and the stop."""
    figure = Figure(figsize=(10.0, 5.6), layout="constrained")
    axes = dict(zip(runs, figure.subplots(2, 1), strict=True))
    for example, run in runs.items():
        axis = axes[example]
        end = float(run.times[-1])
        times = np.unique(np.concatenate([run.times, np.linspace(0, end, 6001)]))
        position = run.sample(times)["x"]
        axis.axhline(stops[example], color=ALARM, linestyle="dotted", linewidth=1.3)
        axis.plot(times, position, color=INK, linewidth=1.1)
        low, high = float(position.min()), stops[example]
        axis.set(xlim=(0, end), ylim=(low - 0.08 * (high - low), high + 0.16 * (high - low)))
        axis.set_ylabel("position $x$")
        axis.annotate(f"stop, $x_{{max}} = {high:g}$", (end, high), xytext=(-3, 4), textcoords="offset points",
                      ha="right", fontsize=8, color=ALARM)  # fmt: skip
        letter(axis, f"Example {example}, exactly: {SENTENCES[example]}")
    axes[2].set_xlabel("time $t$")
    inset = axes[2].inset_axes((0.475, 0.09, 0.2, 0.55))
    run = runs[2]
    times = np.unique(np.concatenate([run.times, np.linspace(*ZOOM[:2], 4001)]))
    inset.plot(times, run.sample(times)["x"], color=INK, linewidth=0.9)
    inset.axhline(stops[2], color=ALARM, linestyle="dotted", linewidth=1.1)
    inset.set(xlim=ZOOM[:2], ylim=ZOOM[2:])
    inset.tick_params(labelsize=7)
    inset.set_title("impacts accumulate at 5.0645", fontsize=7.5)
    axes[2].indicate_inset_zoom(inset, edgecolor=FAINT)
    return figure


SENTENCES = {
    1: "49 impacts, closed form between them",
    2: "at rest on the stop until 2.498, impacts up to 5.065, at rest until 8.781, impacts up to 11.348, at rest",
}
