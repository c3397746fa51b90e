"""Executions in NumPy's ``.npz``: arrays and one JSON text, nothing pickled, nothing lost.

Multiprecision columns are decimal text with the digits that the stored precision (in bits) needs to read back the same
numbers. The arcs are rows of integers: layout, kind, jump, first, last, where a layout is a mode with its states.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np

from hsdsl import decimals
from hsdsl.errors import UsageError
from hsdsl.execution import Arc, Array, Execution, Kind, Point, Stop, Transition, Verdict
from hsdsl.files import open_regular
from hsdsl.store.plain import Plain
from hsdsl.store.sound import check

FORMAT = "hsdsl execution"
VERSION = 1
COLUMNS = ("times", "values", "outputs", "depth", "coefficients")
KINDS: tuple[Kind, ...] = ("flow", "strip")
_TEXTS = ("model", "digest", "engine", "scheme", "method", "settings", "seconds", "digits", "title", "output_names")
_BEGINNING = b"PK\x03\x04"
_DAMAGED = "it is damaged, or not an execution that hsdsl saved"


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
        When the file cannot be read, is damaged, is of a later version, or holds something else.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() != ".npz":
        raise UsageError(f"{name} is not an .npz file: only those hold a whole execution")
    try:
        with open_regular(path) as file:
            _check_whole(file)
            with np.load(file, allow_pickle=False) as archive:
                return _read(archive)
    except UsageError as error:
        raise UsageError(f"cannot read {name}: {error}", error.hint) from None
    except OSError as error:
        raise UsageError(f"cannot read {name}: {error.strerror or error}") from None
    except MemoryError:
        raise UsageError(f"cannot read {name}: it does not fit into memory") from None
    except Exception:  # what NumPy and the readers of ZIP and JSON raise for bytes that are none of theirs has no end
        raise UsageError(f"cannot read {name}: {_DAMAGED}") from None


def _check_whole(file: BinaryIO) -> None:
    """Refuse what is no archive, has lost its end, unfolds to more than it is (ours are not compressed), or whose
    checksums are wrong.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    beginning = file.read(len(_BEGINNING))
    if not zipfile.is_zipfile(file):
        cut = size < len(_BEGINNING) or beginning == _BEGINNING
        raise UsageError(_DAMAGED, "its end is missing: copy it again" if cut else None)
    with zipfile.ZipFile(file) as archive:
        if sum(member.file_size for member in archive.infolist()) > size or archive.testzip() is not None:
            raise UsageError(_DAMAGED)
    file.seek(0)


def _read(archive: Mapping[str, Array]) -> Execution:
    header = cast("dict[str, Any]", json.loads(archive["header"].tobytes()))
    if header["format"] != FORMAT or type(header["version"]) is not int or header["version"] < 1:
        raise ValueError("another format")
    if header["version"] > VERSION:
        message = f"a later version of hsdsl saved it, in format {header['version']:.20g}; this one reads {VERSION}"
        raise UsageError(message, "update hsdsl")
    plain = Plain(header["bits"], header["digits"])
    layouts = [(str(mode), tuple(states)) for mode, states in header["layouts"]]
    arcs = tuple(
        Arc(*layouts[layout], KINDS[kind], jump, first, last)
        for layout, kind, jump, first, last in cast("list[tuple[int, ...]]", archive["arcs"].tolist())
    )
    fields: dict[str, Any] = {name: plain.unpack(header[name]) for name in _TEXTS}
    fields["overrides"] = plain.unpack(header.get("overrides", {}))  # files of earlier versions have none
    fields |= {name: plain.unpack_array(archive[name]) for name in COLUMNS}
    execution = Execution(
        stop=Stop(**plain.unpack_fields(header["stop"])),
        final=Point(**plain.unpack_fields(header["final"])),
        verdict=Verdict(**plain.unpack_fields(header["verdict"])),
        transitions=tuple(Transition(**plain.unpack_fields(record)) for record in header["transitions"]),
        arcs=arcs,
        **fields,
    )
    check(execution)
    return execution
