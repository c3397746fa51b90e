"""A chart's rows as the panels of a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from typing import TYPE_CHECKING

from hsdsl.plot.work_precision import Line, Mark, Panel

if TYPE_CHECKING:
    from hsdsl.chart import Row


def panels(name: str, rows: Sequence[Row]) -> list[Panel]:
    """The panels of one scene: the states' error, and rho where it was computed."""
    drawn = [Panel(name, "largest error of a state", _lines(rows, lambda row: row.judgement.error))]
    measured = [row for row in rows if row.judgement.rho is not None]
    if measured:
        drawn.append(Panel(name, "rho, at most", _lines(measured, _rho)))
    return drawn


def _rho(row: Row) -> float:
    rho = row.judgement.rho
    return rho.upper if rho is not None and rho.upper < 1e300 else nan


def _lines(rows: Sequence[Row], error: Callable[[Row], float]) -> list[Line]:
    lines: list[Line] = []
    for label in dict.fromkeys(row.attempt.label for row in rows):
        own = [row for row in rows if row.attempt.label == label]
        group = " ".join(part for part in (own[0].attempt.tool, own[0].attempt.scheme) if part)
        lines.append(Line(label, group, [Mark(error(row), row.seconds, row.judgement.verdict) for row in own]))
    return lines
