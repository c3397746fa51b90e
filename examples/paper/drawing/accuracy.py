# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 14d and 14e: errors against the step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import log10
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from hsdsl.plot.style import ALARM
from paper.accuracy import RATIOS, Point, Rival
from paper.drawing.axes import MARKERS, letter, loglog, order, power, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CEILING = 300  # larger errors are those of an unstable method and are not drawn


def draw_rho(points: Sequence[Point]) -> Figure:
    """Draw rho against the step, a line for each relaxation over step, and what a reversed velocity makes of it."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    for axis, example in zip(figure.subplots(1, 2), (1, 2), strict=True):
        loglog(axis, "step $h$", r"$\rho^\varepsilon_{[0,\,t_{max}]}$" if example == 1 else "")
        _lines(axis, [p for p in points if p.example == example], lambda p: p.rho_upper)
        mine = [p for p in points if p.example == example and p.ratio == RATIOS[-1] and p.rho_reversed < CEILING]
        mine = mine or [p for p in points if p.example == example and p.ratio == RATIOS[0] and p.rho_reversed < CEILING]
        axis.plot([p.step for p in mine], [p.rho_reversed for p in mine], ":", color=ALARM, linewidth=1.8,
                  label="velocity reversed\nin each step")  # fmt: skip
        letter(axis, _title(points, example))
        if example == 1:
            axis.legend(frameon=False, fontsize=8, loc="upper left")
        _triangles(axis)
    return figure


def draw_rho_hat(points: Sequence[Point], rivals: Sequence[Rival]) -> Figure:
    """Draw rho-hat against the step, beside Paoli and Schatzman's scheme."""
    figure = Figure(figsize=(10.0, 4.4), layout="constrained")
    for axis, example in zip(figure.subplots(1, 2), (1, 2), strict=True):
        loglog(axis, "step $h$", r"$\hat\rho$" if example == 1 else "")
        _lines(axis, [p for p in points if p.example == example], lambda p: p.rho_hat)
        mine = [r for r in rivals if r.example == example]
        axis.plot([r.step for r in mine], [r.rho_hat for r in mine], "--", marker="x", markersize=4, color="#000000",
                  label="Paoli-Schatzman")  # fmt: skip
        letter(axis, _title(points, example))
        if example == 2:
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
