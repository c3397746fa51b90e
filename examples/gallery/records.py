"""Outcomes of all runs, with versions, as one JSON file."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from math import isfinite, nan
from pathlib import Path
from typing import Any

from gallery.settings import Setting
from hsdsl.interface.chart import PEERS
from hsdsl.interface.chart.outcome import Outcome

PACKAGES = {"sksundae": "scikit-sundae"}
COLUMNS = ("scene", "tool", "scheme", "method", "tolerance", "step", "word", "verdict", "error", "transitions", "why")
LONGEST = 160  # characters of a reason


@dataclass(frozen=True)
class Record:
    """The outcome of a scene with a setting."""

    scene: str
    setting: Setting
    outcome: Outcome


@dataclass(frozen=True)
class Records:
    """All outcomes, and the versions of what gave them."""

    versions: Mapping[str, str]
    rows: tuple[Record, ...]

    def of(self, scene: str, tool: str, scheme: str = "") -> list[Record]:
        """Those of a scene with a tool."""
        return [r for r in self.rows if r.scene == scene and r.setting.name == tool and r.setting.scheme == scheme]


def versions() -> dict[str, str]:
    """Versions by name; of peers that are not installed an empty text."""
    found = {"python": platform.python_version(), "hsdsl": version("hsdsl")}
    for name in PEERS:
        try:
            found[name] = version(PACKAGES.get(name, name))
        except PackageNotFoundError:
            found[name] = ""
    return found


def save(path: Path, records: Records) -> None:
    """Write them, a row a line."""
    rows = ",\n".join(json.dumps(_row(record)) for record in records.rows)
    head = json.dumps({"versions": dict(records.versions), "columns": COLUMNS})
    path.write_text(f'{head[:-1]}, "rows": [\n{rows}\n]}}\n', encoding="utf-8")


def read(path: Path) -> Records:
    """Read them."""
    given = json.loads(path.read_text(encoding="utf-8"))
    return Records(given["versions"], tuple(_record(dict(zip(COLUMNS, row, strict=True))) for row in given["rows"]))


def joined(old: Iterable[Record], new: Iterable[Record]) -> tuple[Record, ...]:
    """New records in place of old ones of the same scene and tool."""
    fresh = list(new)
    done = {(r.scene, r.setting.name) for r in fresh}
    kept = [r for r in old if (r.scene, r.setting.name) not in done]
    return tuple(sorted([*kept, *fresh], key=lambda r: (r.scene, r.setting.name)))


def _row(record: Record) -> list[Any]:
    setting, found = record.setting, record.outcome
    error = float(f"{found.error:.2g}") if isfinite(found.error) else None
    why = found.why if found.word != "right" else ""
    why = why if len(why) <= LONGEST else f"{why[:LONGEST]}..."
    own = (setting.name, setting.scheme, setting.method, setting.tolerance, setting.step)
    return [record.scene, *own, found.word, found.verdict, error, found.transitions, why]


def _record(row: dict[str, Any]) -> Record:
    setting = Setting(*(row[name] for name in ("tool", "scheme", "method", "tolerance", "step")))
    error = nan if row["error"] is None else row["error"]
    return Record(row["scene"], setting, Outcome(row["word"], row["why"], error, row["transitions"], row["verdict"]))
