"""Settings of matplotlib that every picture is drawn with, whatever a person's own are, by one thread at a time."""

from __future__ import annotations

import os
import sys
from collections.abc import Generator
from contextlib import contextmanager, suppress
from threading import RLock
from typing import Any

# The salt makes the SVG's ids repeatable.
STYLE: dict[str, Any] = {
    "svg.hashsalt": "hsdsl",
    "svg.fonttype": "path",
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "axes.labelcolor": "#222222",
    "text.color": "#222222",
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "agg.path.chunksize": 20_000,
}
_drawing = RLock()  # the settings are the whole process's


@contextmanager
def styled() -> Generator[None]:
    """Draw with our settings in the block, and no other thread meanwhile."""
    with _drawing:
        _import()
        import matplotlib.style

        with matplotlib.style.context(["default", STYLE]):
            yield


def _import() -> None:
    """Import matplotlib, also where the environment names a backend there is not: none is used here."""
    if "matplotlib" in sys.modules:
        return
    named = os.environ.pop("MPLBACKEND", None)
    import matplotlib

    if named is not None:
        os.environ["MPLBACKEND"] = named
        with suppress(ValueError):
            matplotlib.rcParams["backend"] = named
