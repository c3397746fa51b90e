"""What every test finds: Ctrl-C as in a terminal, and an end to the memory that a process may take."""

from __future__ import annotations

import gc
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from hsdsl.base import cache

ROOM = 4 << 30  # bytes of addresses that a test may take, and each process that it starts; memory in use is far less

# two workers on two cores: each product of matrices would wait for a thread that the other worker keeps from running
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")
cache.MOST_ENTRIES = 1 << 20  # tests make thousands: to look for the oldest of 500 takes longer than to write one


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with tests that take minutes: at the end one worker would be alone with them."""
    items.sort(key=lambda item: item.get_closest_marker("minutes") is None)


def pytest_collection_finish() -> None:
    """Spare the collector of garbage what stays: thousands of tests and the libraries that they import."""
    gc.freeze()


def pytest_runtest_setup() -> None:
    """Let a test that would fill the memory fail, rather than the machine."""
    if sys.platform == "linux":
        import resource

        taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        _, most = resource.getrlimit(resource.RLIMIT_AS)
        expected = taken + ROOM
        resource.setrlimit(resource.RLIMIT_AS, (expected if most < 0 else min(expected, most), most))


@pytest.fixture(autouse=True)
def control_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, also in the background of a shell and after a command that ran here."""
    hook, ours = sys.unraisablehook, threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.default_int_handler) if ours else None
    yield
    sys.unraisablehook = hook
    if ours:
        signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def compiled_loop() -> Path | None:
    """The hand-written loop as the user's cache keeps it: seconds of compiling for tests with a cache of their own."""
    from hsdsl.base.cache import find
    from hsdsl.engine.runtime import library
    from hsdsl.engine.runtime.compiler import NoCompiler, find_compiler

    text, symbol = library.LOOP
    with suppress(NoCompiler):
        library.load(text, symbol, lambda: [text])
        return find(library.KIND, library._key(text, find_compiler()))
    return None


@pytest.fixture
def with_loop(compiled_loop: Path | None) -> Callable[[], None]:
    """Put the compiled loop into the cache that the test has, as if the compiler of the test had made it."""

    def put() -> None:
        from hsdsl.engine.runtime import library

        if compiled_loop is not None:
            library._keep(library._key(library.LOOP[0], library.find_compiler()), compiled_loop)

    return put
