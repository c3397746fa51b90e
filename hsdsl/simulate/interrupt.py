"""Ctrl-C during a compiled run: noted, and asked for at the run's own calm moments."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# without the enumerations that `signal` wraps around them, which cost as much as a short run
_plain = sys.modules.get("_signal", signal)
_signal: Callable[..., Any] = getattr(_plain, "signal")  # noqa: B009
_getsignal: Callable[..., Any] = getattr(_plain, "getsignal")  # noqa: B009
_SIGINT = int(signal.SIGINT)


@contextmanager
def noted(press: Callable[[int, FrameType | None], None]) -> Generator[None]:
    """Call ``press`` at Ctrl-C while the block runs, where this thread would else raise KeyboardInterrupt.

    A handler that somebody else has installed stays.
    """
    ours = threading.get_ident() == threading.main_thread().ident and _getsignal(_SIGINT) is signal.default_int_handler
    if ours:
        _signal(_SIGINT, press)
    try:
        yield
    finally:
        if ours:
            _signal(_SIGINT, signal.default_int_handler)
