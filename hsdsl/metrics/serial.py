"""One thread for linear algebra: with twenty unknowns, waking others takes a hundred times as long as the work."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any


@contextmanager
def one_thread() -> Generator[None]:
    """Keep BLAS and LAPACK on the calling thread."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache
def _controller() -> Any:
    import_module("scipy.optimize")  # brings its own copy of the library, which has to be there to be found
    return import_module("threadpoolctl").ThreadpoolController()
