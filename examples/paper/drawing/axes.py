# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""What the charts share: logarithmic axes, triangles that show an order, colours by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hsdsl.analysis.plot.style import FAINT, colours, curve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARKERS = ("o", "s", "^", "D", "v")


def shades(names: Sequence[str]) -> dict[str, str]:
    """Give each name a colour for lines."""
    return {name: curve(colour) for name, colour in colours(names).items()}


def loglog(axis: Axes, x: str, y: str) -> None:
    """Make both axes logarithmic, with a light grid at the decades."""
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.set_xlabel(x)
    axis.set_ylabel(y)


def order(axis: Axes, x: float, y: float, slope: int, decades: float = 0.6) -> None:
    """Draw a triangle of a slope, its lower left corner at (x, y) of the data."""
    right, top = x * 10**decades, y * 10 ** (decades * slope)
    axis.plot([x, right, right, x], [y, y, top, y], color=FAINT, linewidth=0.9, zorder=1)
    axis.annotate(
        f"{slope}", (right, (y * top) ** 0.5), xytext=(3, 0), textcoords="offset points", color="#555555", va="center",
        fontsize=8,
    )  # fmt: skip


def letter(axis: Axes, text: str) -> None:
    """Head a panel."""
    axis.set_title(text, loc="left", fontsize=9.5)


def power(number: float) -> str:
    """Set a number of one digit as a multiple of a power of ten."""
    digits, exponent = f"{number:.0e}".split("e")
    return rf"{digits} \cdot 10^{{{int(exponent)}}}"
