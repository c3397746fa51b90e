# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""Fig. 14f: computation times against the step, and what accuracy they buy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from paper.drawing.axes import MARKERS, letter, loglog, power, shades
from paper.times import RATIOS, Timing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CEILING = 300
STYLES = ("-", "--", ":")


def draw(timings: Sequence[Timing]) -> Figure:
    """Draw two charts for each example, a colour for each scheme and relaxation, a style for each engine."""
    figure = Figure(figsize=(10.0, 7.6), layout="constrained")
    axes = figure.subplots(2, 2)
    for column, example in enumerate((1, 2)):
        mine = [t for t in timings if t.example == example and t.rho_hat < CEILING]
        loglog(axes[0, column], "step $h$", "time [s]" if column == 0 else "")
        loglog(axes[1, column], "time [s]", r"$\hat\rho$" if column == 0 else "")
        _lines(axes[0, column], mine, by_step=True)
        _lines(axes[1, column], mine, by_step=False)
        letter(axes[0, column], f"Example {example}: time against step")
        letter(axes[1, column], f"Example {example}: error against time")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8.5)
    return figure


def _lines(axis: Axes, timings: Sequence[Timing], by_step: bool) -> None:
    engines = list(dict.fromkeys(t.engine for t in timings))
    ratios = (None, *RATIOS)
    palette = shades([str(ratio) for ratio in ratios])
    for style, engine in zip(STYLES, engines, strict=False):
        for marker, ratio in zip(MARKERS, ratios, strict=False):
            chosen = [t for t in timings if t.engine == engine and t.ratio == ratio]
            if not chosen:
                continue
            chosen.sort(key=lambda t: t.step)
            x = [t.step if by_step else t.seconds for t in chosen]
            y = [t.seconds if by_step else t.rho_hat for t in chosen]
            name = "Paoli-Schatzman" if ratio is None else rf"relaxed, $\varepsilon = {power(ratio)}\, h$"
            axis.plot(x, y, style, marker=marker, markersize=3.6, color=palette[str(ratio)],
                      label=f"{name}, {engine} engine")  # fmt: skip
