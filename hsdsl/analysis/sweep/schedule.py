"""Chunks of a sweep, each made by a process of this machine and written as soon as it is there."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence

from hsdsl.base.errors import UsageError
from hsdsl.base.processes import Lost, in_processes

Work = Callable[[int], bytes]
Write = Callable[[int, bytes], None]
Run = Callable[[Work, Sequence[int], Write], None]
TRIES = 3


def run_here(work: Work, chunks: Sequence[int], write: Write, processes: int) -> None:
    """Make chunks in so many processes; one alone works in this process.

    A process that dies loses its chunk only, which another one makes again.

    Raises UsageError: processes died over the same chunk three times.
    """
    waiting, deaths = list(chunks), Counter[int]()
    while waiting and processes > 1:
        lost: list[int] = []
        for index, answer in in_processes(work, waiting, min(processes, len(waiting)), math.inf):
            if isinstance(answer, Lost):
                lost.append(waiting[index])
            else:
                write(waiting[index], answer)
        deaths.update(lost)
        refuse_deadly(deaths)
        waiting = lost
    for chunk in waiting:
        write(chunk, work(chunk))


def refuse_deadly(deaths: Counter[int]) -> None:
    """End a sweep of which one chunk has been lost too often."""
    for chunk, count in deaths.items():
        if count >= TRIES:
            raise UsageError(
                f"{count} workers died while they ran chunk {chunk} of the sweep; what was done is kept",
                "is there too little memory? take smaller chunks, with --chunk ROWS in a new folder",
            )
