"""Files written beside their place and renamed into it, so that nobody ever sees half of one."""

from __future__ import annotations

import os
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from hsdsl.errors import UsageError
from hsdsl.unfinished import part_in


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Generator[BinaryIO, None, None]:
    """Open a new file that takes the place of ``path`` when the block ends well, and vanishes otherwise.

    It is written in the same folder, flushed to the disk and renamed; a link is followed, and the permissions of a
    file that is replaced are kept.

    Raises
    ------
    UsageError
        When the file cannot be written (no such folder, no permission, full disk); what was there is untouched.
    """
    target = Path(os.path.realpath(path))
    try:
        _refuse_special(target, path)
        with part_in(target.parent) as (beside, descriptor):
            with os.fdopen(descriptor, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            with suppress(FileNotFoundError):
                os.chmod(beside, stat.S_IMODE(target.stat().st_mode))
            os.replace(beside, target)
    except OSError as error:
        raise UsageError(_sentence(path, target, error)) from error


def _refuse_special(target: Path, path: str | os.PathLike[str]) -> None:
    if target.is_dir():
        raise UsageError(f"cannot write {os.fspath(path)}: it is a folder")
    if target.exists() and not target.is_file():
        raise UsageError(f"cannot write {os.fspath(path)}: it is not a regular file")


def _sentence(path: str | os.PathLike[str], target: Path, error: OSError) -> str:
    if not target.parent.is_dir():
        return f"cannot write {os.fspath(path)}: there is no folder {Path(path).parent}"
    return f"cannot write {os.fspath(path)}: {error.strerror or error}"
