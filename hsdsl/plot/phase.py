# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Two states against each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hsdsl.execution import Execution
from hsdsl.plot.curves import SEVERAL, Array, Curves, GuardLine, limits, line
from hsdsl.plot.panel import label, mark_jumps, with_guards
from hsdsl.plot.style import INK, colours, curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def has_phase(execution: Execution) -> bool:
    """Whether every mode has the same two states."""
    return len(execution.states) == 2 and all(len(arc.states) == 2 for arc in execution.arcs)


def draw_phase(
    axis: Axes, data: Curves, guards: Sequence[GuardLine], units: Mapping[str, str], ends_badly: bool
) -> None:
    """Draw the phase plot, coloured by mode where there are several, with guards as dotted lines."""
    first, second = data.samples.states
    time, x, y = data.samples.time, data.column(first), data.column(second)
    levels = {name: [guard.value for guard in guards if guard.state == name] for name in (first, second)}
    x0, x1 = with_guards(limits(x, time, ends_badly), levels[first])
    y0, y1 = with_guards(limits(y, time, ends_badly), levels[second])
    axis.set(xlim=(x0, x1), ylim=(y0, y1))
    for colour, here in _parts(data):
        at = np.where(here, x, np.nan), np.where(here, y, np.nan)
        drawn = line(*at, data.begins, (x0, x1, y0, y1))
        axis.plot(*drawn, color=colour, linewidth=1.1, rasterized=len(drawn[0]) > 60_000)
    mark_jumps(axis, x, y, data.jumps)
    axis.plot(x[:1], y[:1], marker="D", color=INK, markersize=4.5, linestyle="")
    axis.annotate("start", (x[0], y[0]), xytext=(5, 4), textcoords="offset points", fontsize=7.5, color="#444444")
    for level in dict.fromkeys(levels[first]):
        axis.axvline(level, color="#444444", linestyle="dotted", linewidth=1.1)
    for level in dict.fromkeys(levels[second]):
        axis.axhline(level, color="#444444", linestyle="dotted", linewidth=1.1)
    axis.set_xlabel(label(first, units), parse_math=False)
    axis.set_ylabel(label(second, units), parse_math=False)
    axis.set_box_aspect(1)


def _parts(data: Curves) -> list[tuple[str, Array]]:
    """Divide the points by mode, each with its colour; all in one where there are no colours to tell modes by."""
    if len(data.modes) < 2 or SEVERAL in data.modes:
        return [(INK, np.ones(len(data.samples), dtype=bool))]
    return [(curve(colour), data.samples.mode == mode) for mode, colour in colours(data.modes).items()]
