# pyright: reportUnknownMemberType=false
"""The figure of one run or of several: a strip of modes, panels over time, phase plots, headings and legend."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
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
    moving_levels,
)
from hsdsl.analysis.plot.strip import LINE, LONGEST_LABEL, MOST_BANDS, Strip
from hsdsl.analysis.plot.style import (
    ALARM,
    FAINT,
    INK,
    LETTER,
    MOST_DASHED,
    Look,
    colours,
    curve,
    fills,
    heading,
    label,
    legend_below,
    looks,
    time_label,
    whole_ticks,
)
from hsdsl.analysis.report import words
from hsdsl.base.names import shown
from hsdsl.base.parts import short_names
from hsdsl.engine.execution import Execution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

MARGIN = 0.9  # inches for title and time axis
HEIGHTS = {1: 3.2, 2: 2.3, 3: 1.9, 4: 1.7}  # of a panel, by panels on top of each other
LOWEST = 1.5
WIDTHS = {1: 9.0, 2: 13.0, 3: 16.0}  # of the panels, by panels side by side
SMALLEST, LARGEST = 3.6, 5.2  # of a phase plot
LONGEST = 40  # letters of a name in the legend
MOST_LABELS = 3  # of guards on top of each other
BOTH_SIDES = 60  # transitions up to which each is marked, with the values before and after
AFTER_ONLY = 400  # and up to which the values after jumps are
MOST_MARKED = 4  # curves in a panel whose transitions are marked
LEVEL: dict[str, Any] = {"color": "#444444", "linestyle": "dotted", "linewidth": 1.1}
SMALL: dict[str, Any] = {"fontsize": 7.5, "color": "#444444", "parse_math": False}
NAME: dict[str, Any] = {**SMALL, "fontsize": 8}


class Plan(NamedTuple):
    """The rows and columns of panels and of phase plots, and the inches that they take."""

    across: int
    down: int
    phase_across: int
    phase_down: int
    strip: float
    width: float
    phase: float
    height: float

    @classmethod
    def of(cls, panels: int, pairs: int, strip: Strip | None) -> Plan:
        """Give every panel room to be read."""
        across = 1 if panels <= 6 else 2 if panels <= 16 else 3
        down = max(1, -(-panels // across))
        above = strip.inches if strip else 0.0
        height = down * HEIGHTS.get(down, LOWEST) + above
        phase_down = min(pairs, max(1, round(height / LARGEST), ceil(sqrt(pairs))))
        phase_across = -(-pairs // phase_down) if pairs else 0
        phase = min(max(height / phase_down, SMALLEST), LARGEST) if pairs else 0.0
        return cls(
            across, down, phase_across, phase_down, above, WIDTHS[across], phase, max(height, phase * phase_down)
        )

    @property
    def room(self) -> tuple[float, float]:
        """About the inches of a panel's width and height."""
        return self.width / self.across - 0.8, (self.height - self.strip) / self.down - 0.3

    @property
    def size(self) -> tuple[float, float]:
        """The inches of the whole figure."""
        return self.width + self.phase * self.phase_across, self.height + MARGIN


def picture(runs: Sequence[Execution], view: View) -> Figure:
    """Draw runs to a figure of their own."""
    made: list[Figure] = []

    def figure(size: tuple[float, float]) -> Figure:
        made.append(Figure(figsize=size, layout="constrained"))
        return made[0]

    draw(runs, view, figure)
    return made[0]


