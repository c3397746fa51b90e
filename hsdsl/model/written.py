"""A model as it was written: the bytes of its file and of its data files, each read once, with the limits in force.

All that is made of a model is made of these bytes: a file that is saved meanwhile changes nothing.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from hsdsl.files import digest_of, folder_of, read_bytes, read_data
from hsdsl.limits import Limits, applied, current

if TYPE_CHECKING:
    from hsdsl.system import HybridSystem


@dataclass(frozen=True)
class Written:
    """Where a model was read, its bytes, and those of its data files by name; None while it is not known which."""

    path: str
    text: bytes = field(repr=False)
    limits: Limits
    files: Mapping[str, bytes] | None = field(default=None, repr=False)

    @classmethod
    def at(cls, path: str | os.PathLike[str], limits: Limits | None, text: bytes | None = None) -> Written:
        """Read a model file, unless its bytes are given.

        Raises
        ------
        UsageError
            It cannot be read.
        """
        with applied(limits):
            return cls(os.fspath(path), read_bytes(path) if text is None else text, current())

    @cached_property
    def digest(self) -> str:
        """What tells the model from another one."""
        return digest_of(self.text, (self.files or {}).values())

    def with_files(self, files: Mapping[str, bytes]) -> Written:
        """The same with its data files."""
        return replace(self, files=files)

    def data(self, name: str) -> bytes:
        """The bytes of a data file; KeyError or DataRefused where there are none."""
        if self.files is not None:
            return self.files[name]
        with applied(self.limits):
            return read_data(folder_of(self.path), name)

    def elaborated(self) -> HybridSystem:
        """The mathematics.

        Raises
        ------
        ModelError
            The model has errors.
        """
        from hsdsl.elaborate import elaborate

        with applied(self.limits):
            return elaborate(self.path, text=self.text, files=self.files)
