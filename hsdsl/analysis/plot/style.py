# pyright: reportUnknownMemberType=false
"""Settings and colours of every picture, and pictures as files."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from pathlib import Path
from textwrap import fill
from threading import RLock
from typing import TYPE_CHECKING, Any, BinaryIO, Concatenate, ParamSpec

import numpy as np

from hsdsl.analysis.plot.curves import SEVERAL
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.base.names import visible_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure, FigureBase

P = ParamSpec("P")
# The salt makes the SVG's ids repeatable.
STYLE: dict[str, Any] = {
    "svg.hashsalt": "hsdsl",
    "svg.fonttype": "path",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.labelcolor": "#222222",
    "text.color": "#222222",
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": True,
    "agg.path.chunksize": 20_000,
    "hatch.linewidth": 0.6,
}
FORMATS = (".png", ".svg")
Look = dict[str, Any]  # matplotlib's arguments for a line
INK, FAINT, ALARM = "#16324f", "#8a8a8a", "#d55e00"
# Okabe and Ito 2008: people with any colour vision tell them apart
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")  # of modes
TINTS = (0.2, 0.2, 0.33, 0.3, 0.3, 0.3, 0.5)  # of their bands: the first three differ in grey, too
RUNS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#222222", "#e69f00", "#56b4e9")  # of lines and marks
DASHES = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1.2, 1.2)))  # distinct without any colour
MOST_DASHED = 12  # lines that each have a colour and dashes; more are a family, from dark to light
PLAIN, HATCHES = 3, ("////", "\\\\\\\\", "xxxx", "....")  # of the bands of modes: so many without, then these
_drawing = RLock()  # matplotlib's settings are the whole process's


def whole_ticks(axis: Axis, values: Any) -> None:
    """Let an axis have ticks at whole numbers only, where all values are whole, as counts are."""
    finite = values[np.isfinite(values)]
    if len(finite) and not (finite % 1).any():
        from matplotlib.ticker import MaxNLocator

        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], integer=True))


def save(draw: Callable[[], Figure], *paths: str | os.PathLike[str]) -> None:
    """Draw a figure once and write it to every path, in the format of its suffix.

    Raises UsageError: for an unknown suffix, or a file that cannot be written.
    """
    targets = check_suffixes(*paths)
    with styled():
        figure = draw()
        for path in targets:
            with replacing(path) as file:
                write_figure(figure, file, path.suffix[1:].lower())


def to_file(draw: Callable[P, Figure]) -> Callable[Concatenate[str | os.PathLike[str], P], None]:
    """Make a function that draws a figure one that writes it to a file, its first argument; see :func:`save`."""

    @wraps(draw)
    def plot(path: str | os.PathLike[str], /, *args: P.args, **kwargs: P.kwargs) -> None:
        save(lambda: draw(*args, **kwargs), path)

    return plot


def check_suffixes(*paths: str | os.PathLike[str], formats: Sequence[str] = FORMATS) -> list[Path]:
    """Refuse paths whose suffix is not among the formats."""
    targets = [Path(path) for path in paths]
    for path in targets:
        if path.suffix.lower() not in formats:
            known = f"{', '.join(formats[:-1])} or {formats[-1]}"
            raise UsageError(f"{path} should end in {known}: the suffix gives the format")
    return targets


def write_figure(figure: Figure, file: BinaryIO, kind: str, dots: int = 150) -> None:
    """Write a figure as ``png`` or ``svg``: the same run gives the same bytes."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):  # hidden characters must not break the XML
        assert isinstance(text, Text)
        if (visible := visible_lines(text.get_text())) != text.get_text():
            text.set_text(visible)
    dated = ("Date", "Creator", "Format", "Type") if kind == "svg" else ("Software",)
    figure.savefig(file, format=kind, dpi=dots, metadata=dict.fromkeys(dated))


LETTER = 0.085  # inches, about, of a letter of a legend


