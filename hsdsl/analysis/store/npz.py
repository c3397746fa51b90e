"""Executions in NumPy's ``.npz``: arrays and one JSON text, nothing pickled, nothing lost.

Multiprecision columns are decimal text with the digits that the stored precision (in bits) needs to read back the same
numbers. The arcs are rows of integers: layout, kind, and their own, where a layout is a mode with its states.
"""

from __future__ import annotations

import json
import os
import types
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, Literal, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from hsdsl.analysis.store.lossless import Lossless, numbers
from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_arguments
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Arc, Array, Execution, Kind, Point, RunWarning, Stop, Transition, Verdict
from hsdsl.language.files import open_regular

FORMAT = "hsdsl execution"
VERSION = 1
COLUMNS = {"times": 1, "values": 2, "outputs": 2, "depth": 1, "coefficients": 3}  # and their dimensions
INTEGERS = tuple(field.name for field in fields(Arc) if field.type == "int")
KINDS: tuple[Kind, ...] = ("flow", "strip")
_TEXTS = ("model", "digest", "engine", "scheme", "method", "settings", "seconds", "digits", "title", "output_names")
_OF_VERDICT = ("theorem", "reasons")  # its warnings are beside it
_BEGINNING = b"PK\x03\x04"
_DAMAGED = "it is damaged, or not an execution that hsdsl saved"


def save_npz(execution: Execution, file: BinaryIO) -> None:
    """Write an execution, everything but its ``output_function``."""
    columns = {name: getattr(execution, name) for name in COLUMNS}
    warnings = execution.warnings
    records = [asdict(record) for record in (execution.final, execution.stop, *execution.transitions, *warnings)]
    loose = numbers([records, execution.settings, execution.overrides])
    packed = (x for column in columns.values() if column.dtype == object for x in column.ravel())
    form = Lossless(max(decimals.bits(packed), decimals.bits(loose)), execution.digits)
    layouts = list(dict.fromkeys((arc.mode, arc.states) for arc in execution.arcs))
    order = {layout: i for i, layout in enumerate(layouts)}
    arcs = [(order[a.mode, a.states], KINDS.index(a.kind), *(getattr(a, n) for n in INTEGERS)) for a in execution.arcs]
    header = {
        "format": FORMAT,
        "version": VERSION,
        "bits": form.precision,
        "layouts": layouts,
        **{name: form.pack(getattr(execution, name)) for name in _TEXTS},
        "overrides": form.pack(execution.overrides),
        "stop": form.pack_fields(execution.stop),
        "final": form.pack_fields(execution.final),
        "verdict": {name: form.pack(getattr(execution.verdict, name)) for name in _OF_VERDICT},
        "warnings": [form.pack_fields(warning) for warning in warnings],
        "transitions": [form.pack_fields(transition) for transition in execution.transitions],
    }
    text = np.frombuffer(json.dumps(header, allow_nan=False).encode(), dtype=np.uint8)
    arrays: dict[str, Any] = {name: form.pack_array(column) for name, column in columns.items()}
    np.savez(file, **arrays, header=text, arcs=np.array(arcs, dtype=np.int64))


@checks_arguments
def load(path: str | os.PathLike[str]) -> Execution:
    """Read an execution from an ``.npz`` file that :meth:`hsdsl.engine.execution.Execution.save` wrote.

    Raises UsageError: when the file cannot be read, is damaged, is of a later version, or holds something else.
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
    form = Lossless(header["bits"], header["digits"])
    layouts = [(str(mode), tuple(states)) for mode, states in header["layouts"]]
    arcs = tuple(
        Arc(*layouts[layout], KINDS[kind], *integers)
        for layout, kind, *integers in cast("list[tuple[int, ...]]", archive["arcs"].tolist())
    )
    fields: dict[str, Any] = {name: form.unpack(header[name]) for name in _TEXTS}
    fields["overrides"] = form.unpack(header.get("overrides", {}))  # files of earlier versions have none
    fields |= {name: form.unpack_array(archive[name]) for name in COLUMNS}
    execution = Execution(
        stop=Stop(**form.unpack(header["stop"])),
        final=Point(**form.unpack(header["final"])),
        verdict=Verdict(**form.unpack(header["verdict"]) | {"warnings": _warnings(header, form)}),
        transitions=tuple(Transition(**form.unpack(record)) for record in header["transitions"]),
        arcs=arcs,
        **fields,
    )
    _check(execution)
    return execution


def _warnings(header: Mapping[str, Any], form: Lossless) -> tuple[RunWarning, ...]:
    """The warnings; files of earlier versions have none."""
    return tuple(RunWarning(**form.unpack(record)) for record in header.get("warnings", ()))


def _check(execution: Execution) -> None:
    """Check the declared types, which an execution does not check itself; TypeError where a part has another."""
    _check_fields(execution, {*_TEXTS})
    _check_fields(execution.verdict, _OF_VERDICT)
    records = execution.stop, execution.final, *execution.transitions, *execution.arcs, *execution.warnings
    for record in records:
        _check_fields(record, {field.name for field in fields(record)})
    for name, dimensions in COLUMNS.items():
        column: Array = getattr(execution, name)
        if column.ndim != dimensions or str(column.dtype) not in ("float64", "object"):
            raise TypeError(f"{name} has another shape or type")
    widths = {len(arc.states) for arc in execution.arcs}
    if execution.values.shape[1] < max(widths) or execution.outputs.shape[1] != len(execution.output_names):
        raise TypeError("columns are missing")
    if execution.digits is not None and execution.digits < 1:
        raise TypeError("no such precision")
    left_out = execution.settings.get("left_out", {"states": (), "reason": ""})
    if not (_fits(left_out["states"], tuple[str, ...]) and type(left_out["reason"]) is str):
        raise TypeError("left_out has another form")


def _check_fields(record: object, names: Iterable[str]) -> None:
    hints = _hints(type(record))
    for name in names:
        if not _fits(getattr(record, name), dict if name == "settings" else hints[name]):
            raise TypeError(f"{name} has another type")


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind)


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a declared type; what is declared as anything is a number."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind in (Any, float):
        return type(value) in (int, float) or decimals.is_multiprecision(value)
    if kind is type(None):
        return value is None
    if origin is Literal:
        return value in arguments
    if origin is tuple:
        items = cast("tuple[Any, ...]", value)
        return isinstance(value, (tuple, list)) and all(_fits(item, arguments[0]) for item in items)
    if origin is dict:
        entries = cast("dict[Any, Any]", value)
        return isinstance(value, dict) and all(type(k) is str and _fits(v, arguments[1]) for k, v in entries.items())
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in arguments)
    return type(value) is kind
