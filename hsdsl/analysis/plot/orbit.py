# pyright: reportUnknownMemberType=false
"""A periodic orbit in the plane of two states, and its multipliers beside the unit circle."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.analysis.plot.panel import label, time_label
from hsdsl.analysis.plot.style import FAINT, PALETTE, to_file
from hsdsl.engine.execution import Array, Execution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 2000
LETTERS = 90  # of a line of the title


@to_file
def plot_orbit(
    run: Execution, states: Sequence[str], multipliers: Array, period: float, title: str, units: Mapping[str, str]
) -> Figure:
    """Draw a run over one period; jumps are dotted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw_run(left, run, states, period)
    across, up = (states[0], states[1]) if len(states) > 1 else ("t", states[0])
    left.set_xlabel(label(across, units) if len(states) > 1 else time_label(units), parse_math=False)
    left.set_ylabel(label(up, units), parse_math=False)
    draw_circle(right, multipliers)
    figure.suptitle(textwrap.fill(title, LETTERS), x=0.01, ha="left", fontsize=11, fontweight="bold", parse_math=False)
    return figure


def _draw_run(axis: Axes, run: Execution, states: Sequence[str], period: float) -> None:
    """Draw the first two states against each other, or one over time."""
    first: tuple[float, float] | None = None
    before: tuple[float, float] | None = None
    for arc in run.arcs:
        start, end = float(run.times[arc.first]), min(float(run.times[arc.last]), period)
        if end < start or not set(states[:2]) <= set(arc.states):
            before = None
            continue
        times = np.linspace(start, end, max(2, int(POINTS * (end - start) / period)))
        table = run.sample(times[1:-1])
        columns: list[Array] = []
        for name in states[:2]:
            k = arc.states.index(name)
            last = run.values[arc.last, k] if end == float(run.times[arc.last]) else run.sample([end], "left")[name][0]
            columns.append(np.concatenate(([run.values[arc.first, k]], table[name], [last])).astype(float))
        x, y = columns if len(columns) == 2 else (times, columns[0])
        axis.plot(x, y, color=PALETTE[0])
        if before is not None:
            _draw_jump(axis, before, (float(x[0]), float(y[0])))
        before = float(x[-1]), float(y[-1])
        first = first or (float(x[0]), float(y[0]))
        if end >= period:
            break
    if first is not None and before is not None:  # the jump of the section closes the orbit
        _draw_jump(axis, before, first if len(states) > 1 else (before[0], first[1]))


def _draw_jump(axis: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axis.plot([start[0], end[0]], [start[1], end[1]], ":", color=PALETTE[1])


def draw_circle(axis: Axes, multipliers: Array) -> None:
    """Draw the unit circle and multipliers."""
    angles = np.linspace(0, 2 * np.pi, 200)
    axis.plot(np.cos(angles), np.sin(angles), color=FAINT)
    for inside, colour in ((True, PALETTE[0]), (False, PALETTE[1])):
        chosen = [complex(m) for m in multipliers.tolist() if (abs(m) < 1) is inside]
        axis.plot([m.real for m in chosen], [m.imag for m in chosen], "o", color=colour)
    axis.set_aspect("equal", "datalim")
    axis.set_title("Floquet multipliers", fontsize=9)
    axis.set_xlabel("real part")
    axis.set_ylabel("imaginary part")
