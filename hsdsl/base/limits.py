"""What a model may ask of the machine, and which of it a user may allow more of."""

from __future__ import annotations

import gc
import os
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from pathlib import Path

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods


@contextmanager
def uncollected() -> Generator[None]:
    """Look for no cycles of garbage meanwhile: what a model becomes is kept, and searching it takes as long as a third
    of making it.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@checks_methods
@dataclass(frozen=True)
class Limits:
    """Caps on a model file; hsdsl checks each cap before the bounded work begins.

    Attributes
    ----------
    bytes : int
        Size of the file.
    values : int
        Keys, values, mappings and lists in it, with aliases expanded.
    modes : int
        Modes, and entries of any other mapping.
    seconds : float
        Processor time for the symbolic work on the whole file, once to read it and once to lower it.
    switches : int
        Switches of each floor, sign, abs, min, max and atan2 of time in a run.
    memory : int
        Bytes of the rows and samples that a run keeps.
    compile : float
        Seconds of the C compiler for one library; on Linux its processor time.
    folders : tuple of Path
        Folders that may contain data files, besides the model's own folder.
    """

    bytes: int = 1 << 20
    values: int = 200_000
    modes: int = 10_000
    seconds: float = 60.0
    switches: int = 100_000
    memory: int = 1 << 31
    compile: float = 60.0
    folders: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        for name in NUMBERS:
            if not getattr(self, name) > 0:
                raise UsageError(f"the limit '{name}' must be positive, not {getattr(self, name)}")


NUMBERS = tuple(f.name for f in fields(Limits) if f.name != "folders")
DEFAULT = Limits()
_current: ContextVar[Limits] = ContextVar("limits", default=DEFAULT)


def cores() -> int:
    """The number of cores of this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def current() -> Limits:
    """Return the limits in force."""
    return _current.get()


@contextmanager
def applied(limits: Limits | None) -> Generator[None]:
    """Put limits in force for a while; None changes nothing."""
    if limits is None:
        yield
        return
    token = _current.set(limits)
    try:
        yield
    finally:
        _current.reset(token)
