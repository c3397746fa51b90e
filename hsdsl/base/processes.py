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
from typing import Any, Generic, NamedTuple, TypeVar

Task = TypeVar("Task")
Answer = TypeVar("Answer")
INTERVAL = 0.2  # seconds between looks
BUSY = 10  # times the limit by the clock, on a machine that others use too
HANGS, CRASHES = "hangs", "crashes"


class Lost(NamedTuple):
    """No answer: the process took longer than its limit (``hangs``) or died (``crashes``)."""

    word: str


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
                there.send((self.work(self.tasks[index]), None))
            except Exception as error:  # raised again where the answer is read
                there.send((None, error))

    def give(self, index: int) -> None:
        """Begin a task."""
        self.index, self.began, self.spent = index, time.monotonic(), processor_seconds(self.process.pid)
        self.here.send(index)

    def answer(self) -> Answer | Lost:
        """What has come of the task; a dead process has none."""
        try:
            answer, error = self.here.recv()
        except (EOFError, OSError):
            self.alive = False
            return Lost(CRASHES)
        if error is not None:
            raise error
        return answer

    def late(self, limit: float) -> bool:
        """Whether the task has had its time: the clock is asked first, as the processor's time is in a file."""
        waited = time.monotonic() - self.began
        return waited > limit and (waited > BUSY * limit or processor_seconds(self.process.pid) - self.spent > limit)

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
                worker = _Worker(work, tasks)
                workers[worker.here] = worker
                worker.give(waiting.pop())
            for here in wait([*workers], INTERVAL):
                worker = workers[here]  # pyright: ignore[reportArgumentType]
                index, answer = worker.index, worker.answer()
                if waiting and worker.alive:
                    worker.give(waiting.pop())  # it works on while the answer is taken
                else:
                    workers.pop(worker.here).end()
                yield index, answer
            for worker in [worker for worker in workers.values() if worker.late(limit)]:
                yield worker.index, Lost(HANGS)
                workers.pop(worker.here).end()
    finally:
        for worker in workers.values():
            worker.end()


def processor_seconds(process: int | None) -> float:
    """What a process has used; 0 where the system does not tell."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
