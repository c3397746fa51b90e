"""A chart's rows as text and as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

from hsdsl.analysis.report.words import aligned
from hsdsl.interface.chart.outcome import Judgement
from hsdsl.interface.chart.scene import Attempt
from hsdsl.interface.chart.stopwatch import Timed

COLUMNS: tuple[str, ...] = (
    "model", "tool", "scheme", "method", "size", "value", "seconds", "fastest", "slowest", "first", "error",
    "rho_lower", "rho_upper", "transitions", "verdict", "why",
)  # fmt: skip


class Row(NamedTuple):
    """One run of one tool: its settings, its times and its errors."""

    model: str
    attempt: Attempt
    judgement: Judgement
    timed: Timed

    @property
    def seconds(self) -> float:
        """Median seconds of a warm run, sampling included, NaN where none was finished."""
        return self.timed.median


def record(row: Row) -> dict[str, Any]:
    """One row as plain values; a number that is not there is None."""
    attempt, judgement, rho = row.attempt, row.judgement, row.judgement.rho
    values = (
        *(row.model, attempt.tool.name, attempt.tool.scheme, attempt.tool.method, attempt.size, attempt.value),
        *(row.seconds, *row.timed.spread, row.timed.first, judgement.error),
        *((rho.lower, rho.upper) if rho else (None, None)),
        *(judgement.transitions, judgement.verdict, judgement.why),
    )
    finite = [None if isinstance(value, float) and not isfinite(value) else value for value in values]
    return dict(zip(COLUMNS, finite, strict=True))


def as_csv(rows: Iterable[Row]) -> str:
    """The rows as CSV, with a header."""
    return csv_text(COLUMNS, map(record, rows))


def csv_text(columns: Sequence[str], records: Iterable[Mapping[str, Any]]) -> str:
    """Records as CSV, with a header."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def as_text(rows: Iterable[Row], digits: int = 3) -> str:
    """The table in aligned columns."""
    lines = [("tool", "setting", "time", "error", "rho at most", "verdict")]
    for row in rows:
        judgement = row.judgement
        verdict = judgement.verdict + (f": {judgement.why}" if judgement.why else "")
        rho = f"{judgement.rho.upper:.{digits - 1}e}" if judgement.rho else ""
        error = f"{judgement.error:.{digits - 1}e}"
        lines.append((row.attempt.tool.label, row.attempt.setting, duration(row.seconds), error, rho, verdict))
    return "\n".join(aligned(lines))


def duration(seconds: float) -> str:
    """Seconds in a unit that suits them."""
    unit, size = next((u for u in (("s", 1.0), ("ms", 1e-3)) if seconds >= u[1]), ("us", 1e-6))
    return f"{seconds / size:.3g} {unit}"
