"""Programs of models read before: kept as JSON, so that to run one again needs no SymPy.

An entry is found by the bytes of the model file, this package's own files and the limits in force; it names the data
files that were read with their checksums, and holds for as long as they are unchanged. JSON is read into the types that
`hsdsl.program` declares, and into nothing else.
"""

from __future__ import annotations

import hashlib
import json
import types
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from hsdsl import cache as store
from hsdsl.limits import Limits, current
from hsdsl.program import Program

KIND = "programs"
_PACKAGE = Path(__file__).parents[1]


def key_of(model: bytes, limits: Limits | None) -> str:
    """Return the name of the entry of a model file with these bytes."""
    return store.key_of(model, _fingerprint(), repr(limits or current()))


@cache
def _fingerprint() -> str:
    """What tells this package's files from those of another version; to hash them would take as long as to use them."""
    stats = ((str(path), path.stat()) for path in sorted(_PACKAGE.rglob("*.py")))
    return "\n".join(f"{path} {status.st_size} {status.st_mtime_ns}" for path, status in stats)


def find(path: Path, key: str) -> Program | None:
    """Return the program of a model read before, None where there is none or a data file has changed."""
    entry = store.find(KIND, key)
    if entry is None:
        return None
    with suppress(OSError, ValueError, KeyError, TypeError):
        found = json.loads(entry.read_bytes())
        if all(_checksum((path.parent / name).read_bytes()) == checksum for name, checksum in found["files"].items()):
            program: Program = _reader(Program)(found["program"])
            return replace(program, path=str(path))
    return None


def keep(path: Path, key: str, program: Program, files: Mapping[str, str]) -> None:
    """Keep a program; nothing happens where nothing can be kept. ``files`` are data files with their checksums."""
    text = json.dumps({"files": dict(files), "program": _plain(program)}, separators=(",", ":"))
    with suppress(OSError):
        store.keep(KIND, key, ".json", lambda target: _write(target, text))


def _write(target: Path, text: str) -> None:
    target.write_text(text)


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _plain(value: Any) -> Any:
    """Turn frozen data into what JSON has: a dataclass is the list of its fields."""
    if isinstance(value, Fraction):
        return f"{value.numerator}/{value.denominator}"
    if is_dataclass(value):
        return [_plain(getattr(value, field.name)) for field in fields(value)]
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
    return value


@cache
def _reader(kind: Any) -> Callable[[Any], Any]:
    """Make the function that turns JSON back into a type; it raises ValueError or TypeError where it does not fit."""
    origin, arguments = get_origin(kind), get_args(kind)
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        readers = [_reader(hints[field.name]) for field in fields(kind)]
        return lambda value: kind(*(read(item) for read, item in zip(readers, value, strict=True)))  # type: ignore[operator]
    if origin is tuple and arguments[-1] is Ellipsis:
        one = _reader(arguments[0])
        return lambda value: tuple(map(one, value))
    if origin in (Union, types.UnionType):
        (other,) = (a for a in arguments if a is not type(None))
        given = _reader(other)
        return lambda value: None if value is None else given(value)
    if kind is Fraction:
        return Fraction
    return _checked(dict if origin is dict else str if origin is Literal else kind)


def _checked(kind: type) -> Callable[[Any], Any]:
    def read(value: Any) -> Any:
        if type(value) is not kind:
            raise TypeError(f"{kind.__name__} expected")
        return value

    return read
