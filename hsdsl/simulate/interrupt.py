"""Ctrl-C during a compiled run: noted, and asked for at the run's own calm moments."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from threading import get_ident, main_thread
from types import FrameType
from typing import Any

# without the enumerations that `signal` wraps around them, which cost as much as a short run
_plain = sys.modules.get("_signal", signal)
_signal: Callable[..., Any] = getattr(_plain, "signal")  # noqa: B009
_getsignal: Callable[..., Any] = getattr(_plain, "getsignal")  # noqa: B009
_SIGINT = int(signal.SIGINT)


class Noted:
    """Call ``press`` at Ctrl-C while the block runs, where this thread would else raise KeyboardInterrupt.

    A handler that somebody else has installed stays.
    """

    def __init__(self, press: Callable[[int, FrameType | None], None]) -> None:
        self._press = press

    def __enter__(self) -> None:
        self._ours = get_ident() == main_thread().ident and _getsignal(_SIGINT) is signal.default_int_handler
        if self._ours:
            _signal(_SIGINT, self._press)

    def __exit__(self, *_: object) -> None:
        if self._ours:
            _signal(_SIGINT, signal.default_int_handler)
