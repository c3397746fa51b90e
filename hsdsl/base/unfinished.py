"""Files that are being written, `.hsdsl-*.part`: locked by who writes them, removed where nobody does.

Folders have locks as well, for those who make something in them together.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

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
    _remove_left(folder)
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


def is_locked(folder: Path) -> bool:
    """Whether another process locks a folder at this moment; those who look do not see each other."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            if fcntl is not None:
                fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
        finally:
            os.close(descriptor)
    return False


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


def _remove_left(folder: Path) -> None:
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(BEFORE) and entry.name.endswith(AFTER) and entry.is_file(follow_symlinks=False):
                _remove_unless_written(entry.path)


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
