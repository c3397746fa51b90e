"""The JSON beside a table: what was run, with what settings and versions, and what the table cannot say."""

from __future__ import annotations

import platform
from importlib import metadata
from typing import Any, BinaryIO

from hsdsl.execution import Execution, Samples
from hsdsl.report import as_json, dumps

LIBRARIES = ("hsdsl", "numpy", "mpmath", "sympy")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that numbers can depend on."""
    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found


def describe(execution: Execution, table: Samples, name: str) -> dict[str, Any]:
    """Return the sidecar's object: that of `run --json`, with the model's hash, versions and the table's shape."""
    run = as_json(execution)
    return {
        "model": run.pop("model"),
        "sha256": execution.digest,
        "title": execution.title,
        "versions": versions(),
        "table": {"file": name, "rows": len(table), "columns": list(table.labels)},
        "digits": execution.digits,
        **run,
    }


def write_sidecar(execution: Execution, table: Samples, name: str, file: BinaryIO) -> None:
    """Write the sidecar of the table called ``name``."""
    file.write((dumps(describe(execution, table, name)) + "\n").encode())
