# pyright: reportUnknownMemberType=false
# (matplotlib's stubs leave the keyword arguments untyped)
"""A picture of a run: states over time with mode bands, jumps not joined, stop levels; a phase plot for two states."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from hsdsl.errors import UsageError
from hsdsl.execution import Execution
from hsdsl.names import visible_lines
from hsdsl.plot.guards import GuardLine
from hsdsl.plot.style import styled
from hsdsl.store.atomic import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["GuardLine", "plot", "save"]

FORMATS = (".png", ".svg", ".html")


def plot(
    execution: Execution,
    path: str | os.PathLike[str],
    *,
    guards: Sequence[GuardLine] = (),
    units: Mapping[str, str] | None = None,
    title: str | None = None,
) -> None:
    """Draw a run.

    Parameters
    ----------
    path : path
        ``.png``, ``.svg``, or ``.html`` (one self-contained page with the picture and the summary).
    guards : sequence of GuardLine
        Levels at which transitions fire, drawn as dotted lines where their mode is occupied.
    units : mapping, optional
        Units of states and outputs, and of time under the name ``t``, for the labels of the axes.
    title : str, optional
        What stands above instead of the model's title (or its path, where it has none).

    Raises
    ------
    UsageError
        For an unknown suffix, or a file that cannot be written.
    """
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix not in FORMATS:
        raise UsageError(f"{target} should end in .png, .svg or .html: the suffix says what to draw")
    with styled(), warnings.catch_warnings(), replacing(target) as file:
        from hsdsl.plot.figure import draw

        warnings.filterwarnings("ignore", "Glyph .* missing")  # a script the font lacks is no reason to alarm
        figure = draw(execution, guards=guards, units=units or {}, title=title)
        if suffix == ".html":
            from hsdsl.plot.page import page

            picture = BytesIO()
            write_figure(figure, picture, "svg")
            file.write(page(execution, picture.getvalue().decode(), title).encode())
        else:
            write_figure(figure, file, suffix[1:])


def save(draw: Callable[[], Figure], *paths: str | os.PathLike[str]) -> None:
    """Make a figure in the house's style and write it, ``.png`` or ``.svg`` by each path's suffix.

    Parameters
    ----------
    draw : callable
        Makes the figure; called once.
    *paths : path
        Where to.

    Raises
    ------
    UsageError
        For a file that cannot be written.
    """
    with styled():
        figure = draw()
        for path in map(Path, paths):
            with replacing(path) as file:
                write_figure(figure, file, path.suffix[1:].lower())


def write_figure(figure: Figure, file: BinaryIO, kind: str) -> None:
    """Write a figure as ``png`` or ``svg``."""
    said = ("Date", "Creator", "Format", "Type") if kind == "svg" else ("Software",)
    stable = dict.fromkeys(said)  # nothing but the run: the same run gives the same file
    _make_visible(figure)
    figure.savefig(file, format=kind, dpi=150, metadata=stable)


def _make_visible(figure: Figure) -> None:
    """Let no text of a model or a saved run hide characters in a picture, or break its XML."""
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        written = text.get_text()
        if (visible := visible_lines(written)) != written:
            text.set_text(visible)
