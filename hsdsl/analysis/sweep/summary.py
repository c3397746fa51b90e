# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""A sweep's dataset in a few lines, or as JSON: what varies, how far it is, how runs ended, ranges of numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.sweep.manifest import Manifest
from hsdsl.base.errors import WARNINGS
from hsdsl.base.names import called, counted, visible
from hsdsl.engine.execution import Array

if TYPE_CHECKING:
    from hsdsl.analysis.sweep.dataset import Sweep

KEPT = ("model", "sha256", "title", "random", "seed", "record", "settings", "rows", "chunk", "hsdsl")


def as_json(sweep: Sweep) -> dict[str, Any]:
    """The numbers of a sweep, and where it is."""
    described = sweep.manifest.plain()
    vary = [{key: value for key, value in item.items() if key != "values"} | _span(item) for item in described["vary"]]
    counts = {"done": sweep.done, "complete": sweep.complete, "stops": sweep.reasons, "warnings": sweep.warning_counts}
    return {"folder": str(sweep.folder)} | {key: described[key] for key in KEPT} | {"vary": vary} | counts


def _span(item: Mapping[str, Any]) -> dict[str, Any]:
    values = item.get("values")
    return {} if values is None else {"from": values[0], "to": values[-1], "count": len(values)}


def summary(sweep: Sweep) -> str:
    """A sweep in a few lines."""
    manifest = sweep.manifest
    share = f"  {sweep.done:,} of {sweep.rows:,} rows in {len(sweep.chunks)} of {manifest.chunks} files"
    share += "" if sweep.complete else "; the command that made it goes on"
    stops = "stops  " + ", ".join(f"{count:,} {reason}" for reason, count in sweep.reasons.items())
    title = visible(called(manifest.title, manifest.model))
    described = (f"  {text}" for text in _described(manifest))
    return "\n".join([title, *described, share, stops, *_failures(sweep), *_warnings(sweep), *_ranges(sweep)])


def _described(manifest: Manifest) -> Iterator[str]:
    variation = manifest.variation
    for grid in variation.grids:
        yield f"{grid.name}: {counted(len(grid.values), 'value')} from {grid.values[0]:.6g} to {grid.values[-1]:.6g}"
    for each in variation.draws:
        yield f"{each.name}: {each.distribution}({', '.join(f'{a:.6g}' for a in each.arguments)})"
    if variation.draws:
        yield f"{variation.random:,} draws with seed {variation.seed}"


def _failures(sweep: Sweep) -> Iterator[str]:
    """The first message of each reason why runs did not get to their end."""
    messages: dict[str, str] = {}
    for table in sweep.batches(["stop", "message"]):
        for reason, message in zip(*(table.column(k).to_pylist() for k in range(2)), strict=True):
            if message is not None:
                messages.setdefault(reason, message)
    for reason, message in messages.items():
        more = ", the first of them" if sweep.reasons[reason] > 1 else ""
        yield f"  {reason}{more}: {visible(message)}"


def _warnings(sweep: Sweep) -> Iterator[str]:
    """How many runs have which warning."""
    for code, count in sweep.warning_counts.items():
        yield f"  {code} in {counted(count, 'row')}: {WARNINGS.get(code, 'of another version')}"


def _ranges(sweep: Sweep) -> Iterator[str]:
    """The least, the largest and the mean of each column of numbers."""
    names = ["transitions", "time", *(name for name in sweep.columns if name.startswith("final."))]
    found: dict[str, list[Array]] = {name: [] for name in names}
    for table in sweep.batches(names):
        for name in names:
            values = table.column(name).to_numpy().astype(float)
            values = values[np.isfinite(values)]
            found[name] += [np.array([values.min(), values.max(), values.sum(), len(values)])] if len(values) else []
    wide = max(map(len, names))
    for name, parts in found.items():
        if parts:
            low, high, total, count = np.transpose(parts)
            span = f"{low.min():<12.6g} to {high.max():<12.6g}"
            yield f"{visible(name):{wide}} {span} mean {total.sum() / count.sum():.6g}"
