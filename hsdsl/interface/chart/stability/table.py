"""A stability map as CSV, as plain values, and as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import isfinite
from typing import Any

from hsdsl.analysis.report.words import condensed, form
from hsdsl.interface.chart.rows import csv_text
from hsdsl.interface.chart.stability import Panel, StabilityMap
from hsdsl.interface.chart.stability.cells import REFUSED, UNKNOWN, WORDS, Cell

COLUMNS = ("tool", "scheme", "method", "outcome", "rho", "error", "transitions", "why")


def records(found: StabilityMap) -> Iterator[dict[str, Any]]:
    """A mapping for each run."""
    for panel in found.panels:
        for j, row in enumerate(panel.cells):
            for i, cell in enumerate(row):
                place = {found.x.name: found.x.values[i], found.y.name: found.y.values[j]}
                yield place | _plain(panel, cell)


def _plain(panel: Panel, cell: Cell) -> dict[str, Any]:
    numbers = {name: value if isfinite(value) else None for name, value in (("rho", cell.rho), ("error", cell.error))}
    tool = {"tool": panel.tool.name or "hsdsl", "scheme": panel.tool.scheme, "method": panel.tool.method}
    return tool | {"outcome": cell.word} | numbers | {"transitions": cell.transitions, "why": cell.why}


def as_csv(found: StabilityMap) -> str:
    """The map as CSV, a line for each run."""
    return csv_text((found.x.name, found.y.name, *COLUMNS), records(found))


def as_plain(found: StabilityMap) -> dict[str, Any]:
    """What ``--json`` prints."""
    limits = {panel.tool.label: panel.limit for panel in found.panels if panel.limit}
    axes = {"x": found.x.name, "y": found.y.name}
    return {"model": found.name, **axes, "limits": limits, "runs": list(records(found))}


def as_text(found: StabilityMap) -> str:
    """How many runs of each tool came to what, and why there was nothing to run or to compare with."""
    width = max(len(panel.tool.label) for panel in found.panels)
    lines: list[str] = []
    for panel in found.panels:
        count = Counter(cell.word for row in panel.cells for cell in row)
        words = ", ".join(f"{count[word]} {word}" for word in WORDS if count[word])
        limits = [limit for limit in panel.limit or () if limit]
        known = f"; linearly stable up to h = {min(limits):.3g}" if limits else ""
        known += f" to {max(limits):.3g}" if limits and max(limits) > 1.001 * min(limits) else ""
        lines.append(f"{panel.tool.label:{width}}  {words}{known}")
    return "\n".join([*lines, *_reasons(found)])


def _reasons(found: StabilityMap) -> Iterator[str]:
    """Why runs have no reference or are refused: each reason once, with its first place."""
    groups: dict[tuple[str, str], dict[tuple[float, float], str]] = {}
    for panel in found.panels:
        for y, row in zip(found.y.values, panel.cells, strict=True):
            for x, cell in zip(found.x.values, row, strict=True):
                if cell.word in (UNKNOWN, REFUSED):
                    groups.setdefault((cell.word, form(cell.why)), {})[x, y] = cell.why
    for (word, _), places in groups.items():
        x, y = next(iter(places))
        first = f"first at {found.x.name} = {x:.4g}, {found.y.name} = {y:.4g}"
        yield f"{word}, {first}: {condensed([*places.values()])[0]}"
