"""An execution as a table, in CSV or Parquet, with a JSON sidecar.

The sidecar has model, settings and versions of the run, the checksum of its table, and what the table cannot hold.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import platform
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from hsdsl.analysis.report import as_json, dumps
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Array, Execution, Samples
from hsdsl.engine.execution.records import optional
from hsdsl.engine.execution.run import evaluate, find, within

FORMULA = ("=", "+", "-", "@", "\t", "\r")
JUMPS = ("both", "after", "none")
BLOCK = 2**14  # rows of which the text is made at once


def rows_of(execution: Execution, samples: Any, jumps: str) -> Samples:
    """Give the integrator's rows, or those at sample times, in the order of hybrid time; ``jumps`` as in `save`.

    Samples outside the run are left out: a run may stop before the last one.
    """
    if jumps not in JUMPS:
        raise UsageError(f"jumps: expected {', '.join(JUMPS[:-1])} or {JUMPS[-1]}, got {jumps!r}")
    if samples is None and jumps == "none":
        raise UsageError("a table without rows of jumps needs samples", "choose them, such as --samples every=0.05")
    found = execution.rows() if samples is None else _at_samples(execution, samples, jumps != "none")
    return found if jumps == "both" else found.at(np.append(found.time[1:] != found.time[:-1], True))


def _at_samples(execution: Execution, samples: Any, jumps: bool) -> Samples:
    instants, inside = within(execution, samples)
    rows, times = find(execution, instants[inside], "right")
    ends = [
        row
        for before, after in zip(execution.arcs, execution.arcs[1:], strict=False)
        if jumps and before.jump != after.jump
        for row in (before.last, after.first)
    ]
    points = {(int(row), execution.times[row]) for row in ends} | set(zip(rows.tolist(), times, strict=True))
    ordered = sorted(points)
    ordered_times = np.array([time for _, time in ordered], dtype=execution.times.dtype)
    return evaluate(execution, np.array([row for row, _ in ordered], dtype=int), ordered_times)


def write_csv(samples: Samples, file: BinaryIO, header: bool = True) -> None:
    """Write CSV (UTF-8): ``time,mode,j``, states, outputs; numbers such that they read back exactly.

    A text that a spreadsheet reads as a formula (a mode may be called ``=1+1``) follows an apostrophe. A cell is empty
    where the mode lacks the state or does not define the output; a state that is not a number is ``nan``.
    """
    if header:
        file.write((",".join(map(_quoted, samples.labels)) + "\n").encode())
    number = _writer_of(samples)
    for start in range(0, len(samples), BLOCK):
        rows = slice(start, start + BLOCK)
        cells = (
            _cells(values[rows], present if present is None else present[rows], number)
            for _, values, present in samples.columns()
        )
        file.write("".join([f"{line}\n" for line in map(",".join, zip(*cells, strict=True))]).encode())


def _quoted(text: str) -> str:
    """A text as a cell."""
    row = io.StringIO()
    csv.writer(row, lineterminator="\n").writerow((f"'{text}" if text.startswith(FORMULA) else text, ""))
    return row.getvalue()[: -len(",\n")]


def _writer_of(samples: Samples) -> Callable[[Any], str]:
    """Choose how numbers are written; all multiprecision ones are given the digits that the longest needs."""
    if samples.time.dtype != object:
        return repr
    numbers = (x for _, values, _ in samples.columns() if values.dtype == object for x in values)
    precision = decimals.bits(numbers)
    return lambda x: decimals.text(x, precision)


def _cells(values: Array, present: Array | None, number: Callable[[Any], str]) -> list[str]:
    """The cells of a column; equal numbers that follow each other, as at jumps, are written once."""
    if values.dtype.kind == "U":
        listed: list[str] = values.tolist()
        texts = {text: _quoted(text) for text in set(listed)}
        return [texts[text] for text in listed]
    alike = values if values.dtype.kind in "Oui" else np.ascontiguousarray(values).view(np.int64)
    fresh = np.append(True, alike[1:] != alike[:-1])
    cells = np.array([number(x) for x in values[fresh].tolist()], object)[np.cumsum(fresh) - 1]
    if present is not None:
        cells[~present] = ""
    return cells.tolist()


def write_parquet(samples: Samples, file: BinaryIO) -> None:
    """Write Parquet: the CSV's columns, null where it has an empty cell.

    Multiprecision numbers are decimal text, since Parquet has no type that holds them.

    Raises UsageError: when pyarrow is not installed.
    """
    arrow = optional("pyarrow", "a Parquet file")
    parquet = optional("pyarrow.parquet", "a Parquet file")
    number = _writer_of(samples)
    columns: dict[str, Any] = {}
    for label, values, present in samples.columns():
        missing = None if present is None else ~present
        if values.dtype == object:
            values = np.array([number(x) for x in values], dtype=object)
        columns[label] = arrow.array(values, mask=missing, from_pandas=False)
    parquet.write_table(arrow.table(columns), file)


FORMAT, VERSION = "hsdsl table", 2  # sidecars of version 1 name neither
LIBRARIES = ("hsdsl", "numpy", "mpmath", "sympy")


@cache
def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that numbers can depend on."""
    known = {"python": platform.python_version()}
    for library in LIBRARIES:
        with suppress(metadata.PackageNotFoundError):
            known[library] = metadata.version(library)
    return known


def sidecar_of(table: Path) -> Path:
    return table.with_name(table.name + ".json")


@checks_arguments
def read_sidecar(table: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the sidecar of a table, if it belongs to that table.

    Raises UsageError: there is none, it is damaged, or the table was changed or replaced since.
    """
    path = sidecar_of(Path(table))
    try:
        sidecar, checksum = _parsed(path), _checksum(Path(table))
    except OSError as error:
        raise UsageError(f"cannot read {os.fspath(table)} and its sidecar: {error.strerror or error}") from None
    if sidecar is None:
        raise UsageError(f"{path} is damaged, or not the sidecar of a table")
    if sidecar.get("version", 1) > VERSION:
        raise UsageError(f"a later version of hsdsl wrote {path}; this one reads {VERSION}", "update hsdsl")
    if sidecar.get("table_sha256") != checksum:
        raise UsageError(f"{path} does not belong to {os.fspath(table)}, which was changed or replaced since")
    return sidecar


def forget_sidecar(table: Path) -> None:
    """Remove the sidecar of a table that is about to be written over; a file of its name that is none stays."""
    path = sidecar_of(table)
    with suppress(FileNotFoundError):
        if path.is_file() and _parsed(path) is not None:
            path.unlink()


def _parsed(path: Path) -> dict[str, Any] | None:
    try:
        content: Any = json.loads(path.read_bytes())
        known = isinstance(content["table"]["file"], str) and isinstance(content["versions"], dict)
        known = known and type(content.get("version", 1)) is int
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return cast("dict[str, Any]", content) if known else None


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_sidecar(execution: Execution, table: Samples, name: str, written: Path, file: BinaryIO) -> None:
    """Write the sidecar of the table that will be called ``name`` and is ``written`` already.

    Its object is that of `run --json`, with the model's hash, versions and the table's shape and hash.
    """
    run = as_json(execution)
    content = {
        "format": FORMAT,
        "version": VERSION,
        "model": run.pop("model"),
        "sha256": execution.digest,
        "title": execution.title,
        "versions": versions(),
        "table": {"file": name, "rows": len(table), "columns": list(table.labels)},
        "table_sha256": _checksum(written),
        "digits": execution.digits,
        **run,
    }
    file.write((dumps(content) + "\n").encode())
