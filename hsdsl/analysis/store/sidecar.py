"""The JSON file of a table: model, settings and versions of the run, and what the table cannot hold."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any, BinaryIO, cast

from hsdsl.analysis.report import as_json, dumps
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.engine.execution import Execution, Samples

FORMAT, VERSION = "hsdsl table", 2  # sidecars of version 1 name neither
LIBRARIES = ("hsdsl", "numpy", "mpmath", "sympy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that numbers can depend on."""
    known = {"python": platform.python_version()}
    for library in LIBRARIES:
        with suppress(metadata.PackageNotFoundError):
            known[library] = metadata.version(library)
    return known


def sidecar_of(table: Path) -> Path:
    """Name the sidecar of a table."""
    return table.with_name(table.name + ".json")


@checks_arguments
def read_sidecar(table: str | os.PathLike[str]) -> dict[str, Any]:
    """Read what the sidecar of a table says, if it is that table's.

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
