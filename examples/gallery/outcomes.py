"""Runs in processes of their own, which end them where they hang or crash."""

from __future__ import annotations

import resource
from collections.abc import Iterator, Sequence
from functools import partial

from gallery.scenes import Entry
from gallery.settings import Setting, run
from hsdsl.base.processes import HANGS, Lost, in_processes
from hsdsl.interface.chart.outcome import Outcome

LIMIT = 30.0  # processor seconds of a run
SHORTER = {"stiff-switch": 8.0}  # most explicit runs would take all of it
MEMORY = 12 << 30  # bytes of address space


def outcomes(entry: Entry, settings: Sequence[Setting], processes: int = 1) -> Iterator[tuple[Setting, Outcome]]:
    """Run a scene with each setting, in processes that last as long as nothing hangs or crashes."""
    limit = SHORTER.get(entry.name, LIMIT)
    reasons = {HANGS: f"no result in {limit:.0f} s of the processor"}
    found = dict(in_processes(partial(_run, entry), settings, processes, limit))
    for index, setting in enumerate(settings):
        answer = found[index]
        lost = isinstance(answer, Lost)
        yield setting, Outcome(answer.word, reasons.get(answer.word, "the process died")) if lost else answer


def _run(entry: Entry, setting: Setting) -> Outcome:
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY if hard == resource.RLIM_INFINITY else min(MEMORY, hard), hard))
    try:
        return run(entry, setting)
    except MemoryError:
        return Outcome("crashes", "no memory left")
    except Exception as error:  # a peer's own, which is its answer
        if setting.name.startswith("hsdsl"):
            raise
        return Outcome("refuses", f"{type(error).__name__}: {error}")
