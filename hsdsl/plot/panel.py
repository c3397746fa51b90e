# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""One state or output over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.plot.curves import SEVERAL, Array, Curves, GuardLine, limits, line
from hsdsl.plot.style import ALARM, FAINT, INK, band, colours

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BOTH_SIDES = 60  # transitions up to which the values before and after are marked
AFTER_ONLY = 400  # and up to which the value after is
LETTER = 0.085  # inches, about, of a letter in the name of a band


def draw_panel(
    axis: Axes, data: Curves, name: str, guards: Sequence[GuardLine], units: Mapping[str, str], ends_badly: bool
) -> None:
    """Draw the bands of the modes, the curve, its jumps and the levels of guards."""
    values, time = data.column(name), data.samples.time
    start, end = data.span
    if start == end:
        start, end = start - 0.5, end + 0.5
    low, high = with_guards(limits(values, time, ends_badly), [guard.value for guard in guards])
    axis.set_xlim(start - 0.008 * (end - start), end + 0.008 * (end - start))  # room for markers at the ends
    axis.set_ylim(low, high)
    draw_bands(axis, data)
    x, y = line(time, values, data.begins, (start, end, low, high))
    axis.plot(x, y, color=INK, linewidth=1.3, solid_capstyle="round", rasterized=len(x) > 60_000)
    mark_jumps(axis, time, values, data.jumps)
    if len(time) == 1:
        axis.plot(time, values, "o", color=INK, markersize=4)
    if ends_badly:
        axis.axvline(data.span[1], color=ALARM, linewidth=1.2)
    _draw_guards(axis, data, guards, (low, high))
    if not np.isfinite(values).any():
        axis.text(0.5, 0.5, "no value in this run", transform=axis.transAxes, ha="center", va="center", color=FAINT)
    axis.set_ylabel(label(name, units), parse_math=False)


def label(name: str, units: Mapping[str, str]) -> str:
    """Label an axis with name and unit."""
    return f"{name} [{units[name]}]" if name in units else name


def draw_bands(axis: Axes, data: Curves) -> None:
    """Colour the background by mode."""
    for mode, colour in colours(data.modes).items():
        spans = [(begin, end - begin) for name, begin, end in data.bands if name == mode]
        shade, across = band(colour, len(data.modes) == 1), axis.get_xaxis_transform()
        axis.broken_barh(spans, (0, 1), transform=across, facecolors=shade, linewidth=0, zorder=0)


def name_bands(axis: Axes, data: Curves, width: float) -> bool:
    """Write each mode's name above its first wide band, if every name fits somewhere; return whether it did."""
    start, end = data.span
    places: dict[str, tuple[float, float]] = {}
    for mode, begin, stop in data.bands:
        if (stop - begin) / (end - start) * width > LETTER * (len(mode) + 2):
            places.setdefault(mode, (begin, stop))
    if len(places) < len(data.modes) or len(data.bands) > 3 * len(data.modes) + 6:
        return False
    for mode, (begin, _) in places.items():
        axis.annotate(
            mode, (begin, 1), xycoords=axis.get_xaxis_transform(), xytext=(2, 2), textcoords="offset points",
            va="bottom", ha="left", fontsize=8, color="#444444", parse_math=False,
        )  # fmt: skip
    return True


def mark_jumps(axis: Axes, x: Array, y: Array, jumps: Array) -> None:
    """Mark transitions: open circles before, full ones after; fewer and smaller the more there are."""
    if not len(jumps) or len(jumps) > AFTER_ONLY:
        return
    few = len(jumps) <= BOTH_SIDES
    size = 4.0 if len(jumps) <= 20 else 3.0 if few else 1.8
    if few:
        hollow: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 0.9}
        axis.plot(x[jumps - 1], y[jumps - 1], "o", color=INK, markersize=size, **hollow)
    axis.plot(x[jumps], y[jumps], "o", color=INK, markersize=size, markeredgewidth=0.0)


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


def _draw_guards(axis: Axes, data: Curves, guards: Sequence[GuardLine], ends: tuple[float, float]) -> None:
    """Draw each level where its mode is occupied, and label it at the end; labels that would collide become one."""
    low, high = ends
    near = 0.15 * (data.span[1] - data.span[0]), 0.04 * (high - low)
    labels: dict[tuple[float, float], list[str]] = {}
    for guard in guards:
        spans = [(begin, end) for mode, begin, end in data.bands if mode in (guard.mode, SEVERAL)]
        if not spans or not low < guard.value < high:
            continue
        begins, stops = [begin for begin, _ in spans], [end for _, end in spans]
        axis.hlines([guard.value] * len(spans), begins, stops, colors="#444444", linestyles="dotted", linewidth=1.1)
        close = (at for at in labels if abs(at[0] - stops[-1]) < near[0] and abs(at[1] - guard.value) < near[1])
        labels.setdefault(next(close, (stops[-1], guard.value)), []).append(guard.label)
    for (end, level), texts in labels.items():
        above = level > (low + high) / 2
        axis.annotate(
            ", ".join(dict.fromkeys(texts)), (end, level), xytext=(-3, 4 if above else -4), textcoords="offset points",
            ha="right", va="bottom" if above else "top", fontsize=7.5, color="#444444", parse_math=False,
        )  # fmt: skip
