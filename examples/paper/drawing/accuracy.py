# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 14d and 14e: errors against the step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log10
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from hsdsl.analysis.plot.style import ALARM
from paper.accuracy import RATIOS, Point, Rival
from paper.drawing.axes import MARKERS, letter, loglog, order, power, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CEILING = 300  # larger errors are those of an unstable method and are not drawn


def draw_rho(points: Sequence[Point]) -> Figure:
    """Draw rho against the step, a line for each relaxation over step, and the effect of a reversed velocity."""

    def reversed_velocity(axis: Axes, mine: Sequence[Point]) -> None:
        drawn = [p for p in mine if p.rho_reversed < CEILING]
        drawn = [p for p in drawn if p.ratio == RATIOS[-1]] or [p for p in drawn if p.ratio == RATIOS[0]]
        axis.plot([p.step for p in drawn], [p.rho_reversed for p in drawn], ":", color=ALARM, linewidth=1.8,
                  label="velocity reversed\nin each step")  # fmt: skip

    label = r"$\rho^\varepsilon_{[0,\,t_{max}]}$"
    return _figure(points, label, lambda p: p.rho_upper, reversed_velocity, legend_in=1)


def draw_rho_hat(points: Sequence[Point], rivals: Sequence[Rival]) -> Figure:
    """Draw rho-hat against the step, with Paoli and Schatzman's scheme."""

    def rival(axis: Axes, mine: Sequence[Point]) -> None:
        drawn = [r for r in rivals if r.example == mine[0].example]
        axis.plot([r.step for r in drawn], [r.rho_hat for r in drawn], "--", marker="x", markersize=4, color="#000000",
                  label="Paoli-Schatzman")  # fmt: skip

    return _figure(points, r"$\hat\rho$", lambda p: p.rho_hat, rival, legend_in=2)


def _figure(
    points: Sequence[Point],
    label: str,
    value: Callable[[Point], float],
    other: Callable[[Axes, Sequence[Point]], None],
    legend_in: int,
) -> Figure:
    """Draw a panel for each example: our lines, and another one."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    for axis, example in zip(figure.subplots(1, 2), (1, 2), strict=True):
        mine = [p for p in points if p.example == example]
        loglog(axis, "step $h$", label if example == 1 else "")
        _lines(axis, mine, value)
        other(axis, mine)
        letter(axis, _title(points, example))
        if example == legend_in:
            axis.legend(frameon=False, fontsize=8, loc="upper left")
        _triangles(axis)
    return figure


def _title(points: Sequence[Point], example: int) -> str:
    """Head a panel, and say which steps are not drawn."""
    left_out = {p.step for p in points if p.example == example and p.rho_hat >= CEILING}
    steps = ", ".join(f"{step:g}" for step in sorted(left_out))
    return f"Example {example}" + (f" ($h = {steps}$: unstable, not drawn)" if left_out else "")


def _lines(axis: Axes, points: Sequence[Point], value: Callable[[Point], float]) -> None:
    palette = shades([f"{ratio:g}" for ratio in RATIOS])
    for marker, ratio in zip(MARKERS, RATIOS, strict=False):
        mine = [p for p in points if p.ratio == ratio and value(p) < CEILING]
        if not mine:
            continue
        axis.plot([p.step for p in mine], [value(p) for p in mine], "-", marker=marker, markersize=3.2,
                  color=palette[f"{ratio:g}"], label=rf"$\varepsilon = {power(ratio)}\, h$")  # fmt: skip


def _triangles(axis: Axes) -> None:
    """Draw slopes 1 and 2 low in the right half, where no error is; not where the axes are too short for them."""
    (left, right), (low, high) = axis.get_xlim(), axis.get_ylim()
    decades = 0.16 * log10(right / left)
    for slope, at in ((1, 0.46), (2, 0.74)):
        if slope * decades < 0.28 * log10(high / low):
            order(axis, left * (right / left) ** at, low * (high / low) ** 0.04, slope, decades)
    axis.set(xlim=(left, right), ylim=(low, high))
