# pyright: reportUnknownMemberType=false
"""Two states or outputs against each other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.curves import SEVERAL, Array, Curves, GuardLine, limits_of, line
from hsdsl.analysis.plot.panel import label, mark_jumps, with_guards
from hsdsl.analysis.plot.style import Look, colours, curve, looks
from hsdsl.analysis.plot.view import Pair, View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEVEL: dict[str, Any] = {"color": "#444444", "linestyle": "dotted", "linewidth": 1.1}


def draw_phase(axis: Axes, runs: Sequence[Curves], pair: Pair, guards: Sequence[GuardLine], view: View) -> None:
    """Draw one run coloured by mode where it has several, or several with a look for each; guards are dotted."""
    fixed = [guard for guard in guards if guard.moving is None]
    levels = [[guard.value for guard in fixed if guard.state == name] for name in pair]
    across, up = (with_guards(limits_of(runs, name), at) for name, at in zip(pair, levels, strict=True))
    axis.set(xlim=across, ylim=up)
    for run, look in zip(runs, looks(len(runs)), strict=True):
        _draw_run(axis, run, pair, _parts(run, look, len(runs) == 1), (*across, *up))
    for level in dict.fromkeys(levels[0]):
        axis.axvline(level, **LEVEL)
    for level in dict.fromkeys(levels[1]):
        axis.axhline(level, **LEVEL)
    axis.set_xlabel(label(pair[0], view.units), parse_math=False)
    axis.set_ylabel(label(pair[1], view.units), parse_math=False)
    axis.set_box_aspect(1)


def _draw_run(
    axis: Axes, run: Curves, pair: Pair, parts: Sequence[tuple[Look, Array]], ends: tuple[float, float, float, float]
) -> None:
    x, y = run.column(pair[0]), run.column(pair[1])
    for look, here in parts:
        drawn = line(np.where(here, x, np.nan), np.where(here, y, np.nan), run.begins, ends)
        axis.plot(*drawn, linewidth=1.1, rasterized=len(drawn[0]) > 60_000, **look)
    colour = looks(1)[0]["color"] if len(parts) > 1 else parts[0][0]["color"]
    mark_jumps(axis, x, y, run.jumps, colour)
    axis.plot(x[:1], y[:1], marker="D", color=colour, markersize=4.5, linestyle="")
    if np.isfinite([x[0], y[0]]).all():
        axis.annotate("start", (x[0], y[0]), xytext=(5, 4), textcoords="offset points", fontsize=7.5, color="#444444")


def _parts(run: Curves, look: Look, alone: bool) -> list[tuple[Look, Array]]:
    """Divide the points by mode, each with its colour; all in one where there are no colours to tell modes by."""
    if not alone or len(run.modes) < 2 or SEVERAL in run.modes:
        return [(look, np.ones(len(run.samples), dtype=bool))]
    shades = colours(run.modes).items()
    return [({**look, "color": curve(colour)}, run.samples.mode == mode) for mode, colour in shades]
