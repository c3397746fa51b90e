"""Processes that take Ctrl-C as from a terminal, also where a shell has started the tests in the background."""

from __future__ import annotations

import os
import signal
from typing import Any


def interruptible() -> dict[str, Any]:
    """Further arguments of ``subprocess.Popen``: a process inherits that a signal is ignored."""
    if os.name != "posix":
        return {}
    return {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
