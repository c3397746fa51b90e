"""Tasks in processes of their own, which are ended where they hang or crash."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, Generic, TypeVar

Task = TypeVar("Task")
Answer = TypeVar("Answer")
INTERVAL = 0.2  # seconds between looks
BUSY = 10  # times the limit by the clock, on a machine that others use too
HANGS, CRASHES = "hangs", "crashes"


@dataclass(frozen=True)
class Lost:
    """No answer: the process took longer than its limit (``hangs``) or died (``crashes``)."""

    word: str


@dataclass(frozen=True)
class _Failure:
    """What a task raised."""

    error: Exception


@dataclass(eq=False)
class _Worker(Generic[Task, Answer]):
    """A process that answers tasks by their index, and the one it is at."""

    work: Callable[[Task], Answer]
    tasks: Sequence[Task]
    index: int = -1
    alive: bool = True
    began: float = 0.0
    spent: float = 0.0

    def __post_init__(self) -> None:
        context: Any = multiprocessing.get_context("fork")  # a child begins with everything loaded
        self.here, there = context.Pipe()
        self.process = context.Process(target=self._serve, args=(there,), daemon=True)
        self.process.start()
        there.close()

    def _serve(self, there: Connection) -> None:
        self.here.close()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's, which ends its children
        while True:
            try:
                index: int = there.recv()
            except EOFError:  # the parent is gone
                return
            try:
                there.send(self.work(self.tasks[index]))
            except Exception as error:  # raised again where the answer is read
                there.send(_Failure(error))

    def give(self, index: int) -> None:
        """Begin a task."""
        self.index, self.began, self.spent = index, time.monotonic(), processor_seconds(self.process.pid)
        self.here.send(index)

    def late(self, limit: float) -> bool:
        """Whether the task has had its time."""
        used = processor_seconds(self.process.pid) - self.spent
        return used > limit or time.monotonic() - self.began > BUSY * limit

    def end(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self.here.close()


def can_fork() -> bool:
    """Whether tasks get processes here."""
    return "fork" in multiprocessing.get_all_start_methods()


def in_processes(
    work: Callable[[Task], Answer], tasks: Sequence[Task], count: int, limit: float
) -> Iterator[tuple[int, Answer | Lost]]:
    """Answer tasks in ``count`` processes; give the index of each and its answer, in the order in which they come.

    ``limit`` is in seconds of the processor. Where the system cannot fork, tasks are answered here, without a limit.
    """
    if not can_fork():
        yield from ((index, work(task)) for index, task in enumerate(tasks))
        return
    waiting = list(range(len(tasks)))[::-1]
    workers: dict[Connection, _Worker[Task, Answer]] = {}
    try:
        while waiting or workers:
            while waiting and len(workers) < count:
                _begin(workers, _Worker(work, tasks), waiting.pop())
            for here in wait([*workers], INTERVAL):
                worker = workers[here]  # pyright: ignore[reportArgumentType]
                yield worker.index, _answer(worker)
                _go_on(workers, worker, waiting)
            for worker in [worker for worker in workers.values() if worker.late(limit)]:
                yield worker.index, Lost(HANGS)
                del workers[worker.here]
                worker.end()
    finally:
        for worker in workers.values():
            worker.end()


def _begin(workers: dict[Connection, _Worker[Any, Any]], worker: _Worker[Any, Any], index: int) -> None:
    workers[worker.here] = worker
    worker.give(index)


def _answer(worker: _Worker[Any, Answer]) -> Answer | Lost:
    try:
        answer = worker.here.recv()
    except (EOFError, OSError):
        worker.alive = False
        return Lost(CRASHES)
    if isinstance(answer, _Failure):
        raise answer.error
    return answer


def _go_on(workers: dict[Connection, _Worker[Any, Any]], worker: _Worker[Any, Any], waiting: list[int]) -> None:
    """The next task of a worker that lives; the end of one that has none, or is dead."""
    if waiting and worker.alive:
        worker.give(waiting.pop())
        return
    del workers[worker.here]
    worker.end()


def processor_seconds(process: int | None) -> float:
    """What a process has used; 0 where the system does not tell."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
