# pyright: reportUnknownMemberType=false
"""One state or output over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.plot.curves import (
    SEVERAL,
    Array,
    Curves,
    GuardLine,
    limits_of,
    line,
    merged,
    modes_of,
    moving_levels,
)
from hsdsl.analysis.plot.style import ALARM, FAINT, INK, LETTER, Look, fills, looks, whole_ticks
from hsdsl.analysis.plot.view import View
from hsdsl.base.names import shown
from hsdsl.base.parts import parts_in, short_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

MOST_BANDS = 9  # modes whose colours and hatches differ
MOST_ROWS = 40  # of bars of modes that each have a name
BOTH_SIDES = 60  # transitions up to which the values before and after are marked
AFTER_ONLY = 400  # and up to which the value after is
LONGEST = 24  # letters of a run's label


def draw_panel(
    axis: Axes, runs: Sequence[Curves], name: str, guards: Sequence[GuardLine], view: View, room: float
) -> None:
    """Draw one run with the bands of its modes and the levels of guards, or several with a look for each.

    The panel is about ``room`` inches wide.
    """
    start, end = min(run.span[0] for run in runs), max(run.span[1] for run in runs)
    if start == end:
        start, end = start - 0.5, end + 0.5
    levels = [guard.value for guard in guards if guard.moving is None]
    for _, _, values in moving_levels(runs, guards):
        levels += [float(end) for end in (np.nanmin(values), np.nanmax(values))] if np.isfinite(values).any() else []
    low, high = with_guards(limits_of(runs, name), levels)
    axis.set_xlim(start - 0.008 * (end - start), end + 0.008 * (end - start))  # room for markers at the ends
    axis.set_ylim(low, high)
    if len(runs) == 1:
        if len(runs[0].modes) <= MOST_BANDS:
            draw_bands(axis, runs[0])
        _draw_guards(axis, runs[0], [guard for guard in guards if guard.moving is None], (low, high), room)
    elif guards:
        _draw_levels(axis, guards)
    _draw_moving(axis, runs, guards)
    for run, look in zip(runs, looks(len(runs)), strict=True):
        _draw_curve(axis, run, name, look, (start, end, low, high))
    whole_ticks(axis.yaxis, np.concatenate([run.column(name) for run in runs]))
    if not any(run.has_values(name) for run in runs):
        axis.text(0.5, 0.5, "no value in this run", transform=axis.transAxes, ha="center", va="center", color=FAINT)
    axis.set_ylabel(label(name, view.units), parse_math=False)


def _draw_curve(axis: Axes, run: Curves, name: str, look: Look, ends: tuple[float, float, float, float]) -> None:
    values, time = run.column(name), run.samples.time
    x, y = line(time, values, run.begins, ends)
    axis.plot(x, y, linewidth=1.3, rasterized=len(x) > 60_000, label=name, **look)
    mark_jumps(axis, time, values, run.jumps, look["color"])
    if len(time) == 1:
        axis.plot(time, values, "o", color=look["color"], markersize=4)
    if run.ends_badly:
        colour = ALARM if look["color"] == INK else look["color"]  # of several runs each has its own
        axis.axvline(run.span[1], color=colour, linewidth=1.2, linestyle=look["linestyle"])


def label(name: str, units: Mapping[str, str]) -> str:
    """Label an axis with name and unit."""
    return f"{name} [{units[name]}]" if name in units else name


def time_label(units: Mapping[str, str]) -> str:
    """Label an axis of time."""
    return label("time t", {"time t": units["t"]} if "t" in units else {})


def draw_bands(axis: Axes, data: Curves) -> None:
    """Colour the background by mode."""
    for mode, fill in fills(data.modes).items():
        spans = [(begin, end - begin) for name, begin, end in data.bands if name == mode]
        axis.broken_barh(spans, (0, 1), transform=axis.get_xaxis_transform(), zorder=0, label=mode, **fill)


def rows_of(run: Curves) -> dict[str, list[tuple[str, float, float]]]:
    """Bars of many modes by what is written beside them: for each part with several modes, else for each mode."""
    parts = parts_in([mode for mode in run.modes if mode != SEVERAL])
    if parts is None:
        return {mode: [band for band in run.bands if band[0] == mode] for mode in run.modes}
    return {
        part: merged([(modes.get(mode, SEVERAL), begin, end) for mode, begin, end in run.bands])
        for part, modes in parts.items()
    }


def draw_rows(axis: Axes, run: Curves) -> list[Patch]:
    """Draw the modes of one run as rows of bars; return what a legend says of them: nothing where rows are modes."""
    from matplotlib.patches import Patch

    rows = rows_of(run)
    named = dict.fromkeys(mode for bands in rows.values() for mode, _, _ in bands)
    by_part = [*named] != [*rows]
    one: Look = {"facecolor": INK, "linewidth": 0}
    fill = fills([*named], light=False) if by_part else dict.fromkeys(named, one)
    for row, bands in enumerate(rows.values()):
        for mode in dict.fromkeys(mode for mode, _, _ in bands):
            spans = [(begin, end - begin) for name, begin, end in bands if name == mode]
            axis.broken_barh(spans, (row - 0.4, 0.8), **fill[mode])
    _rows_named(axis, [*rows])
    return [Patch(label=shown(mode, LONGEST), **fill[mode]) for mode in named] if by_part else []


def _rows_named(axis: Axes, names: Sequence[str]) -> None:
    axis.set_ylim(len(names) - 0.5, -0.5)
    named = range(0, len(names), -(-len(names) // MOST_ROWS))
    axis.set_yticks(named, [shown(names[row], LONGEST) for row in named])
    for text in axis.get_yticklabels():
        text.set_parse_math(False)
    axis.tick_params(left=False, labelbottom=False)
    axis.spines["left"].set_visible(False)


def draw_ribbons(axis: Axes, runs: Sequence[Curves], labels: Sequence[str]) -> None:
    """Draw a bar of modes for each run, the first on top."""
    fill = fills(modes_of(runs), light=False)
    for row, run in enumerate(runs):
        for mode in run.modes:
            spans = [(begin, end - begin) for name, begin, end in run.bands if name == mode]
            axis.broken_barh(spans, (row - 0.4, 0.8), label=mode, **fill[mode])
    _rows_named(axis, labels)


def raise_of(axis: Axes) -> float:
    """Points by which what is above an axis is raised: where its numbers have a common power of ten, that is there."""
    form = axis.yaxis.get_major_formatter()
    form.set_locs(list(axis.yaxis.get_majorticklocs()))
    return 10.0 if form.get_offset() else 0.0


def name_bands(axis: Axes, data: Curves, width: float) -> bool:
    """Write each mode's name above its first wide band, if every name fits somewhere; return whether it did."""
    raised, names = raise_of(axis), short_names(data.modes)
    start, end = data.span
    places: dict[str, tuple[float, float]] = {}
    for mode, begin, stop in data.bands:
        if (stop - begin) / (end - start) * width > LETTER * (len(names[mode]) + 2):
            places.setdefault(mode, (begin, stop))
    if len(places) < len(data.modes) or len(data.bands) > 3 * len(data.modes) + 6:
        return False
    for mode, (begin, _) in places.items():
        axis.annotate(
            names[mode], (begin, 1), xycoords=axis.get_xaxis_transform(), xytext=(2, 2 + raised),
            textcoords="offset points", va="bottom", ha="left", fontsize=8, color="#444444", parse_math=False,
        )  # fmt: skip
    return True


