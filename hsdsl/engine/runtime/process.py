"""Commands run to their end: in process groups and a folder of their own, for a limited time."""

from __future__ import annotations

import atexit
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import IO

from hsdsl.base import interrupts

FIRST_WAIT = 5.0  # seconds without a question
TURN = 0.5  # seconds in which a command that runs has the processor at least once
MOST_TIMES_LONGER = 20
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100  # of a second of processor time
MOST_PRINTED = 1 << 16  # bytes that are kept of what a command prints
_running: dict[subprocess.Popen[bytes], Path] = {}


Done = tuple[int | None, str]  # a command's exit code, None where it was ended after its time, and its stderr


@contextmanager
def workshop() -> Generator[Path]:
    """Make a folder that vanishes with all that was made in it."""
    with tempfile.TemporaryDirectory(prefix="hsdsl-", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def run(commands: Sequence[Sequence[str]], folder: Path, seconds: float, responds: Callable[[], bool]) -> list[Done]:
    """Run commands at the same time, whose temporary files go to ``folder``; they read nothing.

    After :data:`FIRST_WAIT` they go on only if ``responds``. On Linux seconds in which other programs had the processor
    do not count. All that they started is ended with them where they are ended.

    Raises OSError: one cannot be started.
    """
    began = monotonic()
    begun: list[tuple[subprocess.Popen[bytes], Thread, list[bytes]]] = []  # and who keeps what it says
    try:
        for command in commands:
            begun.append(_begin(command, folder))
        codes = [
            _wait(process, listener, _waits(process.pid, began, seconds, responds)) for process, listener, _ in begun
        ]
    finally:
        for process, _, _ in begun:
            _end(process)
            del _running[process]
    for _, listener, _ in begun:
        listener.join(1.0)  # what it left running may hold the stream open
    printed = [b"".join(said).decode(errors="replace") for _, _, said in begun]
    return list(zip(codes, printed, strict=True))


def _begin(command: Sequence[str], folder: Path) -> tuple[subprocess.Popen[bytes], Thread, list[bytes]]:
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(folder), "LC_ALL": "C"},  # what they say is read: `error` in English
        process_group=0,
    )
    _running[process] = folder
    printed: list[bytes] = []
    listener = Thread(target=_listen, args=(process.stderr, printed), daemon=True)
    listener.start()
    return process, listener, printed


def _wait(process: subprocess.Popen[bytes], listener: Thread, waits: Iterator[float]) -> int | None:
    """Wait until the output of a command ends, which needs no polling."""
    for seconds in waits:
        end = monotonic() + seconds
        listener.join(seconds)
        with suppress(subprocess.TimeoutExpired):
            return process.wait(max(0.0, end - monotonic()))
    return None


def _waits(group: int, began: float, seconds: float, responds: Callable[[], bool]) -> Iterator[float]:
    """Give how long to wait for a command each time; where its time is over, as long as it still runs for less."""
    yield max(0.0, began + min(seconds, FIRST_WAIT) - monotonic())
    if seconds > FIRST_WAIT and not responds():
        return
    yield max(0.0, began + seconds - monotonic())
    used = processor_time(group)
    for _ in range(MOST_TIMES_LONGER):
        if used >= seconds:
            return
        yield TURN
        before, used = used, processor_time(group)
        if used <= before:  # it waits for something else, or nobody knows
            return
        yield max(0.0, seconds - used)


def processor_time(group: int) -> float:
    """Processor seconds of the processes of a group, and of their children that have ended; 0 where not on Linux."""
    used = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended
            _, _, its_group, *others = path.read_bytes().rpartition(b")")[2].split()
            used += sum(map(int, others[8:12])) if int(its_group) == group else 0
    return used / TICKS


def _listen(stream: IO[bytes], printed: list[bytes]) -> None:
    """Keep the beginning of a stream, and take the rest, so that nobody waits to write it."""
    with suppress(OSError, ValueError), stream:
        printed.append(stream.read(MOST_PRINTED))
        while stream.read(MOST_PRINTED):
            pass


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a command that has not ended, with its process group: its number cannot be another's as long as it runs."""
    if process.poll() is None:
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()
        process.wait()


@atexit.register
def end_all() -> None:
    """End what other threads have running when this process ends."""
    for process, folder in list(_running.items()):
        with suppress(OSError):
            _end(process)
        shutil.rmtree(folder, ignore_errors=True)


interrupts.before_leaving.append(end_all)
