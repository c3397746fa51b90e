"""Programs of models read before, as JSON: to run one again needs no SymPy.

An entry is found by the bytes of the model file, this package's own files, the limits in force and, where there are
data files, the model's folder. It names the data files with their checksums, and is used only for the bytes that it was
made from; their rules hold each time. JSON is read into the types that `program` declares, and into nothing else.

Every piece of a program is a row of a table and is named by its number, and equal pieces are one row: the modes of a
large model have much in common, which is then read once.
"""

from __future__ import annotations

import hashlib
import json
import os
import types
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from hsdsl.base import cache as store
from hsdsl.language.files import DataRefused, ModelFiles
from hsdsl.mathematics import program as declared
from hsdsl.mathematics.program import Program

KIND = "programs"
_PACKAGE = Path(__file__).parents[1]
_READERS = ("base", "language", "mathematics", "analysis/sensitivity", "interface/model")  # what a program depends on
_PIECES: dict[str, Any] = {name: kind for name, kind in vars(declared).items() if is_dataclass(kind)}
LIST, LONG = "", 16  # the name of a row that is a list, and from how many items on a list is a row
_ATOMS = {str, int, float, bool, type(None)}
Row = list[Any]
Part = tuple[tuple[str, ...], ...]  # names that a model is reduced to, and then those that the rest is reduced to
SLIDING = ("", "sliding")  # in their place: the model with a mode for each surface that two modes press on


def key_of(files: ModelFiles, part: Part = ()) -> str:
    """The name of an entry; where there are data files, copies in two folders have one each."""
    folder = os.fsencode(files.folder.resolve()) if files.data != {} else b""
    return store.key_of(files.text, _fingerprint(), repr(files.limits), folder, repr(part))


@cache
def _fingerprint() -> str:
    """Size and time of this package's files, which differ between versions; hashing them takes longer than loading."""

    def described(folder: Path | str) -> Iterator[str]:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.endswith(".py"):
                    yield f"{entry.path} {entry.stat().st_size} {entry.stat().st_mtime_ns}"
                elif entry.name != "__pycache__" and entry.is_dir():
                    yield from described(entry.path)

    return "\n".join(sorted(line for reader in _READERS for line in described(_PACKAGE / reader)))


def find(files: ModelFiles, part: Part = ()) -> tuple[Program, ModelFiles] | None:
    """The program of a model read before, or of a part of it, and all bytes that it was made from.

    None where there is none, or where a data file has changed or breaks a rule.
    """
    for supposed in (files.with_data({}), files) if files.data is None else (files,):
        key = key_of(supposed, part)
        entry = store.find(KIND, key)
        with suppress(OSError, ValueError, KeyError, TypeError, IndexError, RecursionError, DataRefused):
            if entry is not None:
                return _verified(json.loads(entry.read_bytes()), files)
    return None


def is_kept(files: ModelFiles) -> bool:
    """Whether there seems to be an entry of a model: :func:`find` looks closer."""
    return any((store.folder() / KIND / key_of(each)).is_dir() for each in (files.with_data({}), files))


def _verified(entry: dict[str, Any], files: ModelFiles) -> tuple[Program, ModelFiles]:
    """Read an entry that was made from just these bytes; ValueError where it was made from others."""
    complete = files.with_data({name: files.content(name) for name in entry["files"]})
    if any(_checksum(complete.content(name)) != checksum for name, checksum in entry["files"].items()):
        raise ValueError("another data file")
    program = replace(_read(entry["rows"]), path=files.path)
    if program.digest != complete.digest:
        raise ValueError("another model")
    return program, complete


def keep(files: ModelFiles, program: Program, part: Part = ()) -> None:
    """Keep a program, where the cache can be written."""
    key = key_of(files, part)
    checksums = {name: _checksum(content) for name, content in (files.data or {}).items()}
    text = f'{{"files":{json.dumps(checksums)},"rows":[{",".join(_rows(program))}]}}'

    def write(target: Path) -> None:
        target.write_text(text)

    with suppress(OSError):
        store.keep(KIND, key, ".json", write)


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _rows(program: Program) -> Iterable[str]:
    """A program as JSON, row by row: the name of a piece's type and its fields, after the rows that they name."""
    numbers: dict[str, int] = {}
    long: dict[int, int] = {}  # lists, by the objects: every edge has the states of its target
    written = json.JSONEncoder(separators=(",", ":")).encode

    def plain(value: Any) -> Any:
        if isinstance(value, Fraction):
            return f"{value.numerator}/{value.denominator}"
        if isinstance(value, (tuple, list)):
            if len(value) < LONG:  # pyright: ignore[reportUnknownArgumentType]
                return every(value)  # pyright: ignore[reportUnknownArgumentType]
            if id(value) not in long:  # pyright: ignore[reportUnknownArgumentType]
                long[id(value)] = kept([LIST, *every(value)])  # pyright: ignore[reportUnknownArgumentType]
            return long[id(value)]  # pyright: ignore[reportUnknownArgumentType]
        if not is_dataclass(value):
            return value
        kind = type(value)
        return kept([kind.__name__, *every(getattr(value, name) for name in _fields(kind))])

    def every(values: Iterable[Any]) -> Row:
        return [value if type(value) in _ATOMS else plain(value) for value in values]

    def kept(row: Row) -> int:
        return numbers.setdefault(written(row), len(numbers))

    plain(program)
    return numbers


@cache
def _fields(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _read(rows: list[Row]) -> Program:
    """Read a table; it raises ValueError, TypeError, KeyError or IndexError where it is none of a program."""
    pieces: list[Any] = []
    for name, *row in rows:
        if name == LIST:
            pieces.append((row, {}))
            continue
        kind = _PIECES[name]
        pieces.append(kind(*(read(item, pieces) for read, item in zip(_decoders(kind), row, strict=True))))
    return _checked(Program)(pieces[-1], pieces)


Decoder = Callable[[Any, list[Any]], Any]


@cache
def _decoders(kind: Any) -> tuple[Decoder, ...]:
    hints = get_type_hints(kind)
    return tuple(_decoder(hints[field.name]) for field in fields(kind))


@cache
def _decoder(kind: Any) -> Decoder:
    """The function that turns JSON back into a type; it raises ValueError or TypeError where it does not fit."""
    origin, arguments = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        piece = _checked(kind)  # type: ignore[arg-type]
        return lambda value, pieces: piece(pieces[value], pieces)
    if origin is tuple and arguments[-1] is Ellipsis:
        one = _decoder(arguments[0])

        def read(value: Any, pieces: list[Any]) -> tuple[Any, ...]:
            if type(value) is not int:
                return tuple([one(item, pieces) for item in value])
            row, made = pieces[value]
            if read not in made:  # many pieces name one list
                made[read] = read(row, pieces)
            return made[read]

        return read
    if origin in (Union, types.UnionType):
        (other,) = (a for a in arguments if a is not type(None))
        given = _decoder(other)
        return lambda value, pieces: None if value is None else given(value, pieces)
    if kind is Fraction:
        return lambda value, _: Fraction(value)
    return _checked(dict if origin is dict else str if origin is Literal else kind)


def _checked(kind: type) -> Decoder:
    def read(value: Any, _: list[Any]) -> Any:
        if type(value) is not kind:
            raise TypeError(f"expected {kind.__name__}, got {type(value).__name__}")
        return value

    return read