def draw(runs: Sequence[Execution], view: View, make: Callable[[tuple[float, float]], FigureBase]) -> list[Axes]:
    """Draw runs to a figure made for its inches; return the axes: panels over time, then phase plots."""
    shown_panels, pairs, labels = view.panels(runs), view.pairs(runs), view.called(runs)
    data = [curves(run) for run in runs]
    strip = Strip.of(data, labels)
    plan = Plan.of(len(shown_panels), len(pairs), strip)
    figure = make(plan.size)
    visited = {arc.mode for run in runs for arc in run.arcs}
    view = replace(view, guards=[guard for guard in view.guards if guard.mode in visited])
    widths = [plan.width, plan.phase * plan.phase_across] if pairs else [1]
    outer = figure.add_gridspec(1, len(widths), width_ratios=widths)
    ribbon, panels = _panels(figure, outer[0, 0], plan, max(1, len(shown_panels)))
    for (name, columns), axis in zip(shown_panels.items(), panels, strict=False):
        draw_panel(axis, data, columns, view, plan.room[1])
        axis.set_ylabel(label(name, view.units), parse_math=False)
    for i, axis in enumerate(panels):
        if i + plan.across < len(panels):
            axis.tick_params(labelbottom=False)
        else:
            axis.set_xlabel(time_label(view.units), parse_math=False)
    if ribbon is not None and strip is not None:
        strip.draw(ribbon, labels if len(data) > 1 else [*strip.rows])
    phases = _phases(figure, outer[0, 1], plan, pairs, data, view) if pairs else []
    top = ribbon or panels[0]
    title = view.title or ", ".join(dict.fromkeys(map(words.heading, runs)))
    badly = sum(not run.stop.complete for run in runs)
    several = f"{len(runs)} runs" + f", {badly} stopped before the end" * bool(badly)
    facts = _facts(runs[0]) if len(runs) == 1 else several
    heading(figure, title, facts, top, 6 if ribbon else 16 + _raise_of(top))
    handles = modes_named(panels[0], data[0], strip, plan.room[0]) if len(data) == 1 else _runs_named(labels, strip)
    columns = [name for each in shown_panels.values() for name in each if len(each) <= MOST_MARKED]
    rows = legend_below(
        figure, [*_of_families(shown_panels), *handles, *marks(data, columns, bool(pairs))], plan.size[0]
    )
    if isinstance(figure, Figure):
        figure.set_figheight(figure.get_figheight() + rows * LINE)
        figure.align_ylabels(panels)
    return [*panels, *phases]


