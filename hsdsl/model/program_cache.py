"""Programs of models read before: kept as JSON, so that to run one again needs no SymPy.

An entry is found by the bytes of the model file, this package's own files, the limits in force and, where there are
data files, the model's folder. It names the data files with their checksums, and is used only for the bytes that it was
made from; their rules hold each time. JSON is read into the types that `hsdsl.program` declares, and into nothing else.

Every piece of a program is a row of a table and is named by its number, and equal pieces are one row: the modes of a
large model have much in common, which is then read once.
"""

from __future__ import annotations

import hashlib
import json
import os
import types
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from hsdsl import cache as store
from hsdsl import program as declared
from hsdsl.files import DataRefused, folder_of
from hsdsl.model.written import Written
from hsdsl.program import Program

KIND = "programs"
_PACKAGE = Path(__file__).parents[1]
_READERS = (
    "files",
    "source",
    "schema",
    "expression",
    "elaborate",
    "lower",
    "model",
)  # what a program depends on, beside files
_PIECES: dict[str, Any] = {name: kind for name, kind in vars(declared).items() if is_dataclass(kind)}
Row = list[Any]


Part = tuple[tuple[str, ...], ...]  # names of states and outputs asked for, and then of those of what is left


def key_of(written: Written, part: Part = ()) -> str:
    """Return the name of an entry; where there are data files, copies in two folders have one each."""
    folder = os.fsencode(folder_of(written.path).resolve()) if written.files != {} else b""
    return store.key_of(written.text, _fingerprint(), repr(written.limits), folder, repr(part))


@cache
def _fingerprint() -> str:
    """What tells this package's files from those of another version; to hash them would take as long as to use them."""
    return "\n".join(sorted(_described(_PACKAGE, *(_PACKAGE / name for name in _READERS))))


def _described(*folders: Path) -> Iterator[str]:
    for folder in folders:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.endswith(".py"):
                    status = entry.stat()
                    yield f"{entry.path} {status.st_size} {status.st_mtime_ns}"


def find(written: Written, part: Part = ()) -> tuple[Program, Written] | None:
    """Return the program of a model read before, or of a part of it, beside all that it was made from.

    None where there is none, or where a data file is another one by now or breaks a rule.
    """
    for supposed in (written.with_files({}), written) if written.files is None else (written,):
        entry = store.find(KIND, key_of(supposed, part))
        with suppress(OSError, ValueError, KeyError, TypeError, IndexError, RecursionError, DataRefused):
            if entry is not None:
                return _found(json.loads(entry.read_bytes()), written)
    return None


def _found(entry: dict[str, Any], written: Written) -> tuple[Program, Written]:
    """Read an entry that was made from just these bytes; ValueError where it was made from others."""
    complete = written.with_files({name: written.data(name) for name in entry["files"]})
    if any(_checksum(complete.data(name)) != checksum for name, checksum in entry["files"].items()):
        raise ValueError("another data file")
    program = replace(_read(entry["rows"]), path=written.path)
    if program.digest != complete.digest:
        raise ValueError("another model")
    return program, complete


def keep(written: Written, program: Program, part: Part = ()) -> None:
    """Keep a program; nothing happens where nothing can be kept."""
    files = {name: _checksum(content) for name, content in (written.files or {}).items()}
    text = json.dumps({"files": files, "rows": _rows(program)}, separators=(",", ":"))
    with suppress(OSError):
        store.keep(KIND, key_of(written, part), ".json", lambda target: _write(target, text))


def _write(target: Path, text: str) -> None:
    target.write_text(text)


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _rows(program: Program) -> list[Row]:
    """Turn a program into rows of what JSON has: the name of a piece's type and its fields, behind what it names."""
    rows: list[Row] = []
    numbers: dict[str, int] = {}

    def plain(value: Any) -> Any:
        if isinstance(value, Fraction):
            return f"{value.numerator}/{value.denominator}"
        if isinstance(value, (tuple, list)):
            return [plain(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
        if not is_dataclass(value):
            return value
        row = [type(value).__name__, *(plain(getattr(value, field.name)) for field in fields(value))]
        number = numbers.setdefault(json.dumps(row), len(rows))
        if number == len(rows):
            rows.append(row)
        return number

    plain(program)
    return rows


def _read(rows: list[Row]) -> Program:
    """Read a table; it raises ValueError, TypeError, KeyError or IndexError where it is none of a program."""
    pieces: list[Any] = []
    for name, *row in rows:
        kind = _PIECES[name]
        pieces.append(kind(*(read(item, pieces) for read, item in zip(_readers(kind), row, strict=True))))
    return _checked(Program)(pieces[-1], pieces)


Reader = Callable[[Any, list[Any]], Any]


@cache
def _readers(kind: Any) -> tuple[Reader, ...]:
    hints = get_type_hints(kind)
    return tuple(_reader(hints[field.name]) for field in fields(kind))


@cache
def _reader(kind: Any) -> Reader:
    """Make the function that turns JSON back into a type; it raises ValueError or TypeError where it does not fit."""
    origin, arguments = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        piece = _checked(kind)  # type: ignore[arg-type]
        return lambda value, pieces: piece(pieces[value], pieces)
    if origin is tuple and arguments[-1] is Ellipsis:
        one = _reader(arguments[0])
        return lambda value, pieces: tuple([one(item, pieces) for item in value])
    if origin in (Union, types.UnionType):
        (other,) = (a for a in arguments if a is not type(None))
        given = _reader(other)
        return lambda value, pieces: None if value is None else given(value, pieces)
    if kind is Fraction:
        return lambda value, _: Fraction(value)
    return _checked(dict if origin is dict else str if origin is Literal else kind)


def _checked(kind: type) -> Reader:
    def read(value: Any, _: list[Any]) -> Any:
        if type(value) is not kind:
            raise TypeError(f"{kind.__name__} expected")
        return value

    return read
