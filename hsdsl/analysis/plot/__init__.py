# pyright: reportUnknownMemberType=false
"""Pictures of runs: states over time with mode bands, jumps not joined, guards as dotted levels; phase plots.

`curves` has what a picture shows and the points that it draws; `figure` has the panels, in the colours of `style`, and
`page` is the same as HTML. `analyses` and `ensembles` are other pictures; `animation` draws a scene, `notebook` is what
notebooks display.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hsdsl.analysis.plot.curves import GuardLine, View
from hsdsl.analysis.plot.style import FORMATS, check_suffixes, save, styled, write_figure
from hsdsl.base.atomic import replacing
from hsdsl.base.errors import UsageError
from hsdsl.engine.execution import Execution

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["GuardLine", "View", "axes", "plot", "save"]


def plot(runs: Execution | Sequence[Execution], path: str | os.PathLike[str], **options: Any) -> None:
    """Draw a run, or several in one picture.

    Parameters
    ----------
    path : path
        ``.png``, ``.svg``, or ``.html``: one interactive page with the summary and the mode graph, without network.
    **options
        What is shown, by the names of :class:`View`.

    Raises UsageError: for an unknown suffix or name, or a file that cannot be written.
    """
    (target,) = check_suffixes(path, formats=(*FORMATS, ".html"))
    suffix, view = target.suffix.lower(), View(**options)
    several = _several(runs)
    with replacing(target) as file:
        if suffix == ".html":
            from hsdsl.analysis.plot.page import page

            file.write(page(several, view).encode())
            return
        with styled():
            from hsdsl.analysis.plot.figure import picture

            write_figure(picture(several, view), file, suffix[1:])


def axes(runs: Execution | Sequence[Execution], figure: Any = None, **options: Any) -> list[Axes]:
    """Draw runs to a figure of pyplot, which notebooks show by themselves, or to a given one; return its axes.

    Parameters
    ----------
    figure : Figure or SubFigure, optional
        Where to draw; left out, a new figure of pyplot.
    **options
        As for :func:`plot`.

    Raises UsageError: an unknown name.
    """
    several, view = _several(runs), View(**options)
    if isinstance(figure, (str, os.PathLike)):
        raise UsageError(
            f"expected a figure of Matplotlib, got the path '{os.fspath(figure)}'",
            f"hsdsl.analysis.plot.plot(run, '{os.fspath(figure)}') writes a picture",
        )
    with styled():
        from hsdsl.analysis.plot.figure import draw

        def new(size: tuple[float, float]) -> Any:
            from matplotlib import pyplot

            return pyplot.figure(figsize=size, layout="constrained")

        return draw(several, view, new if figure is None else lambda _: figure)


def _several(runs: Execution | Sequence[Execution]) -> list[Execution]:
    return [runs] if isinstance(runs, Execution) else list(runs)
