"""Progress of long work: its latest text, drawn from half a second on, in a terminal or below the cell of a notebook.

One thread draws for all work of the process; work that is over sooner costs a few microseconds.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from threading import Event, RLock, Thread
from typing import Any

FIRST_SIGN, INTERVAL = 0.5, 0.2  # seconds
WIDTH = 30  # letters of a bar

Text = Callable[[], str]
Show = Callable[[Text], None]
Draw = Callable[[str | None], None]


@dataclass(eq=False)
class _Work:
    draw: Draw
    text: Text | None = None
    began: float = field(default_factory=time.monotonic)
    drawn: bool = False

    def show(self, text: Text) -> None:
        self.text = text


_lock, _some = RLock(), Event()
_works: list[_Work] = []
_threads: list[Thread] = []


def _begin_anew() -> None:
    """Forget the works of the process that this one was forked from, and a lock that one of its threads held."""
    global _lock, _some
    _lock, _some = RLock(), Event()
    _works.clear()
    _threads.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)


@contextmanager
def ticking(draw: Draw) -> Generator[Show]:
    """Draw the latest text now and then while the block runs, and None at its end where any was drawn.

    Yields ``show(text)`` with ``text()`` called for each drawing.
    """
    work = _Work(draw)
    with _lock:
        _works.append(work)
        if not any(thread.is_alive() for thread in _threads):
            _threads[:] = [Thread(target=_tick, daemon=True)]
            _threads[0].start()
    _some.set()
    try:
        yield work.show
    finally:
        with _lock:
            _works.remove(work)
        if work.drawn:
            draw(None)


def _tick() -> None:
    while True:
        _some.wait()
        time.sleep(INTERVAL)
        with _lock:
            if not _works:
                _some.clear()
            for work in _works:
                if work.text is not None and time.monotonic() - work.began >= FIRST_SIGN:
                    work.drawn = True
                    work.draw(work.text())


def is_notebook() -> bool:
    """Whether this is the process of a notebook."""
    ipython: Any = sys.modules.get("IPython")
    return ipython is not None and getattr(ipython.get_ipython(), "kernel", None) is not None


def in_notebook() -> AbstractContextManager[Show | None]:
    """Show progress below the cell of a notebook; gives None elsewhere."""
    return _below_cell() if is_notebook() else nullcontext()


@contextmanager
def _below_cell() -> Generator[Show | None]:
    ipython: Any = sys.modules["IPython"]
    handles: list[Any] = []

    def draw(text: str | None) -> None:
        content = {"text/plain": text or "", "text/html": f"<pre>{_escaped(text)}</pre>" if text else ""}
        if handles:
            handles[0].update(content, raw=True)
        else:
            handles.append(ipython.display.display(content, raw=True, display_id=True))

    with ticking(draw) as show:
        yield show


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;")


def bar(share: float) -> str:
    """A bar of text."""
    return f"[{'=' * round(WIDTH * share):{WIDTH}}] {share:4.0%}"


def running(show: Show | None, run: Any) -> None:
    """Show the progress of a run, from its recorder."""
    if show is not None:
        show(lambda: f"{bar(min(1.0, float(run.now / run.until)) if run.until else 1.0)}, {run.made} transitions")


def counted(show: Show | None, noun: str) -> Callable[[int, int], None] | None:
    """A function of the amount done and the total amount."""
    return show and (lambda done, of: show(lambda: f"{bar(done / of if of else 1.0)}, {done:,} of {of:,} {noun}"))


def counted_runs(show: Show | None, followed: str = "") -> Callable[[int, float | None], None] | None:
    """A function of how many runs there were, and of the value of a parameter that is followed."""

    def tell(runs: int, value: float | None) -> None:
        if show:
            show(lambda: f"run {runs:,}" + ("" if value is None else f", {followed} = {value:.6g}"))

    return show and tell
