"""Ctrl-C: noted while a compiled run is under way, a quiet end while modules are imported, else KeyboardInterrupt.

An exception in the middle of an import comes out as another one, is swallowed, or is printed and forgotten.
"""

from __future__ import annotations

import atexit
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    import signal
    from collections.abc import Callable
    from types import FrameType
    from typing import Any, TypeVar

    T = TypeVar("T")
else:
    try:  # without the enumerations that `signal` wraps around them, which cost as much as a short run
        import _signal as signal
    except ImportError:
        import signal

INTERRUPTED, WORD = 130, "interrupted"
_IMPORTING = "<frozen importlib._bootstrap>"
_SIGINT: int = int(signal.SIGINT)
_signal: Callable[..., Any] = signal.signal
_getsignal: Callable[..., Any] = signal.getsignal
before_leaving: list[Callable[[], object]] = []


def expect() -> None:
    """Let Ctrl-C end this process without a traceback from now on, unless the process has something else to do then."""
    if _getsignal(_SIGINT) is signal.default_int_handler:
        _signal(_SIGINT, _pressed)
        sys.unraisablehook = _unraisable
        atexit.register(_ignore)


def _ignore() -> None:
    """Ignore further interrupts while the process ends."""
    if _getsignal(_SIGINT) is _pressed:
        _signal(_SIGINT, signal.SIG_IGN)


def noting(press: Callable[[int, FrameType | None], None], work: Callable[[], T]) -> T:
    """Do some work, and call ``press`` at Ctrl-C meanwhile, where this thread would else raise KeyboardInterrupt.

    A handler that somebody else has installed stays.
    """
    before = _getsignal(_SIGINT)
    if before is not _pressed and before is not signal.default_int_handler:
        return work()
    try:
        _signal(_SIGINT, press)
    except ValueError:  # only the main thread sets handlers, and gets KeyboardInterrupt
        return work()
    try:
        return work()
    finally:
        _signal(_SIGINT, before)


def _pressed(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename == _IMPORTING:
            _leave()
        frame = frame.f_back
    raise KeyboardInterrupt


def _unraisable(found: Any) -> None:
    """Where an exception cannot be raised, as in a destructor, Ctrl-C ends the process."""
    if found.exc_type is KeyboardInterrupt:
        _leave()
    sys.__unraisablehook__(found)


def _leave() -> None:
    for clear in before_leaving:
        clear()
    os.write(2, f"{WORD}\n".encode())
    os._exit(INTERRUPTED)
