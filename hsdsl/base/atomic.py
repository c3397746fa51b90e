"""Files written under another name, `.hsdsl-*.part`, and renamed into place, so that readers see whole files only.

Who writes a file locks it, and one that nobody writes any more is removed. Folders have locks as well, for those who
make something in them together.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hsdsl.base.errors import UsageError


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
        mode = stat.S_IFREG
        with suppress(FileNotFoundError):
            mode = target.stat().st_mode
        if not stat.S_ISREG(mode):
            kind = "it is a folder" if stat.S_ISDIR(mode) else "it is not a regular file"
            raise UsageError(f"cannot write {os.fspath(path)}: {kind}")
        with part_in(target.parent) as (part, descriptor), os.fdopen(descriptor, "wb") as file:
            yield New(file, part, target)
    except OSError as error:
        folder = None if target.parent.is_dir() else f"there is no folder {Path(path).parent}"
        raise UsageError(f"cannot write {os.fspath(path)}: {folder or error.strerror or error}") from error


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Generator[BinaryIO]:
    """Open a new file that takes the place of ``path`` when the block ends well, and vanishes otherwise.

    Raises UsageError: as for :func:`unplaced`.
    """
    with unplaced(path) as new:
        yield new.file
        new.finish()
        new.place()


try:
    import fcntl
except ImportError:  # Windows, where a file that is open cannot be removed
    fcntl = None

BEFORE, AFTER = ".hsdsl-", ".part"


@contextmanager
def part_in(folder: Path) -> Generator[tuple[Path, int]]:
    """Make a file in a folder: its path and a descriptor to be closed; what has the path at the end of the block goes.

    What processes that were killed have left in the folder goes first.

    Raises OSError: it cannot be made.
    """
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(BEFORE) and entry.name.endswith(AFTER) and entry.is_file(follow_symlinks=False):
                _remove_unless_written(entry.path)
    path, descriptor = _claimed(folder)
    lock = None if fcntl is None else os.dup(descriptor)  # until the file has its name
    try:
        yield path, descriptor
    finally:
        with suppress(FileNotFoundError):
            path.unlink()
        if lock is not None:
            os.close(lock)


@contextmanager
def locked(folder: Path) -> Generator[None]:
    """Let no other process lock a folder in the block, on systems and disks that have such locks."""
    descriptor = None
    with suppress(OSError):
        if fcntl is not None:
            descriptor = os.open(folder, os.O_RDONLY)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if descriptor is not None:
            os.close(descriptor)


def _claimed(folder: Path) -> tuple[Path, int]:
    while True:
        path = folder / f"{BEFORE}{secrets.token_hex(6)}{AFTER}"
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        try:
            _lock(descriptor)
        except BlockingIOError:  # another writer took it for left, and removes it
            os.close(descriptor)
            continue
        except OSError:
            pass  # a file system without locks
        if path.exists():
            return path, descriptor
        os.close(descriptor)


def _lock(descriptor: int) -> None:
    """Lock a file; OSError where somebody else has, or where that cannot be known."""
    if fcntl is not None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _remove_unless_written(path: str) -> None:
    with suppress(OSError):
        if fcntl is None:
            return os.unlink(path)
        descriptor = os.open(path, os.O_WRONLY)
        try:
            _lock(descriptor)
            os.unlink(path)
        finally:
            os.close(descriptor)
