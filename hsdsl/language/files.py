"""The bytes of model files and of their data files: read once, capped, none from a device or from a forbidden place.

All that is made of a model is made of these bytes: a file that is saved meanwhile changes nothing.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import select
import stat
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from hsdsl.base import limits
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits, applied
from hsdsl.base.names import closest, shown

STANDARD_INPUT = ("-", "/dev/stdin")
READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_SILENCE = 10.0  # seconds for which a named pipe may have nobody who writes to it
_MOST_ENTRIES = 1000  # of a folder, looked through for a hint


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a model, as many as it may have and one more; `-` is standard input.

    Raises UsageError: when there is nothing to read, or something without an end.
    """
    most = limits.current().bytes + 1
    try:
        if os.fspath(path) in STANDARD_INPUT:
            return _standard_input(most)
        _refuse_device(os.stat(path).st_mode)  # to open some devices is to do something
        with open(os.open(path, READ), "rb", buffering=0) as stream:
            return _content(stream.fileno(), most, path)
    except (OSError, ValueError) as error:
        if isinstance(path, str) and ("\n" in path.strip() or "hsdsl: " in path):  # several lines, or a key
            message = f"this is the text of a model, not the path of its file: `{shown(os.fspath(path), 40)}`"
            raise UsageError(message, "hsdsl.loads(text) reads a model from its text") from None
        raise UsageError(f"{os.fspath(path)}: {reason(error)}", _models_nearby(Path(path))) from None


def open_regular(path: str | os.PathLike[str], flags: int = 0) -> BinaryIO:
    """Open a regular file to read; anything else is refused before it could keep us waiting.

    Raises OSError: it cannot be opened, or is none.
    """
    refusal = OSError(errno.EINVAL, "this is not a regular file")
    mode = os.stat(path).st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # to open some devices is to do something
        raise refusal
    stream = open(os.open(path, READ | flags), "rb")  # noqa: SIM115 - the caller closes it
    if stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        return stream
    stream.close()  # exchanged meanwhile
    raise refusal


def is_piped(path: str | os.PathLike[str]) -> bool:
    """Whether the content there can be read once only."""
    return os.fspath(path) in STANDARD_INPUT or Path(path).is_fifo()


def reason(error: OSError | ValueError) -> str:
    """Why a file could not be read, for a person."""
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    if isinstance(error, IsADirectoryError):
        return "this is a folder, not a file"
    if isinstance(error, PermissionError):
        return "the file may not be read"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower()
    return "this cannot be the name of a file"


def _standard_input(most: int) -> bytes:
    if sys.stdin is None or sys.stdin.closed:
        raise OSError(errno.EBADF, "there is no standard input")
    stream = sys.stdin.buffer
    try:
        mode = os.fstat(stream.fileno()).st_mode
    except io.UnsupportedOperation:  # something in memory replaces it
        mode = 0
    if not stream.isatty():
        _refuse_device(mode)
    return stream.read(most)


def _refuse_device(mode: int) -> None:
    if stat.S_ISBLK(mode) or stat.S_ISCHR(mode):
        raise OSError(errno.ENODEV, "this is a device, not a file")


def _content(descriptor: int, most: int, path: str | os.PathLike[str]) -> bytes:
    """Read to the end, or ``most`` bytes. Of a named pipe nothing is the end only after something, or a while."""
    mode = os.fstat(descriptor).st_mode
    _refuse_device(mode)
    if stat.S_ISDIR(mode):
        raise IsADirectoryError
    named = stat.S_ISFIFO(mode) and os.path.exists(os.path.realpath(path))
    data, latest = bytearray(), time.monotonic() + _SILENCE
    while len(data) < most:
        try:
            chunk = os.read(descriptor, most - len(data))
        except BlockingIOError:
            if stat.S_ISREG(mode):
                raise
            select.select([descriptor], [], [])
            continue
        data += chunk
        if not chunk and (data or not named):
            break
        if not chunk:
            if time.monotonic() > latest:
                raise OSError(errno.EPIPE, "nobody writes to this pipe")
            time.sleep(0.01)
    return bytes(data)


def _models_nearby(path: Path) -> str | None:
    """The hint for a file that is not there, or for a folder: a model that is."""
    try:
        folder = path if path.is_dir() else path.parent
        models = [entry for entry in islice(folder.iterdir(), _MOST_ENTRIES) if entry.suffix in (".yaml", ".yml")]
    except (OSError, ValueError):
        return None
    names = {entry.name: str(entry) for entry in sorted(models)}
    if path.is_dir():
        return f"name a model, such as {next(iter(names.values()))}" if names else "name a model file"
    near = closest(path.name, names)
    return f"did you mean '{names[near]}'?" if near else None


LARGEST = 64 << 20  # bytes


class DataRefused(Exception):
    """A data file that cannot be used: the code, the sentence and the hint of its diagnostic."""

    def __init__(self, code: str, message: str, hint: str | None = None) -> None:
        super().__init__(code, message, hint)
        self.code, self.message, self.hint = code, message, hint


@dataclass(frozen=True)
class ModelFiles:
    """A model's path and bytes, and the bytes of its data files by name; None while their names are not known."""

    path: str
    text: bytes = field(repr=False)
    limits: Limits
    data: Mapping[str, bytes] | None = field(default=None, repr=False)

    @classmethod
    def read(cls, path: str | os.PathLike[str], limits_: Limits | None = None, text: bytes | None = None) -> ModelFiles:
        """Read a model file, unless its bytes are given.

        Raises UsageError: it cannot be read.
        """
        with applied(limits_):
            return cls(os.fspath(path), read_bytes(path) if text is None else text, limits.current())

    @cached_property
    def digest(self) -> str:
        """The checksum of all files."""
        return hashlib.sha256(b"".join((self.text, *(self.data or {}).values()))).hexdigest()

    @property
    def folder(self) -> Path:
        """The folder of the data files: that of the model, or the current one where the model comes through a pipe."""
        return Path() if is_piped(self.path) else Path(self.path).parent

    def with_data(self, data: Mapping[str, bytes]) -> ModelFiles:
        """The same model with the bytes of its data files."""
        return replace(self, data=data)

    def content(self, name: str) -> bytes:
        """The bytes of a data file.

        Raises DataRefused: it lies elsewhere, is no regular file, is too large, or cannot be read.
        Raises KeyError: the data files are known, and it is none of them.
        """
        if self.data is not None:
            return self.data[name]
        target = _inside(self.folder, name, self.limits.folders)
        try:
            with open_regular(target, getattr(os, "O_NOFOLLOW", 0)) as stream:
                content = stream.read(LARGEST + 1)
        except (OSError, ValueError) as error:
            message = f"the file '{shown(name)}' cannot be read: {reason(error)}"
            raise DataRefused("HS311", message, "its path is taken from the folder of the model") from None
        if len(content) > LARGEST:
            raise DataRefused("HS311", f"the file '{shown(name)}' is larger than {LARGEST >> 20} MiB")
        return content


def _inside(folder: Path, name: str, others: tuple[Path, ...]) -> Path:
    """The file's path with links followed, if it stays in the model's folder or in another that is allowed."""
    try:
        target = (folder / name).resolve()
        folders = (folder.resolve(), *(allowed.resolve() for allowed in others))
        if any(target.is_relative_to(allowed) for allowed in folders):
            return target
    except (OSError, ValueError, RuntimeError):
        pass
    message = f"the file '{shown(name)}' is not in the folder of the model"
    hint = "put it there and write its path from that folder, or allow its folder with --allow-path FOLDER"
    raise DataRefused("HS317", message, hint)
