"""An execution as a table: its rows, its columns, and their text."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable
from typing import Any, BinaryIO

import numpy as np

from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Array, Execution, Samples
from hsdsl.engine.execution.records import optional
from hsdsl.engine.execution.run import evaluate, find, within

FORMULA = ("=", "+", "-", "@", "\t", "\r")


def at_samples(execution: Execution, samples: Any) -> Samples:
    """Give the rows at sample times, and both rows of each jump, in the order of hybrid time.

    Samples outside the run are left out: a run may stop before the last one.
    """
    instants, inside = within(execution, samples)
    rows, times = find(execution, instants[inside], "right")
    ends = [
        row
        for before, after in zip(execution.arcs, execution.arcs[1:], strict=False)
        if before.jump != after.jump
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
    text = io.TextIOWrapper(file, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    if header:
        writer.writerow(samples.labels)
    number = _writer_of(samples)
    cells = [_cells(values, present, number) for _, values, present in samples.columns()]
    writer.writerows(zip(*cells, strict=True))
    text.flush()
    text.detach()


def _writer_of(samples: Samples) -> Callable[[Any], str]:
    """Choose how numbers are written; all multiprecision ones are given the digits that the longest needs."""
    if samples.time.dtype != object:
        return repr
    numbers = (x for _, values, _ in samples.columns() if values.dtype == object for x in values)
    precision = decimals.bits(numbers)
    return lambda x: decimals.text(x, precision)


def _cells(values: Array, present: Array | None, number: Callable[[Any], str]) -> Iterable[str]:
    listed = values.tolist()
    if values.dtype.kind in "Ui":
        return (f"'{value}" if str(value).startswith(FORMULA) else str(value) for value in listed)
    if present is None or present.all():
        return map(number, listed)
    return [number(x) if there else "" for x, there in zip(listed, present.tolist(), strict=True)]


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
