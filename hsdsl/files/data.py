"""The bytes of a model's data files: each a regular file in the model's folder, or where the limits let it lie."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path

from hsdsl import limits
from hsdsl.files.model import is_piped, open_regular, reason
from hsdsl.names import shown

LARGEST = 64 << 20  # bytes


class DataRefused(Exception):
    """A data file that cannot be used: the code, the sentence and the hint of its diagnostic."""

    def __init__(self, code: str, message: str, hint: str | None = None) -> None:
        super().__init__(code, message, hint)
        self.code, self.message, self.hint = code, message, hint


def folder_of(path: str | os.PathLike[str]) -> Path:
    """Where the data files of a model lie: beside it, or in the current folder where it comes through a pipe."""
    return Path() if is_piped(path) else Path(path).parent


def read_data(folder: Path, name: str) -> bytes:
    """The bytes of a data file.

    Raises
    ------
    DataRefused
        When it lies elsewhere, is no regular file, is too large, or cannot be read.
    """
    target = _inside(folder, name)
    try:
        with open_regular(target, getattr(os, "O_NOFOLLOW", 0)) as stream:
            data = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        message = f"the file '{shown(name)}' cannot be read: {reason(error)}"
        raise DataRefused("HS311", message, "its path is taken from the folder of the model") from None
    if len(data) > LARGEST:
        raise DataRefused("HS311", f"the file '{shown(name)}' is larger than {LARGEST >> 20} MiB")
    return data


def digest_of(text: bytes, data: Iterable[bytes]) -> str:
    """What tells a model from another one: the checksum of its file and its data files."""
    return hashlib.sha256(b"".join((text, *data))).hexdigest()


def _inside(folder: Path, name: str) -> Path:
    """The file's path with links followed, if it stays in the model's folder."""
    try:
        target = (folder / name).resolve()
        folders = (folder.resolve(), *(allowed.resolve() for allowed in limits.current().folders))
        if any(target.is_relative_to(allowed) for allowed in folders):
            return target
    except (OSError, ValueError, RuntimeError):
        pass
    message = f"the file '{shown(name)}' is not in the folder of the model"
    hint = "put it there and write its path from that folder, or allow its folder with --allow-path FOLDER"
    raise DataRefused("HS317", message, hint)
