"""Files written under another name and renamed into place, so that readers see whole files only."""

from __future__ import annotations

import os
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hsdsl.base.errors import UsageError
from hsdsl.base.unfinished import part_in


@dataclass(frozen=True)
class New:
    """A file written at ``part`` that replaces ``target``."""

    file: BinaryIO
    part: Path
    target: Path

    def finish(self) -> None:
        """Write it to the disk, with the permissions of the file that it replaces; a full disk raises here."""
        self.file.flush()
        os.fsync(self.file.fileno())
        self.file.close()
        with suppress(FileNotFoundError):
            os.chmod(self.part, stat.S_IMODE(self.target.stat().st_mode))

    def place(self) -> None:
        """Rename it into place."""
        os.replace(self.part, self.target)


@contextmanager
def unplaced(path: str | os.PathLike[str]) -> Generator[New]:
    """Open a new file in the folder of ``path``; it vanishes unless it is finished and placed. A link is followed.

    Raises UsageError: when the file cannot be written (no such folder, no permission, full disk); what was there is
    untouched.
    """
    target = Path(os.path.realpath(path))
    try:
        _refuse_special(target, path)
        with part_in(target.parent) as (part, descriptor), os.fdopen(descriptor, "wb") as file:
            yield New(file, part, target)
    except OSError as error:
        raise UsageError(_sentence(path, target, error)) from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Generator[BinaryIO]:
    """Open a new file that takes the place of ``path`` when the block ends well, and vanishes otherwise.

    Raises UsageError: as for :func:`unplaced`.
    """
    with unplaced(path) as new:
        yield new.file
        new.finish()
        new.place()


def _refuse_special(target: Path, path: str | os.PathLike[str]) -> None:
    mode = stat.S_IFREG
    with suppress(FileNotFoundError):
        mode = target.stat().st_mode
    if not stat.S_ISREG(mode):
        kind = "it is a folder" if stat.S_ISDIR(mode) else "it is not a regular file"
        raise UsageError(f"cannot write {os.fspath(path)}: {kind}")


def _sentence(path: str | os.PathLike[str], target: Path, error: OSError) -> str:
    folder = None if target.parent.is_dir() else f"there is no folder {Path(path).parent}"
    return f"cannot write {os.fspath(path)}: {folder or error.strerror or error}"
