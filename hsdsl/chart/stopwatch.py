"""Warm times, in turns: a disturbance of the machine affects everything that is compared."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import nan
from statistics import median
from typing import TypeVar

from hsdsl.chart.result import Attempt, Result

Judged = TypeVar("Judged")
ENOUGH = 0.02  # seconds of an attempt in one turn: a shorter one is repeated


@dataclass(frozen=True)
class Timed:
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


def race(
    attempts: Sequence[Attempt],
    judge: Callable[[Attempt, Result], Judged],
    rounds: int,
    patience: float,
    watch: Callable[[str], None],
) -> Iterator[tuple[Attempt, Judged, Timed]]:
    """Warm every attempt and judge its result, then time all of them in turns.

    An attempt that took longer than ``patience`` is not run again, and the tool's attempts after it are left out:
    attempts come in the order of rising effort.
    """
    warmed: list[tuple[Attempt, Judged, float]] = []
    exhausted: set[str] = set()
    for attempt in attempts:
        if attempt.tool.label in exhausted:
            continue
        watch(f"{attempt.tool.label} {attempt.setting}")
        began = time.perf_counter()
        result = attempt.run()
        seconds = time.perf_counter() - began
        warmed.append((attempt, judge(attempt, result), seconds))
        del result
        if seconds > patience:
            exhausted.add(attempt.tool.label)
    turns: list[list[float]] = [[] for _ in warmed]
    for turn in range(rounds):
        for times, (attempt, _, seconds) in zip(turns, warmed, strict=True):
            if seconds <= patience:
                watch(f"turn {turn + 1} of {rounds}: {attempt.tool.label} {attempt.setting}")
                times.append(_turn(attempt))
    for times, (attempt, judged, seconds) in zip(turns, warmed, strict=True):
        yield attempt, judged, Timed(tuple(times or [seconds]), seconds)


def _turn(attempt: Attempt) -> float:
    began = time.perf_counter()
    count, spent = 0, 0.0
    while spent < ENOUGH:
        attempt.run()
        count += 1
        spent = time.perf_counter() - began
    return spent / count