def mark_jumps(axis: Axes, x: Array, y: Array, jumps: Array, colour: str) -> None:
    """Mark transitions: open circles before, full ones after; fewer and smaller the more there are."""
    if not len(jumps) or len(jumps) > AFTER_ONLY:
        return
    few = len(jumps) <= BOTH_SIDES
    size = 4.0 if len(jumps) <= 20 else 3.0 if few else 1.8
    if few:
        hollow: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 0.9}
        axis.plot(x[jumps - 1], y[jumps - 1], "o", color=colour, markersize=size, **hollow)
    axis.plot(x[jumps], y[jumps], "o", color=colour, markersize=size, markeredgewidth=0.0)


def with_guards(ends: tuple[float, float], levels: Sequence[float]) -> tuple[float, float]:
    """Widen an axis for the levels that are near it, with room for their labels."""
    low, high = ends
    size = high - low
    for level in levels:
        if low - size / 2 < level < high + size / 2:
            if level > (ends[0] + ends[1]) / 2:
                high = max(high, level + 0.17 * size)
            else:
                low = min(low, level - 0.17 * size)
    return low, high


def _draw_moving(axis: Axes, runs: Sequence[Curves], guards: Sequence[GuardLine]) -> None:
    """Draw guards that move as dotted lines, each with its label at its last time."""
    named = set[str]()
    for guard, times, values in moving_levels(runs, guards):
        text, finite = guard.label, np.flatnonzero(np.isfinite(values))
        if not len(finite):
            continue
        axis.plot(times, values, color="#444444", linestyle="dotted", linewidth=1.1, zorder=1)
        if text not in named:
            named.add(text)
            last = finite[-1]
            label = axis.annotate(
                shown(text, LONGEST), (times[last], values[last]), xytext=(-3, -4), textcoords="offset points",
                ha="right", va="top", fontsize=7.5, color="#444444", parse_math=False,
            )  # fmt: skip
            label.set_in_layout(False)


