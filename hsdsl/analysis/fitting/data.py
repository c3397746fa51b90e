"""Measurements over time: columns of states and outputs, from a CSV file or from arrays."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isinf
from pathlib import Path
from typing import Any, cast

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean, shown
from hsdsl.engine.execution import HYBRID_TIME, Array

TIMES = ("t", "time")
LEAST_ROWS = 1


@dataclass(frozen=True)
class Measurements:
    """Times, shape (n,), and columns by the name of a state or output, (n,); NaN where nothing was measured."""

    times: Array
    columns: dict[str, Array]

    @property
    def count(self) -> int:
        """How many numbers were measured."""
        return sum(int(np.isfinite(column).sum()) for column in self.columns.values())


def measurements(given: Any, known: Sequence[str]) -> Measurements:
    """Read measurements of the states and outputs in ``known``.

    Parameters
    ----------
    given : path, mapping or DataFrame
        A CSV file whose first row has names, or columns by name; ``t`` or ``time`` has the times. An empty cell was not
        measured. The columns ``mode`` and ``j`` of a run's own file are passed over.

    Raises UsageError: a column that is neither or comes twice, no times, or a cell that is no finite number.
    """
    if isinstance(given, Measurements):
        return given
    name, columns = _columns(given)
    timed = [c for c in columns if c.lower() in TIMES and c not in known]
    if len(timed) != 1:
        got = "both " + " and ".join(timed) if timed else ", ".join(columns) or "none"
        raise UsageError(f"{name}: expected a column t with the times, got {got}")
    (time,) = timed
    measured = [c for c in columns if c != time and c not in HYBRID_TIME]
    for column in measured:
        if column not in known:
            raise UsageError(f"{name}: the model has no state or output '{shown(column)}'", did_you_mean(column, known))
    if not measured:
        raise UsageError(f"{name}: no column is a state or output", f"known here: {', '.join(known)}")
    times = _numbers(name, time, columns[time])
    found = {column: _numbers(name, column, columns[column]) for column in measured}
    if any(len(column) != len(times) for column in found.values()):
        raise UsageError(f"{name}: columns differ in length")
    if not (times >= 0).all():
        raise UsageError(f"{name}: expected times that are not negative, got {times[~(times >= 0)][0]}")
    result = Measurements(times, found)
    if not result.count:
        raise UsageError(f"{name}: nothing was measured")
    return result


def _columns(given: Any) -> tuple[str, dict[str, Sequence[Any]]]:
    if isinstance(given, (str, Path)):
        return str(given), _read(Path(given))
    if hasattr(given, "columns") or isinstance(given, Mapping):
        table = cast(Any, given)
        names = _single("data", [*getattr(table, "columns", table)])
        return "data", {str(name): list(table[name]) for name in names}
    raise UsageError(f"data: expected a CSV file, a mapping or a DataFrame, got {type(given).__name__}")


def _read(path: Path) -> dict[str, Sequence[str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if row]
    except UnicodeDecodeError:
        raise UsageError(f"{path} cannot be read: it is no text in UTF-8") from None
    except (OSError, csv.Error) as error:
        raise UsageError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not rows:
        raise UsageError(f"{path} is empty", "its first row has the names of columns")
    names = _single(str(path), [name.strip() for name in rows[0]])
    for k, row in enumerate(rows[1:], 2):
        if len(row) != len(names):
            raise UsageError(f"{path}: row {k} has {len(row)} cells, and the first one has {len(names)}")
    return {name: [row[k] for row in rows[1:]] for k, name in enumerate(names)}


def _single(source: str, names: list[Any]) -> list[Any]:
    """The names, unless one comes twice."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise UsageError(f"{source}: expected a column once, got '{shown(str(name))}' twice")
    return names


def _numbers(name: str, column: str, cells: Sequence[Any]) -> Array:
    found: list[float] = []
    for k, cell in enumerate(cells):
        text = cell.strip() if isinstance(cell, str) else cell
        try:
            found.append(float("nan") if text in ("", None) else float(text))
        except (TypeError, ValueError):
            raise _no_number(name, column, k, cell) from None
        if isinf(found[-1]):
            raise _no_number(name, column, k, cell)
    return np.array(found)


def _no_number(name: str, column: str, k: int, cell: Any) -> UsageError:
    return UsageError(f"{name}: expected a finite number in column {column}, row {k + 2}, got '{shown(str(cell))}'")