def legend_below(figure: FigureBase, handles: Sequence[Any], width: float) -> int:
    """Put a legend below everything, where it covers nothing; return how many rows it has in ``width`` inches."""
    if not handles:
        return 0
    widths = [len(str(handle.get_label())) * LETTER + 0.6 for handle in handles]
    fitting = len(handles) if sum(widths) < 1.1 * width else int(width / max(widths))  # most letters are narrower
    columns = min(len(handles), max(1, fitting))
    legend = figure.legend(handles=handles, loc="outside lower left", ncols=columns, frameon=False, fontsize=8.5)
    for text in legend.get_texts():
        text.set_parse_math(False)
    for line in legend.get_lines():
        line.set_alpha(1)  # pale ones would not be seen
    return -(-len(handles) // columns)


def empty(width: float, height: float) -> Figure:
    """A figure of a size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


@contextmanager
def styled() -> Generator[None]:
    """Draw with our settings in the block, and no other thread meanwhile."""
    with _drawing:
        named = os.environ.pop("MPLBACKEND", None) if "matplotlib" not in sys.modules else None
        import matplotlib.style

        if named is not None:  # perhaps a backend there is not: none is used here
            os.environ["MPLBACKEND"] = named
            with suppress(ValueError):
                matplotlib.rcParams["backend"] = named

        with matplotlib.style.context(["default", STYLE]), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")  # a script that the font lacks
            yield


def looks(count: int) -> list[Look]:
    """Give each run a line of its own colour and dashes; one is drawn in ink, and very many from dark to light."""
    if count == 1:
        return [{"color": INK, "linestyle": "-", "solid_capstyle": "round"}]
    if count <= MOST_DASHED:
        return [{"color": RUNS[k % len(RUNS)], "linestyle": DASHES[k % len(DASHES)]} for k in range(count)]
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    shades = map(to_hex, colormaps["viridis"](np.linspace(0, 0.92, count)))
    return [{"color": shade, "linestyle": "-", "linewidth": 0.8, "alpha": pale(count)} for shade in shades]


def pale(count: int) -> float:
    """How opaque each of many lines is, that those below are seen."""
    return max(0.15, min(1.0, 4 / np.sqrt(count)))


def colours(modes: Sequence[str]) -> dict[str, str]:
    """Give each mode a colour; after seven modes they begin again, darker and lighter in turn, and never near black."""
    chosen: dict[str, str] = {}
    for i, mode in enumerate(mode for mode in modes if mode != SEVERAL):
        time = i // len(PALETTE)
        share = 0.4 + 0.4 / ((time + 1) // 2 + 1) if time else 1.0
        chosen[mode] = _mixed(PALETTE[i % len(PALETTE)], share, "#000000" if time % 2 else "#ffffff")
    return chosen | {mode: "#7a7a7a" for mode in modes if mode == SEVERAL}


def band(colour: str, share: float = 0.24) -> str:
    """Lighten a colour for the background."""
    return _mixed(colour, share, "#ffffff")


def fills(modes: Sequence[str], light: bool = True) -> dict[str, Look]:
    """Fill the bands of modes; from the fourth on they are hatched: light colours are too few to tell them apart."""
    found: dict[str, Look] = {}
    for i, (mode, colour) in enumerate(colours(modes).items()):
        hatch = HATCHES[(i - PLAIN) % len(HATCHES)] if i >= PLAIN and mode != SEVERAL else None
        tint = 0.06 if len(modes) == 1 else TINTS[i % len(TINTS)]
        found[mode] = {"facecolor": band(colour, tint) if light else colour, "linewidth": 0}
        found[mode] |= {"hatch": hatch, "edgecolor": band(colour, 0.5) if light else "#ffffff"} if hatch else {}
    return found


def curve(colour: str) -> str:
    """Darken a colour for a line on white."""
    return _mixed(colour, 0.85, "#000000")


def _mixed(colour: str, share: float, other: str) -> str:
    parts = (int(colour[i : i + 2], 16) * share + int(other[i : i + 2], 16) * (1 - share) for i in (1, 3, 5))
    return "#" + "".join(f"{round(part):02x}" for part in parts)


def heading(figure: Any, title: str, facts: str = "", top: Axes | None = None, pad: float = 6) -> None:
    """Write a title above a figure, and facts in smaller letters above its first axes; both are wrapped."""
    width = figure.bbox.width / figure.dpi
    text = fill(title, max(20, int(width * 10)))
    figure.suptitle(text, x=0.01, ha="left", fontsize=12, fontweight="bold", parse_math=False)
    if facts and top is not None:
        text = fill(facts, max(20, int(width * 13)))
        top.set_title(text, loc="left", fontsize=8.5, color="#555555", pad=pad, parse_math=False)


def label(name: str, units: Mapping[str, str]) -> str:
    """Label an axis with name and unit."""
    return f"{name} [{units[name]}]" if name in units else name


def time_label(units: Mapping[str, str]) -> str:
    """Label an axis of time."""
    return label("time t", {"time t": units["t"]} if "t" in units else {})
