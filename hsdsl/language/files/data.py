"""The bytes of a model file and of its data files: each file is read once, and lies where the limits let it lie.

All that is made of a model is made of these bytes: a file that is saved meanwhile changes nothing.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from hsdsl.base import limits
from hsdsl.base.limits import Limits, applied
from hsdsl.base.names import shown
from hsdsl.language.files.model import is_piped, open_regular, read_bytes, reason

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
        with applied(self.limits):
            target = _inside(self.folder, name)
        try:
            with open_regular(target, getattr(os, "O_NOFOLLOW", 0)) as stream:
                content = stream.read(LARGEST + 1)
        except (OSError, ValueError) as error:
            message = f"the file '{shown(name)}' cannot be read: {reason(error)}"
            raise DataRefused("HS311", message, "its path is taken from the folder of the model") from None
        if len(content) > LARGEST:
            raise DataRefused("HS311", f"the file '{shown(name)}' is larger than {LARGEST >> 20} MiB")
        return content


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
