"""Executions in NumPy's ``.npz``: arrays and one JSON text, nothing pickled, nothing lost.

Multiprecision columns are decimal text with the digits that the stored precision (in bits) needs to read back the same
numbers. The arcs are rows of integers: layout, kind, and their own, where a layout is a mode with its states. Floats
that are not finite, mpmath numbers and tuples keep their types: a value without a form in JSON is an object of one key
that begins with ``$``.
"""

from __future__ import annotations

import json
import math
import os
import types
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO, Literal, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

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
    """Read an execution from an ``.npz`` file of :meth:`hsdsl.engine.execution.Execution.save`.

    Raises UsageError: when the file cannot be read, is damaged, is of a later version, or holds something else.
    """
    name = os.fspath(path)
    if Path(path).suffix.lower() != ".npz":
        raise UsageError(f"{name} is not an .npz file: only those hold a whole execution")
    try:
        with open_regular(path) as file:
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
    fields["overrides"] = form.unpack(header.get("overrides", {}))  # files of earlier versions have neither
    warnings = tuple(RunWarning(**form.unpack(record)) for record in header.get("warnings", ()))
    fields |= {name: form.unpack_array(archive[name]) for name in COLUMNS}
    execution = Execution(
        stop=Stop(**form.unpack(header["stop"])),
        final=Point(**form.unpack(header["final"])),
        verdict=Verdict(**form.unpack(header["verdict"]) | {"warnings": warnings}),
        transitions=tuple(Transition(**form.unpack(record)) for record in header["transitions"]),
        arcs=arcs,
        **fields,
    )
    _check(execution)
    return execution


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


def numbers(value: Any) -> Iterator[Any]:
    if decimals.is_multiprecision(value):
        yield value
    elif isinstance(value, Mapping):
        yield from numbers(list(cast("Mapping[Any, Any]", value).values()))
    elif isinstance(value, (tuple, list)):
        for item in cast("list[Any]", value):
            yield from numbers(item)


@dataclass(frozen=True)
class Lossless:
    """Numbers written at ``precision`` bits, and read into the context of ``digits`` decimal digits."""

    precision: int
    digits: int | None

    def pack(self, value: Any) -> Any:
        """Make a value one that JSON has.

        Raises TypeError: for a value of a kind that executions do not record.
        """
        match value:
            case np.generic():
                return self.pack(cast(Any, value).item())
            case None | str() | bool() | int():
                return value
            case float():
                return value if math.isfinite(value) else {"$float": repr(value)}
            case Mapping():
                items = [(key, self.pack(item)) for key, item in cast("Mapping[Any, Any]", value).items()]
                if all(isinstance(key, str) and not key.startswith("$") for key, _ in items):
                    return dict(items)
                return {"$map": [[self.pack(key), item] for key, item in items]}
            case tuple():
                return {"$tuple": [self.pack(item) for item in cast("tuple[Any, ...]", value)]}
            case list():
                return [self.pack(item) for item in cast("list[Any]", value)]
            case _ if decimals.is_multiprecision(value):
                return {"$mpf": decimals.text(value, self.precision)}
            case _:
                raise TypeError(f"a {type(value).__name__} cannot be stored")

    def unpack(self, value: Any) -> Any:
        """Undo :meth:`pack`."""
        match value:
            case {"$mpf": text}:
                return self._number(text)
            case {"$float": text}:
                return float(text)
            case {"$tuple": items}:
                return tuple(self.unpack(item) for item in items)
            case {"$map": items}:
                return {self.unpack(key): self.unpack(item) for key, item in items}
            case dict():
                return {key: self.unpack(item) for key, item in cast("dict[str, Any]", value).items()}
            case list():
                return [self.unpack(item) for item in cast("list[Any]", value)]
            case _:
                return value

    def pack_fields(self, record: Any) -> dict[str, Any]:
        """Make a dataclass a mapping of its fields."""
        return {field.name: self.pack(getattr(record, field.name)) for field in fields(record)}

    def pack_array(self, column: Array) -> Array:
        """Make an array one that needs no pickling: a multiprecision one becomes text."""
        if column.dtype != object:
            return column
        context = decimals.context_of(self.digits or 15)
        texts = [decimals.text(context.convert(x), self.precision) for x in column.ravel()]
        return np.array(texts, dtype="S" if texts else "S1").reshape(column.shape)

    def unpack_array(self, column: Array) -> Array:
        """Undo :meth:`pack_array`."""
        if column.dtype.kind != "S":
            return column
        values = np.empty(column.size, dtype=object)
        values[:] = [self._number(text.decode()) for text in column.ravel().tolist()]
        return values.reshape(column.shape)

    def _number(self, written: str) -> Any:
        return decimals.read(written, self.precision, decimals.context_of(self.digits or 15))
