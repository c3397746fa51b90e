"""Executions in NumPy's ``.npz``: arrays and one JSON text, nothing pickled, nothing lost.

Multiprecision columns are decimal text with the digits that the stored precision (in bits) needs to read back the same
numbers. The arcs are rows of integers: layout, kind, jump, first, last, where a layout is a mode with its states.
"""

from __future__ import annotations

import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from hsdsl import decimals
from hsdsl.errors import UsageError
from hsdsl.execution import Arc, Array, Execution, Kind, Point, Stop, Transition, Verdict
from hsdsl.store.plain import Plain

FORMAT = "hsdsl execution"
VERSION = 1
COLUMNS = ("times", "values", "outputs", "depth", "coefficients")
KINDS: tuple[Kind, ...] = ("flow", "strip")
_TEXTS = ("model", "digest", "engine", "scheme", "method", "settings", "seconds", "digits", "title", "output_names")
_DAMAGE = (ValueError, KeyError, TypeError, IndexError, EOFError, AttributeError, zipfile.BadZipFile, zlib.error)


def save_npz(execution: Execution, file: BinaryIO) -> None:
    """Write an execution, everything but its ``output_function``."""
    columns = {name: getattr(execution, name) for name in COLUMNS}
    recorded = (execution.transitions, execution.final, execution.stop, execution.settings, execution.overrides)
    loose = Plain.numbers(recorded)
    packed = (x for column in columns.values() if column.dtype == object for x in column.ravel())
    plain = Plain(max(decimals.bits(packed), decimals.bits(loose)), execution.digits)
    layouts = list(dict.fromkeys((arc.mode, arc.states) for arc in execution.arcs))
    number = {layout: i for i, layout in enumerate(layouts)}
    arcs = [
        (number[arc.mode, arc.states], KINDS.index(arc.kind), arc.jump, arc.first, arc.last) for arc in execution.arcs
    ]
    header = {
        "format": FORMAT,
        "version": VERSION,
        "bits": plain.precision,
        "layouts": layouts,
        **{name: plain.pack(getattr(execution, name)) for name in _TEXTS},
        "overrides": plain.pack(execution.overrides),
        "stop": plain.pack_fields(execution.stop),
        "final": plain.pack_fields(execution.final),
        "verdict": plain.pack_fields(execution.verdict),
        "transitions": [plain.pack_fields(transition) for transition in execution.transitions],
    }
    text = np.frombuffer(json.dumps(header, allow_nan=False).encode(), dtype=np.uint8)
    arrays: dict[str, Any] = {name: plain.pack_array(column) for name, column in columns.items()}
    np.savez(file, **arrays, header=text, arcs=np.array(arcs, dtype=np.int64))


def load(path: str | os.PathLike[str]) -> Execution:
    """Read an execution from an ``.npz`` file that :meth:`hsdsl.execution.Execution.save` wrote.

    Raises
    ------
    UsageError
        When the file cannot be read, is damaged, or holds something else.
    """
    if Path(path).suffix.lower() != ".npz":
        raise UsageError(f"{os.fspath(path)} is not an .npz file: only those hold a whole execution")
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            return _read({name: archive[name] for name in archive.files})
    except OSError as error:
        raise UsageError(f"cannot read {os.fspath(path)}: {error.strerror or error}") from None
    except _DAMAGE:
        raise UsageError(
            f"cannot read {os.fspath(path)}: it is damaged, or not an execution that hsdsl saved"
        ) from None


def _read(archive: dict[str, Array]) -> Execution:
    header = cast("dict[str, Any]", json.loads(archive["header"].tobytes()))
    if header["format"] != FORMAT or header["version"] != VERSION:
        raise ValueError("another format")
    plain = Plain(header["bits"], header["digits"])
    layouts = [(str(mode), tuple(states)) for mode, states in header["layouts"]]
    arcs = tuple(
        Arc(*layouts[layout], KINDS[kind], jump, first, last)
        for layout, kind, jump, first, last in cast("list[tuple[int, ...]]", archive["arcs"].tolist())
    )
    fields: dict[str, Any] = {name: plain.unpack(header[name]) for name in _TEXTS}
    fields["overrides"] = plain.unpack(header.get("overrides", {}))  # files of earlier versions have none
    fields |= {name: plain.unpack_array(archive[name]) for name in COLUMNS}
    return Execution(
        stop=Stop(**plain.unpack_fields(header["stop"])),
        final=Point(**plain.unpack_fields(header["final"])),
        verdict=Verdict(**plain.unpack_fields(header["verdict"])),
        transitions=tuple(Transition(**plain.unpack_fields(record)) for record in header["transitions"]),
        arcs=arcs,
        **fields,
    )
