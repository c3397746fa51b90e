"""Executions in files: ``.npz`` without loss, ``.csv`` and ``.parquet`` as tables with a JSON sidecar.

The sidecar of ``run.csv`` is ``run.csv.json``: it never replaces the ``run.json`` of another program. It holds the
checksum of its table, and never outlives or precedes it: both are written to the disk under other names, the old
sidecar is removed, and then the table and its sidecar are renamed into place. At worst a table is without one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hsdsl.analysis.store.npz import load, save_npz
from hsdsl.analysis.store.table import (
    forget_sidecar,
    read_sidecar,
    rows_of,
    sidecar_of,
    write_csv,
    write_parquet,
    write_sidecar,
)
from hsdsl.base.atomic import locked, replacing, unplaced
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.engine.execution import Execution

__all__ = ["forget_sidecar", "load", "read_sidecar", "save"]

_TABLES = {".csv": write_csv, ".parquet": write_parquet}


@checks_arguments
def save(
    execution: Execution,
    path: str | os.PathLike[str],
    samples: Any | None = None,
    columns: Sequence[str] | None = None,
    jumps: str = "both",
) -> tuple[Path, ...]:
    """Save an execution; see :meth:`hsdsl.engine.execution.Execution.save`."""
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix == ".npz":
        if columns is not None or jumps != "both":
            raise UsageError(
                "an .npz file holds the whole execution: choose columns and jumps for .csv or .parquet only"
            )
        with replacing(target) as file:
            save_npz(execution, file)
        return (target,)
    if suffix not in _TABLES:
        raise UsageError(f"{target} should end in .csv, .parquet or .npz: the suffix gives the format")
    rows = rows_of(execution, samples, jumps).only(execution.shown if columns is None else columns)
    description = sidecar_of(target)
    with unplaced(target) as table:
        _TABLES[suffix](rows, table.file)
        table.finish()
        with unplaced(description) as sidecar:
            write_sidecar(execution, rows, target.name, table.part, sidecar.file)
            sidecar.finish()
            with locked(table.target.parent):
                sidecar.target.unlink(missing_ok=True)
                table.place()
                sidecar.place()
    return target, description
