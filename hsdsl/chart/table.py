"""A chart's numbers as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from math import isfinite
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsdsl.chart import Row

COLUMNS: tuple[str, ...] = (
    "model",
    "tool",
    "scheme",
    "method",
    "size",
    "value",
    "seconds",
    "fastest",
    "slowest",
    "first",
    "error",
    "rho_lower",
    "rho_upper",
    "transitions",
    "verdict",
    "why",
)


def record(row: Row) -> dict[str, Any]:
    """One row as plain values; a number that is not there is None."""
    fastest, slowest = row.timed.spread
    rho = row.judgement.rho
    values = (
        row.model,
        row.attempt.tool,
        row.attempt.scheme,
        row.attempt.method,
        row.attempt.size,
        row.attempt.value,
        row.seconds,
        fastest,
        slowest,
        row.timed.first,
        row.judgement.error,
        rho.lower if rho else None,
        rho.upper if rho else None,
        row.judgement.transitions,
        row.judgement.verdict,
        row.judgement.why,
    )
    return {name: _plain(value) for name, value in zip(COLUMNS, values, strict=True)}


def as_csv(rows: Iterable[Row]) -> str:
    """The table as CSV, with a header."""
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(record(row) for row in rows)
    return text.getvalue()


def as_text(rows: Iterable[Row], digits: int = 3) -> str:
    """The table for a person."""
    head = ("tool", "setting", "time", "error", "rho at most", "verdict")
    lines = [head, *(_line(row, digits) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)


def _line(row: Row, digits: int) -> tuple[str, ...]:
    verdict = row.judgement.verdict + (f": {row.judgement.why}" if row.judgement.why else "")
    rho = f"{row.judgement.rho.upper:.{digits - 1}e}" if row.judgement.rho else ""
    return (
        row.attempt.label,
        row.attempt.setting,
        duration(row.seconds),
        f"{row.judgement.error:.{digits - 1}e}",
        rho,
        verdict,
    )


def duration(seconds: float) -> str:
    """Seconds in a unit that suits them."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-6:.3g} us"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not isfinite(value) else value
