"""Bounds on symbolic work, which SymPy cannot be made to keep by itself: its time, and the depth of the stack.

A second thread watches the processor time of the process and raises :class:`OutOfTime` in the one that works, at its
next Python instruction. Unlike a signal that does not need the main thread.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

LONGEST_WAIT = 3600.0  # a lock cannot wait for ever
AGAIN = 1.0  # Python forgets an exception in a destructor: the next one follows after so many seconds
PARTS = 15  # into which the time for a file is divided: one expression may take one

_python: Any = getattr(ctypes, "pythonapi", None)  # CPython; elsewhere the time is examined between parts
_send: Any = None if _python is None else _python.PyThreadState_SetAsyncExc


class OutOfTime(BaseException):
    """The time is spent. No `Exception`, so that no library takes it for one of its own."""


class Box:
    """The remaining time: for the whole, and for the part that was begun last."""

    def __init__(self, seconds: float, parts: int) -> None:
        self._part = seconds / parts
        self._end = time.process_time() + seconds
        self._part_end = self._end

    def restart(self) -> None:
        """Begin the next part.

        Raises OutOfTime: the time for the whole is spent.
        """
        now = time.process_time()
        if now >= self._end:
            raise OutOfTime
        self._part_end = now + self._part

    def left(self) -> float:
        """Processor seconds until this part, or the whole, is out of time."""
        return min(self._end, self._part_end) - time.process_time()


@contextmanager
def timebox(seconds: float, parts: int = 1) -> Generator[Box]:
    """Bound the processor time of a block; between two calls of ``restart`` there is time for one of ``parts`` parts.

    Raises OutOfTime: in the block, once the time is spent.
    """
    box = Box(seconds, parts)
    done, sent = threading.Event(), threading.Event()
    lock = threading.Lock()
    thread = threading.get_ident()

    def watch() -> None:
        while not done.wait(AGAIN if sent.is_set() else min(max(0.01, box.left()), LONGEST_WAIT)):
            with lock:
                if not done.is_set() and box.left() <= 0:
                    sent.set()
                    _raise_in(thread, OutOfTime)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield box
    finally:
        with lock:
            done.set()
        if sent.is_set():
            _receive_last(thread)
        watcher.join()


class _Last(BaseException):
    """Sent after :class:`OutOfTime`, in its place if that has not arrived."""


def _receive_last(thread: int) -> None:
    """Wait until no exception is on its way to this thread.

    To take one back (to send none) would leave CPython 3.11 looking for it at every instruction, and for ever where a
    profiler or a debugger is on.
    """
    if _send is None:
        return
    try:
        _raise_in(thread, _Last)
        while True:
            time.sleep(0)
    except _Last:
        pass


def _raise_in(thread: int, exception: type[BaseException]) -> None:
    if _send is not None:
        _send(ctypes.c_ulong(thread), ctypes.py_object(exception))


_FRAMES = 20_000


@contextmanager
def deep_stack() -> Generator[None]:
    """Allow deep recursion: the caps on nesting bound it, but SymPy spends up to ten frames a level."""
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(max(before, _FRAMES))
    try:
        yield
    finally:
        sys.setrecursionlimit(before)
