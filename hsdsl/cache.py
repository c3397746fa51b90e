"""Files that can be made again, in the user's cache folder: private, checked when read, safe among processes.

An entry is ``KIND/KEY/CHECKSUM.SUFFIX``: its name says what its content must hash to, so a damaged file is noticed and
made again, and no other file has to be written together with it. Files are written beside and renamed. The folder must
belong to the user and be writable by nobody else, since compiled code is loaded from it; another folder is refused.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

MOST_ENTRIES = 500  # of one kind; the least recently used go first


def folder() -> Path:
    """Where entries are kept: ``XDG_CACHE_HOME``, or what the platform has in its place."""
    if given := os.environ.get("XDG_CACHE_HOME"):
        return Path(given) / "hsdsl"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "hsdsl" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "hsdsl"
    return Path.home() / ".cache" / "hsdsl"


def private(path: Path) -> str | None:
    """Make a folder private to the user, or say why it cannot be used."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = path.stat()
    except OSError as error:
        return f"{path} cannot be made: {error.strerror}"
    if not hasattr(os, "getuid"):
        return None  # on Windows a profile is its user's alone
    if status.st_uid != os.getuid():
        return f"{path} belongs to another user"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{path} can be written by other users (make it private: chmod 700)"
    return None


def key_of(*parts: str | bytes) -> str:
    """Return the name of an entry that depends on ``parts`` and on nothing else."""
    digest = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(len(data).to_bytes(8, "little"))
        digest.update(data)
    return digest.hexdigest()[:40]


def find(kind: str, key: str) -> Path | None:
    """Return the file of an entry whose content is what was written, if there is one; a damaged one is removed."""
    if private(folder()) is not None:
        return None
    with suppress(OSError):
        for path in sorted((folder() / kind / key).iterdir()):
            if path.suffix == ".part":
                continue
            if _checksum(path.read_bytes()) == path.stem:
                os.utime(path)
                return path
            path.unlink()
    return None


def keep(kind: str, key: str, suffix: str, write: Callable[[Path], None]) -> Path:
    """Make an entry in place of what it was: ``write`` is given a path to write to. Returns the file.

    Raises
    ------
    OSError
        The folder is refused or cannot be written.
    """
    from hsdsl.unfinished import part_in

    if refusal := private(folder()):
        raise PermissionError(refusal)
    entry = folder() / kind / key
    entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with part_in(entry.parent) as (part, descriptor):  # beside the entry, which another process may prune
        os.close(descriptor)
        write(part)
        path = entry / f"{_checksum(part.read_bytes())}{suffix}"
        entry.mkdir(mode=0o700, exist_ok=True)
        os.replace(part, path)
        for other in entry.iterdir():
            if other != path and other.suffix != ".part":
                other.unlink(missing_ok=True)
    _prune(folder() / kind)
    return path


def _checksum(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:40]


def _prune(kind: Path) -> None:
    entries = [entry for entry in os.scandir(kind) if entry.is_dir()]
    if len(entries) <= MOST_ENTRIES:
        return
    import shutil

    with suppress(OSError):  # another process prunes as well
        for entry in sorted(entries, key=lambda e: _used(e.path))[: len(entries) - MOST_ENTRIES]:
            shutil.rmtree(entry.path, ignore_errors=True)


def _used(entry: str) -> float:
    """When an entry was last used; one that is being made has no file yet."""
    return max((file.stat().st_mtime for file in os.scandir(entry)), default=os.stat(entry).st_mtime)
