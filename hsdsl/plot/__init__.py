"""A picture of a run: states over time with mode bands, jumps not joined, stop levels; a phase plot for two states."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from io import BytesIO

from hsdsl.execution import Execution
from hsdsl.plot.curves import GuardLine
from hsdsl.plot.style import FORMATS, check_suffixes, save, styled, write_figure
from hsdsl.program import Program
from hsdsl.report.html import page
from hsdsl.store.atomic import replacing

__all__ = ["GuardLine", "plot", "save"]


def plot(
    execution: Execution,
    path: str | os.PathLike[str],
    *,
    guards: Sequence[GuardLine] = (),
    units: Mapping[str, str] | None = None,
    title: str | None = None,
    program: Program | None = None,
) -> None:
    """Draw a run.

    Parameters
    ----------
    path : path
        ``.png``, ``.svg``, or ``.html`` (one self-contained page with the picture, the summary and the mode graph).
    guards : sequence of GuardLine
        Levels at which transitions fire, drawn as dotted lines where their mode is occupied.
    units : mapping, optional
        Units of states and outputs, and of time under the name ``t``, for the labels of the axes.
    title : str, optional
        Replaces the model's title (or its path, where it has none).
    program : Program, optional
        The model whose mode graph is in the page.

    Raises
    ------
    UsageError
        For an unknown suffix, or a file that cannot be written.
    """
    (target,) = check_suffixes(path, formats=(*FORMATS, ".html"))
    suffix = target.suffix.lower()
    with styled(), replacing(target) as file:
        from hsdsl.plot.figure import draw

        figure = draw(execution, guards=guards, units=units or {}, title=title)
        if suffix == ".html":
            picture = BytesIO()
            write_figure(figure, picture, "svg")
            file.write(page(execution, picture.getvalue().decode(), title, program).encode())
        else:
            write_figure(figure, file, suffix[1:])
