"""Files that can be made again, in the user's cache folder: private, checked when read, safe among processes.

An entry is ``KIND/KEY/CHECKSUM.SUFFIX``: its name says what its content must hash to, so a damaged file is noticed and
made again, and no other file has to be written together with it. Files are written under another name and renamed.

Compiled code is loaded from here. So the folder, all in it and the file itself must belong to the user (or to root), be
writable by nobody else and be no links, and a folder above may be writable by everybody only if it is sticky, as /tmp
is. Else nothing is taken from here and nothing kept.
"""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
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
    """Make a folder of the cache private to the user, or say why it cannot be used."""
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
        return distrusted(path)
    except OSError as error:
        return f"{path} cannot be made: {error.strerror}"


def distrusted(path: Path) -> str | None:
    """Say why a file or folder of the cache is not trusted: itself, or a folder on the way, could be another's work.

    Raises OSError: it is not there.
    """
    if not hasattr(os, "getuid"):
        return None  # on Windows a profile is its user's alone
    top = folder()
    place = above = os.path.realpath(top)
    while above != (above := os.path.dirname(above)):  # who may write there may exchange what lies below
        mode = os.stat(above).st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return f"{above} can be written by other users"
    refusal = _of_another(place)
    for name in path.parts[len(top.parts) :]:
        place = os.path.join(place, name)
        refusal = refusal or _of_another(place)
    return refusal


def _of_another(place: str) -> str | None:
    status = os.lstat(place)
    if status.st_uid not in (os.getuid(), 0):
        return f"{place} belongs to another user"
    if stat.S_ISLNK(status.st_mode):
        return f"{place} is a link"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"{place} can be written by other users (make it private: chmod 700)"
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
    """Return the file of an entry whose content is what was written, if there is one; a damaged one is removed.

    Nothing is written that has to be: a cache that was filled before serves on a read-only file system too.
    """
    with suppress(OSError):
        for path in sorted((folder() / kind / key).iterdir()):
            if path.suffix == ".part" or distrusted(path) is not None:
                continue
            whole = _checksum(path.read_bytes()) == path.stem
            with suppress(OSError):
                os.utime(path) if whole else path.unlink()
            if whole:
                return path
    return None


def keep(kind: str, key: str, suffix: str, write: Callable[[Path], None]) -> Path:
    """Make an entry in place of what it was: ``write`` is given a path to write to. Returns the file.

    Raises OSError: the folder is refused or cannot be written.
    """
    from hsdsl.base.atomic import part_in

    entry = folder() / kind / key
    if refusal := private(folder()) or private(entry.parent):
        raise PermissionError(refusal)
    with part_in(entry.parent) as (part, descriptor):  # beside the entry, which another process may prune
        os.close(descriptor)
        write(part)
        part.chmod(0o600)
        path = entry / f"{_checksum(part.read_bytes())}{suffix}"
        if refusal := private(entry):
            raise PermissionError(refusal)
        os.replace(part, path)
        for other in entry.iterdir():
            if other != path and other.suffix != ".part":
                other.unlink(missing_ok=True)
    _prune(folder() / kind)
    return path


def entries(kind: str) -> int:
    with suppress(OSError):
        return sum(path.is_dir() for path in (folder() / kind).iterdir())
    return 0


def forget(kind: str) -> None:
    """Remove all entries of a kind."""
    import shutil

    shutil.rmtree(folder() / kind, ignore_errors=True)


def making(kind: str, key: str) -> AbstractContextManager[None]:
    """Let one process at a time make an entry, where the cache can be written: others wait and find it."""
    from hsdsl.base.atomic import locked

    entry = folder() / kind / key
    usable = all(private(place) is None for place in (folder(), entry.parent, entry))
    return locked(entry) if usable else nullcontext()


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
