# pyright: reportUnknownMemberType=false
"""The figure of one run or of several: panels over time, phase plots, headings and legend."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecFromSubplotSpec
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from hsdsl.analysis.plot.curves import (
    SEVERAL,
    Array,
    Curves,
    GuardLine,
    Pair,
    View,
    curves,
    limits_of,
    line,
    merged,
    modes_of,
    moving_levels,
)
from hsdsl.analysis.plot.style import (
    ALARM,
    FAINT,
    INK,
    LETTER,
    Look,
    colours,
    curve,
    fills,
    label,
    legend_below,
    looks,
    time_label,
    whole_ticks,
)
from hsdsl.analysis.report import words
from hsdsl.base.names import shown
from hsdsl.base.parts import parts_in, short_names
from hsdsl.engine.execution import Execution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase
    from matplotlib.patches import Patch


MARGIN = 0.9  # inches for title and time axis
HEIGHTS = {1: 3.2, 2: 2.3, 3: 1.9, 4: 1.7}  # of a panel, by panels on top of each other
LOWEST = 1.5
WIDTHS = {1: 9.0, 2: 13.0, 3: 16.0}  # of the panels, by panels side by side
RIBBON, LINE = 0.28, 0.2  # inches of a run's ribbon, and of a line of text
SMALLEST, LARGEST = 3.6, 5.2  # of a phase plot
LONGEST = 40  # letters of a name in the legend


class Plan(NamedTuple):
    """The rows and columns of panels and of phase plots, and the inches that they take."""

    across: int
    down: int
    phase_across: int
    phase_down: int
    ribbon: float
    width: float
    phase: float
    height: float

    @classmethod
    def of(cls, names: int, pairs: int, rows: int) -> Plan:
        """Give every panel room to be read; ``rows`` of bars above them show modes."""
        across = 1 if names <= 6 else 2 if names <= 16 else 3
        down = max(1, -(-names // across))
        ribbon = RIBBON * min(rows, MOST_ROWS) + LINE if rows > 1 else 0.0
        height = down * HEIGHTS.get(down, LOWEST) + ribbon
        phase_down = min(pairs, max(1, round(height / LARGEST), ceil(sqrt(pairs))))
        phase_across = -(-pairs // phase_down) if pairs else 0
        phase = min(max(height / phase_down, SMALLEST), LARGEST) if pairs else 0.0
        return cls(
            across, down, phase_across, phase_down, ribbon, WIDTHS[across], phase, max(height, phase * phase_down)
        )

    @property
    def room(self) -> float:
        """The inches of a panel's width."""
        return self.width / self.across - 0.8

    @property
    def size(self) -> tuple[float, float]:
        """The inches of the whole figure."""
        return self.width + self.phase * self.phase_across, self.height + MARGIN


def picture(runs: Sequence[Execution], view: View) -> Figure:
    """Draw runs to a figure of their own."""
    figure = Figure(figsize=size_of(runs, view), layout="constrained")
    draw(runs, view, figure)
    return figure


def size_of(runs: Sequence[Execution], view: View) -> tuple[float, float]:
    """Return the inches that a figure of runs takes."""
    many = len(runs) == 1 and len({arc.mode for arc in runs[0].arcs}) > MOST_BANDS
    rows = _rows([curves(runs[0])]) if many else 0 if len(runs) == 1 else len(runs)
    return Plan.of(len(view.names(runs)), len(view.pairs(runs)), rows).size


def _rows(data: Sequence[Curves]) -> int:
    """How many rows of bars show modes: one for each of several runs; of one run, where it has many modes."""
    if len(data) > 1:
        return len(data)
    return max(2, len(rows_of(data[0]))) if len(data[0].modes) > MOST_BANDS else 0


def draw(runs: Sequence[Execution], view: View, figure: FigureBase) -> list[Axes]:
    """Draw runs to a figure; return the axes: panels over time, then phase plots."""
    names, pairs, labels = view.names(runs), view.pairs(runs), view.called(runs)
    data = [curves(run) for run in runs]
    plan = Plan.of(len(names), len(pairs), _rows(data))
    visited = {arc.mode for run in runs for arc in run.arcs}
    guards = [guard for guard in view.guards if guard.mode in visited]
    widths = [plan.width, plan.phase * plan.phase_across] if pairs else [1]
    outer = figure.add_gridspec(1, len(widths), width_ratios=widths)
    ribbon, panels = _panels(figure, outer[0, 0], plan, max(1, len(names)))
    for name, axis in zip(names, panels, strict=False):
        draw_panel(axis, data, name, [guard for guard in guards if guard.state == name], view, plan.room)
    _time_labels(panels, plan.across, view)
    rows: list[Patch] | None = None
    if ribbon is not None and len(data) == 1:
        rows = draw_rows(ribbon, data[0])
    elif ribbon is not None:
        draw_ribbons(ribbon, data, labels)
    phases = _phases(figure, outer[0, 1], plan, pairs, data, guards, view) if pairs else []
    _headings(figure, ribbon or panels[0], runs, view, plan)
    _legend(figure, panels[0], data, labels, plan, rows)
    if isinstance(figure, Figure):
        figure.align_ylabels(panels)
    return [*panels, *phases]


