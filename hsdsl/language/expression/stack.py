"""Room on Python's stack for expressions as deep as the language allows."""

from __future__ import annotations

import sys
from collections.abc import Generator
from contextlib import contextmanager

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