def _panels(figure: FigureBase, place: Any, plan: Plan, count: int) -> tuple[Axes | None, list[Axes]]:
    """Add the axes of the strip, where there is one, and of the panels."""
    ratios = [plan.strip, *[(plan.height - plan.strip) / plan.down] * plan.down][plan.strip == 0 :]
    grid = GridSpecFromSubplotSpec(len(ratios), plan.across, subplot_spec=place, height_ratios=ratios)
    first = len(ratios) - plan.down
    axes: list[Axes] = []
    for i in range(count):
        shared = axes[0] if axes else None
        axes.append(figure.add_subplot(grid[first + i // plan.across, i % plan.across], sharex=shared))
    return (figure.add_subplot(grid[0, :], sharex=axes[0]) if first else None), axes


def _phases(
    figure: FigureBase, place: Any, plan: Plan, pairs: Sequence[Pair], data: Sequence[Curves], view: View
) -> list[Axes]:
    grid = GridSpecFromSubplotSpec(plan.phase_down, plan.phase_across, subplot_spec=place)
    axes = [figure.add_subplot(grid[i % plan.phase_down, i // plan.phase_down]) for i in range(len(pairs))]
    for axis, pair in zip(axes, pairs, strict=True):
        draw_phase(axis, data, pair, view)
    return axes


def _facts(run: Execution) -> str:
    count = len(run.transitions)
    made = f"{run.scheme} {run.method}, {count:,} transition{'' if count == 1 else 's'}"
    if not run.stop.complete:
        return f"{made}, stopped: {words.stop(run)}"
    how = "until" if run.stop.reason == "until" else "final mode entered at"
    return f"{made}, {how} t = {words.number(run.stop.time, 8)}"


def modes_named(top: Axes, run: Curves, strip: Strip | None, width: float) -> list[Patch]:
    """Write names of modes above their bands, or return what a legend says of them."""
    if strip is None:
        names = short_names(run.modes)
        above = not run.modes or _name_bands(top, run, width, names)
        return [] if above else [Patch(label=shown(names[m], LONGEST), **fill) for m, fill in fills(run.modes).items()]
    return _strip_named(strip)


def _strip_named(strip: Strip) -> list[Patch]:
    """What a legend says of the modes in a strip: nothing where its rows are modes."""
    if [*strip.fill] == [*strip.rows]:
        return []
    names, of = short_names([*strip.fill]), ", share of the time" if strip.shares else ""
    return [Patch(label=shown(names[mode], LONGEST) + of, **fill) for mode, fill in strip.fill.items()]


def _runs_named(labels: Sequence[str], strip: Strip | None) -> list[Any]:
    """What a legend says of several runs; of very many it names some."""
    each, count = looks(len(labels)), len(labels)
    chosen = range(count) if count <= MOST_DASHED else [k * (count - 1) // 4 for k in range(5)]
    lines = [Line2D([], [], label=shown(labels[k], LONGEST), **each[k]) for k in chosen]
    return [*lines, *(_strip_named(strip) if strip else [])]


def _of_families(panels: Mapping[str, Sequence[str]]) -> list[Line2D]:
    """What a legend says of panels that each show the columns of many parts; of very many it names the ends."""
    columns = max(panels.values(), key=len, default=())
    each = looks(len(columns))
    ends = [0, -1] if len(columns) > MOST_DASHED else range(len(columns)) if len(columns) > 1 else ()
    return [Line2D([], [], label=columns[k].rpartition(".")[0], **each[k]) for k in ends]


def marks(data: Sequence[Curves], columns: Sequence[str], start: bool, name: str = "start") -> list[Line2D]:
    """What a legend says of the marks at transitions, and at the start where it has one."""
    look: Look = {"color": INK, "linestyle": "", "markersize": 4}
    found = [Line2D([], [], marker="D", label=name, **look)] if start else []
    look["marker"] = "o"
    all_made = [(run, column, len(run.jumps_of(column))) for run in data for column in columns]
    made = [each for each in all_made if 0 < each[2] <= AFTER_ONLY] if len(data) <= MOST_MARKED else []
    few = [each for each in made if each[2] <= BOTH_SIDES]
    if any(_jumps(run, column) for run, column, _ in few):
        hollow: Look = {"markerfacecolor": "white", "markeredgewidth": 0.9}
        return [*found, Line2D([], [], label="before a jump", **look, **hollow), Line2D([], [], label="after", **look)]
    if any(_jumps(run, column) for run, column, _ in made):
        return [*found, Line2D([], [], label="after a jump", **look)]
    return [*found, *([Line2D([], [], label="transition", **look)] if few else [])]


def _jumps(run: Curves, name: str) -> bool:
    """Whether a column jumps at a transition by more than its error, or has a value only before or only after it."""
    values = run.column(name)
    known = values[np.isfinite(values)]
    before, after = values[run.jumps - 1], values[run.jumps]
    apart = np.abs(after - before) > run.error * np.max(np.abs(known), initial=0.0)
    return bool(np.any(apart | (np.isfinite(before) != np.isfinite(after))))


def draw_panel(axis: Axes, runs: Sequence[Curves], names: Sequence[str], view: View, tall: float) -> None:
    """Draw a column of one run with its bands and levels of guards, or of several; or many columns of the run.

    The panel is about ``tall`` inches high.
    """
    start, end = min(run.span[0] for run in runs), max(run.span[1] for run in runs)
    if start == end:
        start, end = start - 0.5, end + 0.5
    guards = [guard for guard in view.guards if guard.state in names]
    moving = list(moving_levels(runs, guards))
    levels = [guard.value for guard in guards if guard.moving is None]
    levels += [float(end(v)) for *_, v in moving if np.isfinite(v).any() for end in (np.nanmin, np.nanmax)]
    ends = np.array([limits_of(runs, name) for name in names])
    low, high = with_guards((ends[:, 0].min(), ends[:, 1].max()), levels)
    axis.set_xlim(start - 0.008 * (end - start), end + 0.008 * (end - start))  # room for markers at the ends
    axis.set_ylim(low, high)
    if Strip.of(runs, [""] * len(runs)) is None and len(runs) == 1:
        first = runs[0]
        for mode, fill in fills(first.modes).items():
            spans = [(begin, end - begin) for name, begin, end in first.bands if name == mode]
            axis.broken_barh(spans, (0, 1), label=mode, transform=axis.get_xaxis_transform(), zorder=0, **fill)
    _draw_guards(axis, runs, guards, moving, tall)
    several = [(run, name) for run in runs for name in names]
    each = looks(len(several)) if len(runs) == 1 else [look for look in looks(len(runs)) for _ in names]
    for (run, name), look in zip(several, each, strict=True):
        values, time = run.column(name), run.samples.time
        x, y = line(time, values, run.begins, (start, end, low, high))
        wide: Look = {"linewidth": 1.3, **look}
        axis.plot(x, y, rasterized=len(x) > 60_000, label=name, **wide)
        if len(several) <= MOST_MARKED:
            mark_jumps(axis, time, values, run.jumps_of(name), look["color"])
        if len(time) == 1:
            axis.plot(time, values, "o", color=look["color"], markersize=4)
        if run.ends_badly:
            colour = ALARM if look["color"] == INK else look["color"]  # of several runs each has its own
            axis.axvline(run.span[1], color=colour, linewidth=1.2, linestyle=look["linestyle"])
    whole_ticks(axis.yaxis, np.concatenate([run.column(name) for run, name in several]))
    if not any(run.has_values(name) for run, name in several):
        axis.text(0.5, 0.5, "no value in this run", transform=axis.transAxes, ha="center", va="center", color=FAINT)


def _raise_of(axis: Axes) -> float:
    """Points by which what is above an axis is raised: where its numbers have a common power of ten, that is there."""
    form = axis.yaxis.get_major_formatter()
    form.set_locs(list(axis.yaxis.get_majorticklocs()))
    return 12.0 if form.get_offset() else 0.0


def _name_bands(axis: Axes, data: Curves, width: float, names: Mapping[str, str]) -> bool:
    """Write each mode's name above its first wide band, if every name fits somewhere; return whether it did."""
    raised = _raise_of(axis)
    start, end = data.span
    places: dict[str, float] = {}
    for mode, begin, stop in data.bands:
        if (stop - begin) / (end - start) * width > LETTER * (len(names[mode]) + 2):
            places.setdefault(mode, begin)
    if len(places) < len(data.modes) or len(data.bands) > 3 * len(data.modes) + 6:
        return False
    for mode, begin in places.items():
        axis.annotate(
            names[mode], (begin, 1), xycoords=axis.get_xaxis_transform(), xytext=(2, 2 + raised),
            textcoords="offset points", va="bottom", ha="left", **NAME,
        )  # fmt: skip
    return True


def mark_jumps(axis: Axes, x: Array, y: Array, jumps: Array, colour: str) -> None:
    """Mark transitions: open circles before, full ones after; of many only the jumps, and of very many none.

    Between transitions at one instant is a dot.
    """
    if not len(jumps) or len(jumps) > AFTER_ONLY:
        return
    size = 4.0 if len(jumps) <= 20 else 3.0
    passed = np.isin(jumps, jumps - 1)  # the next point is after a transition, too
    if len(jumps) <= BOTH_SIDES:
        hollow: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 0.9}
        first = jumps[~np.isin(jumps - 1, jumps)]
        if passed.any():
            axis.plot(x[jumps[passed]], y[jumps[passed]], "o", color=colour, markersize=1.8, markeredgewidth=0.0)
        axis.plot(x[first - 1], y[first - 1], "o", color=colour, markersize=size, **hollow)
        jumps = jumps[~passed]
    else:
        jumps, size = jumps[(x[jumps] != x[jumps - 1]) | (y[jumps] != y[jumps - 1])], 1.8
    axis.plot(x[jumps], y[jumps], "o", color=colour, markersize=size, markeredgewidth=0.0)


def with_guards(ends: tuple[float, float], levels: Sequence[float]) -> tuple[float, float]:
    """Widen an axis for the levels that are near it."""
    low, high = ends
    size = high - low
    near = [level for level in levels if low - size / 2 < level < high + size / 2]
    return min([low, *(level - size / 16 for level in near)]), max([high, *(level + size / 16 for level in near)])


def _draw_guards(
    axis: Axes,
    runs: Sequence[Curves],
    guards: Sequence[GuardLine],
    moving: Sequence[tuple[GuardLine, Array, Array]],
    tall: float,
) -> None:
    """Draw each level, of one run where its modes are occupied; labels stand beside the panel, where no curve is."""
    low, high = axis.get_ylim()
    labels: dict[tuple[float, str], None] = {}
    fixed = [guard for guard in guards if guard.moving is None and low < guard.value < high]
    for name, level in dict.fromkeys((guard.label, guard.value) for guard in fixed):
        modes = {SEVERAL, *(guard.mode for guard in fixed if (guard.label, guard.value) == (name, level))}
        spans = [band[1:] for band in runs[0].bands if band[0] in modes] if len(runs) == 1 else [axis.get_xlim()]
        if spans:
            axis.hlines(
                [level] * len(spans), *zip(*spans, strict=True), colors="#444444", linestyles="dotted", linewidth=1.1
            )
            labels[level, name] = None
    for guard, times, values in moving:
        if len(finite := np.flatnonzero(np.isfinite(values))):
            axis.plot(times, values, zorder=1, **LEVEL)
            if guard.label not in {name for _, name in labels}:
                labels[min(max(float(values[finite[-1]]), low), high), guard.label] = None
    # Write labels at rising levels, those that would collide on top of each other; a line of text is so high
    room = 0.13 / tall * (high - low)
    groups: list[list[tuple[float, str]]] = []
    for level, text in sorted(labels):
        if groups and level - groups[-1][-1][0] < room * min(len(groups[-1]), MOST_LABELS):
            groups[-1].append((level, text))
        else:
            groups.append([(level, text)])
    for group in groups:
        texts = [shown(text, LONGEST_LABEL) for text in dict.fromkeys(text for _, text in reversed(group))]
        more = [f"and {len(texts) - MOST_LABELS + 1} more"] if len(texts) > MOST_LABELS else []
        axis.annotate(
            "\n".join([*texts[: MOST_LABELS - len(more)], *more]), (1, float(np.mean([level for level, _ in group]))),
            xycoords=axis.get_yaxis_transform(), xytext=(3, 0), textcoords="offset points", ha="left", va="center",
            linespacing=1.0, annotation_clip=False, **SMALL,
        )  # fmt: skip


def draw_phase(axis: Axes, runs: Sequence[Curves], pair: Pair, view: View) -> None:
    """Draw one run coloured by mode where it has several, or several, each in a style of its own; guards are dotted."""
    levels = [[each.value for each in view.guards if each.moving is None and each.state == name] for name in pair]
    across, up = (with_guards(limits_of(runs, name), at) for name, at in zip(pair, levels, strict=True))
    axis.set(xlim=across, ylim=up)
    for run, look in zip(runs, looks(len(runs)), strict=True):
        modes = list(dict.fromkeys([*(mode for mode in run.modes if mode != SEVERAL), *run.samples.mode.tolist()]))
        parts = [(look, np.ones(len(run.samples), dtype=bool))]
        if len(runs) == 1 and 1 < len(modes) <= MOST_BANDS:  # else there are no colours to tell modes by
            shades = colours(modes).items()
            parts = [({**look, "color": curve(shade)}, run.samples.mode == mode) for mode, shade in shades]
        x, y = run.column(pair[0]), run.column(pair[1])
        for shade, here in parts:
            wide: Look = {"linewidth": 1.1 if len(run.jumps) <= AFTER_ONLY else 0.6, **shade}
            drawn = line(np.where(here, x, np.nan), np.where(here, y, np.nan), run.begins, (*across, *up))
            axis.plot(*drawn, rasterized=len(drawn[0]) > 60_000, **wide)
        colour = looks(1)[0]["color"] if len(parts) > 1 else parts[0][0]["color"]
        if len(runs) <= MOST_MARKED:
            mark_jumps(axis, x, y, run.jumps, colour)
        axis.plot(x[:1], y[:1], marker="D", color=colour, markersize=4.5, linestyle="")
    for level in dict.fromkeys(levels[0]):
        axis.axvline(level, **LEVEL)
    for level in dict.fromkeys(levels[1]):
        axis.axhline(level, **LEVEL)
    axis.set_xlabel(label(pair[0], view.units), parse_math=False)
    axis.set_ylabel(label(pair[1], view.units), parse_math=False)
    axis.set_box_aspect(1)