def _panels(figure: FigureBase, place: Any, plan: Plan, count: int) -> tuple[Axes | None, list[Axes]]:
    """Add the axes of the ribbons, where there are any, and of the panels."""
    ratios = [plan.ribbon, *[(plan.height - plan.ribbon) / plan.down] * plan.down][plan.ribbon == 0 :]
    grid = GridSpecFromSubplotSpec(len(ratios), plan.across, subplot_spec=place, height_ratios=ratios)
    first = len(ratios) - plan.down
    axes: list[Axes] = []
    for i in range(count):
        shared = axes[0] if axes else None
        axes.append(figure.add_subplot(grid[first + i // plan.across, i % plan.across], sharex=shared))
    return (figure.add_subplot(grid[0, :], sharex=axes[0]) if first else None), axes


def _phases(
    figure: FigureBase,
    place: Any,
    plan: Plan,
    pairs: Sequence[Pair],
    data: Sequence[Curves],
    guards: Sequence[GuardLine],
    view: View,
) -> list[Axes]:
    grid = GridSpecFromSubplotSpec(plan.phase_down, plan.phase_across, subplot_spec=place)
    axes = [figure.add_subplot(grid[i % plan.phase_down, i // plan.phase_down]) for i in range(len(pairs))]
    for axis, pair in zip(axes, pairs, strict=True):
        draw_phase(axis, data, pair, guards, view)
    return axes


def _time_labels(axes: Sequence[Axes], across: int, view: View) -> None:
    for i, axis in enumerate(axes):
        if i + across < len(axes):
            axis.tick_params(labelbottom=False)
        else:
            axis.set_xlabel(time_label(view.units), parse_math=False)


def _headings(figure: FigureBase, top: Axes, runs: Sequence[Execution], view: View, plan: Plan) -> None:
    heading = view.title or ", ".join(dict.fromkeys(map(words.heading, runs)))
    heading = textwrap.fill(heading, int(plan.size[0] * 10))
    figure.suptitle(heading, x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    facts = _facts(runs[0]) if len(runs) == 1 else _facts_of_several(runs)
    facts = textwrap.fill(facts, int(plan.width / (plan.across if len(runs) == 1 else 1) * 14))
    pad = 16 + raise_of(top) if plan.ribbon == 0 else 6
    top.set_title(facts, loc="left", fontsize=8.5, color="#555555", pad=pad, parse_math=False)


def _facts(run: Execution) -> str:
    count = len(run.transitions)
    made = f"{run.scheme} {run.method}, {count:,} transition{'' if count == 1 else 's'}"
    if not run.stop.complete:
        return f"{made}, stopped: {words.stop(run)}"
    how = "until" if run.stop.reason == "until" else "final mode entered at"
    return f"{made}, {how} t = {words.number(run.stop.time, 8)}"


def _facts_of_several(runs: Sequence[Execution]) -> str:
    badly = sum(not run.stop.complete for run in runs)
    return f"{len(runs)} runs" + (f", {badly} stopped before the end" if badly else "")


def _legend(
    figure: FigureBase,
    top: Axes,
    data: Sequence[Curves],
    labels: Sequence[str],
    plan: Plan,
    rows_shown: list[Patch] | None,
) -> None:
    """Write names of modes above their bands, or in a legend below everything, where it covers nothing."""
    modes = modes_of(data)
    names = short_names(modes)
    handles: list[Any] = []
    if rows_shown is not None:
        handles = [*rows_shown]
    elif len(data) > 1:
        handles = [
            Line2D([], [], linewidth=1.6, label=shown(label, LONGEST), **look)
            for label, look in zip(labels, looks(len(data)), strict=True)
        ]
        handles += [
            Patch(label=shown(names[mode], LONGEST), **fill) for mode, fill in fills(modes, light=False).items()
        ]
    elif (shares := data[0].shares) is not None:
        named = short_names([*shares.of])
        handles = [
            Patch(label=f"{shown(named[mode], LONGEST)}, share of the time", **fill)
            for mode, fill in fills([*shares.of]).items()
        ]
    elif modes and not name_bands(top, data[0], plan.room):
        handles = [Patch(label=shown(names[mode], LONGEST), **fill) for mode, fill in fills(modes).items()]
    rows = legend_below(figure, handles, plan.size[0])
    if isinstance(figure, Figure):
        figure.set_figheight(figure.get_figheight() + rows * LINE)


MOST_BANDS = 9  # modes whose colours and hatches differ
MOST_ROWS = 40  # of bars of modes that each have a name
BOTH_SIDES = 60  # transitions up to which the values before and after are marked
AFTER_ONLY = 400  # and up to which the value after is
LONGEST_LABEL = 24  # letters of a run's label


def draw_panel(
    axis: Axes, runs: Sequence[Curves], name: str, guards: Sequence[GuardLine], view: View, room: float
) -> None:
    """Draw one run with the bands of its modes and the levels of guards, or several, each in a style of its own.

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
            _draw_bands(axis, runs[0])
        _draw_guards(axis, runs[0], [guard for guard in guards if guard.moving is None], (low, high), room)
    elif guards:
        for level in dict.fromkeys(guard.value for guard in guards if guard.moving is None):
            axis.axhline(level, color="#444444", linestyle="dotted", linewidth=1.1, zorder=1)
    _draw_moving(axis, runs, guards)
    for run, look in zip(runs, looks(len(runs)), strict=True):
        _draw_curve(axis, run, name, look, (start, end, low, high))
    whole_ticks(axis.yaxis, np.concatenate([run.column(name) for run in runs]))
    if not any(run.has_values(name) for run in runs):
        axis.text(0.5, 0.5, "no value in this run", transform=axis.transAxes, ha="center", va="center", color=FAINT)
    axis.set_ylabel(label(name, view.units), parse_math=False)


def _draw_bands(axis: Axes, run: Curves) -> None:
    """Draw a band for each stay in a mode; of very many, areas as high as the mode's share of the time there."""
    whole: Look = {"transform": axis.get_xaxis_transform(), "zorder": 0}
    if run.shares is None:
        for mode, fill in fills(run.modes).items():
            spans = [(begin, end - begin) for name, begin, end in run.bands if name == mode]
            axis.broken_barh(spans, (0, 1), label=mode, **whole, **fill)
        return
    low = np.zeros(len(run.shares.edges))
    for mode, fill in fills([*run.shares.of]).items():
        share = run.shares.of[mode]
        high = low + np.append(share, share[-1])
        axis.fill_between(run.shares.edges, low, high, step="post", label=mode, **whole, **fill)
        low = high


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
    return [Patch(label=shown(mode, LONGEST_LABEL), **fill[mode]) for mode in named] if by_part else []


def _rows_named(axis: Axes, names: Sequence[str]) -> None:
    axis.set_ylim(len(names) - 0.5, -0.5)
    named = range(0, len(names), -(-len(names) // MOST_ROWS))
    axis.set_yticks(named, [shown(names[row], LONGEST_LABEL) for row in named])
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
                shown(text, LONGEST_LABEL), (times[last], values[last]), xytext=(-3, -4), textcoords="offset points",
                ha="right", va="top", fontsize=7.5, color="#444444", parse_math=False,
            )  # fmt: skip
            label.set_in_layout(False)


def _draw_guards(axis: Axes, data: Curves, guards: Sequence[GuardLine], ends: tuple[float, float], room: float) -> None:
    """Draw each level where its modes are occupied, and label it at the end; labels that would collide become one."""
    low, high = ends
    longest = max((len(guard.label) for guard in guards), default=0)
    share = max(0.15, 1.2 * longest * LETTER / room)
    near = share * (data.span[1] - data.span[0]), 0.04 * (high - low)
    labels: dict[tuple[float, float], list[str]] = {}
    for name, level in dict.fromkeys((guard.label, guard.value) for guard in guards):
        modes = {SEVERAL, *(guard.mode for guard in guards if (guard.label, guard.value) == (name, level))}
        spans = [(begin, end) for mode, begin, end in data.bands if mode in modes]
        if not spans or not low < level < high:
            continue
        begins, stops = [begin for begin, _ in spans], [end for _, end in spans]
        axis.hlines([level] * len(spans), begins, stops, colors="#444444", linestyles="dotted", linewidth=1.1)
        close = (at for at in labels if abs(at[0] - stops[-1]) < near[0] and abs(at[1] - level) < near[1])
        labels.setdefault(next(close, (stops[-1], level)), []).append(name)
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
    return (", ".join(texts[:count]) if count > 1 else shown(texts[0], max(LONGEST_LABEL, most - len(more)))) + more


LEVEL: dict[str, Any] = {"color": "#444444", "linestyle": "dotted", "linewidth": 1.1}


def draw_phase(axis: Axes, runs: Sequence[Curves], pair: Pair, guards: Sequence[GuardLine], view: View) -> None:
    """Draw one run coloured by mode where it has several, or several, each in a style of its own; guards are dotted."""
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
