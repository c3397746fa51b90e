"""Ctrl-C during a compiled run: noted, and asked for at the run's own calm moments."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def noted(pressed: threading.Event) -> Generator[None]:
    """Set an event at Ctrl-C while the block runs, where this thread would else raise KeyboardInterrupt.

    A handler that somebody else has installed stays.
    """
    ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )

    def note(number: int, frame: FrameType | None) -> None:
        pressed.set()

    if ours:
        signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