def _draw_levels(axis: Axes, guards: Sequence[GuardLine]) -> None:
    for level in dict.fromkeys(guard.value for guard in guards if guard.moving is None):
        axis.axhline(level, color="#444444", linestyle="dotted", linewidth=1.1, zorder=1)


def _draw_guards(axis: Axes, data: Curves, guards: Sequence[GuardLine], ends: tuple[float, float], room: float) -> None:
    """Draw each level where its modes are occupied, and label it at the end; labels that would collide become one."""
    low, high = ends
    longest = max((len(guard.label) for guard in guards), default=0)
    share = max(0.15, 1.2 * longest * LETTER / room)
    near = share * (data.span[1] - data.span[0]), 0.04 * (high - low)
    labels: dict[tuple[float, float], list[str]] = {}
    for label, level in dict.fromkeys((guard.label, guard.value) for guard in guards):
        modes = {SEVERAL, *(guard.mode for guard in guards if (guard.label, guard.value) == (label, level))}
        spans = [(begin, end) for mode, begin, end in data.bands if mode in modes]
        if not spans or not low < level < high:
            continue
        begins, stops = [begin for begin, _ in spans], [end for _, end in spans]
        axis.hlines([level] * len(spans), begins, stops, colors="#444444", linestyles="dotted", linewidth=1.1)
        close = (at for at in labels if abs(at[0] - stops[-1]) < near[0] and abs(at[1] - level) < near[1])
        labels.setdefault(next(close, (stops[-1], level)), []).append(label)
    start, whole = data.span[0], (data.span[1] - data.span[0]) or 1
    for (end, level), texts in labels.items():
        above, distinct = level > (low + high) / 2, list(dict.fromkeys(texts))
        before = len(distinct[0]) <= (end - start) / whole * room / LETTER  # else the axis would cut it off
        joined = _joined(distinct, int(((end - start) / whole if before else 1) * room / LETTER))
        at, shift, side = (end, -3, "right") if before else (start, 3, "left")
        text = axis.annotate(
            joined, (at, level), xytext=(shift, 4 if above else -4), textcoords="offset points",
            ha=side, va="bottom" if above else "top", fontsize=7.5, color="#444444", parse_math=False,
        )  # fmt: skip
        text.set_bbox({"facecolor": "white", "alpha": 0.55, "linewidth": 0, "pad": 0.8})
        text.set_in_layout(False)


def _joined(texts: Sequence[str], most: int) -> str:
    """Join labels, as many as fit, with how many there are more; at least one."""
    count = next((k for k in range(len(texts), 1, -1) if len(", ".join(texts[:k])) + 9 * (k < len(texts)) <= most), 1)
    more = f" and {len(texts) - count} more" if count < len(texts) else ""
    return (", ".join(texts[:count]) if count > 1 else shown(texts[0], max(LONGEST, most - len(more)))) + more
