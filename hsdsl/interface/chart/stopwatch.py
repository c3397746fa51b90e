"""Warm times, in turns: a disturbance of the machine affects everything that is compared.

A run that takes too long is ended as by Ctrl-C. A tool that does not look for that is waited for.
"""

from __future__ import annotations

import _thread
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from math import nan
from statistics import median
from threading import Event, Lock, Thread, main_thread
from types import TracebackType
from typing import Any, NamedTuple, TypeVar

from hsdsl.interface.chart.scene import Attempt, Result

Judged = TypeVar("Judged")
ENOUGH = 0.02  # seconds of an attempt in one turn: a shorter one is repeated


class Timed(NamedTuple):
    """Seconds of single runs: one number a turn (the mean of its repeats), and of the first, cold one."""

    turns: tuple[float, ...]
    first: float

    @property
    def median(self) -> float:
        """The median turn; the first run where there was no other."""
        return median(self.turns) if self.turns else nan

    @property
    def spread(self) -> tuple[float, float]:
        """The fastest and the slowest turn."""
        return (min(self.turns), max(self.turns)) if self.turns else (nan, nan)


class Deadline:
    """Interrupt what the block does after some seconds; ``passed`` says whether that was done.

    Python forgets an interrupt in a destructor, so that another one follows each second until the block is over.
    """

    def __init__(self, seconds: float) -> None:
        self.passed, self._seconds, self._over, self._lock = False, seconds, Event(), Lock()

    def _wait(self) -> None:
        seconds = self._seconds
        while not self._over.wait(seconds):
            with self._lock:
                if self._over.is_set():
                    return
                self.passed, seconds = True, 1.0
                if hasattr(signal, "pthread_kill"):  # else not where the main thread sleeps
                    signal.pthread_kill(main_thread().ident or 0, signal.SIGINT)
                else:
                    _thread.interrupt_main()

    def _forgotten(self, found: Any) -> None:
        if found.exc_type is not KeyboardInterrupt:
            self._hook(found)

    def __enter__(self) -> Deadline:
        self._hook, sys.unraisablehook = sys.unraisablehook, self._forgotten
        Thread(target=self._wait, daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: BaseException | TracebackType | None) -> bool:
        try:
            with self._lock:
                self._over.set()
        except KeyboardInterrupt:  # it came in between
            self._over.set()
        sys.unraisablehook = self._hook
        return self.passed and kind is KeyboardInterrupt


def race(
    attempts: Sequence[Attempt],
    judge: Callable[[Attempt, Result | None], Judged],
    rounds: int,
    patience: float,
    watch: Callable[[str], None],
) -> Iterator[tuple[Attempt, Judged, Timed]]:
    """Warm every attempt and judge its result, then time all of them in turns.

    An attempt that takes longer than ``patience`` is ended, and the tool's attempts after it are left out: attempts
    come in the order of rising effort. One that leaves nothing then has the result None.
    """
    warmed: list[tuple[Attempt, Judged, float, bool]] = []
    exhausted: set[str] = set()
    for attempt in attempts:
        if attempt.tool.label in exhausted:
            continue
        watch(f"{attempt.tool.label} {attempt.setting}")
        began = time.perf_counter()
        result: Result | None = None
        with Deadline(patience) as deadline:
            result = attempt.run()
        seconds = time.perf_counter() - began
        if result and result.interrupted and not deadline.passed:
            raise KeyboardInterrupt
        warmed.append((attempt, judge(attempt, result), seconds, deadline.passed))
        del result
        if deadline.passed:
            exhausted.add(attempt.tool.label)
    turns: list[list[float]] = [[] for _ in warmed]
    for turn in range(rounds):
        for times, (attempt, _, _, ended) in zip(turns, warmed, strict=True):
            if not ended:
                watch(f"turn {turn + 1} of {rounds}: {attempt.tool.label} {attempt.setting}")
                times.append(_turn(attempt))
    for times, (attempt, judged, seconds, _) in zip(turns, warmed, strict=True):
        yield attempt, judged, Timed(tuple(times or [seconds]), seconds)


def _turn(attempt: Attempt) -> float:
    began = time.perf_counter()
    count, spent = 0, 0.0
    while spent < ENOUGH:
        attempt.run()
        count += 1
        spent = time.perf_counter() - began
    return spent / count
