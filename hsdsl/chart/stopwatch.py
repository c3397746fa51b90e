"""Warm times, in turns: what disturbs the machine disturbs everything that is compared."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import nan
from statistics import median
from typing import TypeVar

from hsdsl.chart.result import Attempt, Result

Looked = TypeVar("Looked")
ENOUGH = 0.02  # seconds of an attempt in one turn: what takes less is repeated


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
    look: Callable[[Attempt, Result], Looked],
    rounds: int,
    patience: float,
    watch: Callable[[str], None],
) -> Iterator[tuple[Attempt, Looked, Timed]]:
    """Warm every attempt and look at what it gives, which is not kept, then time all of them in turns.

    What took longer than ``patience`` the first time is not run again, and the tool's attempts after it are left out:
    they are given in the order of rising effort.
    """
    warmed: list[tuple[Attempt, Looked, float]] = []
    exhausted: set[str] = set()
    for attempt in attempts:
        if attempt.label in exhausted:
            continue
        watch(f"{attempt.label} {attempt.setting}")
        result, seconds = _once(attempt)
        warmed.append((attempt, look(attempt, result), seconds))
        del result
        if seconds > patience:
            exhausted.add(attempt.label)
    turns: dict[int, list[float]] = {k: [] for k in range(len(warmed))}
    for turn in range(rounds):
        for k, (attempt, _, seconds) in enumerate(warmed):
            if seconds <= patience:
                watch(f"turn {turn + 1} of {rounds}: {attempt.label} {attempt.setting}")
                turns[k].append(_turn(attempt))
    for k, (attempt, looked, seconds) in enumerate(warmed):
        yield attempt, looked, Timed(tuple(turns[k] or [seconds]), seconds)


def _once(attempt: Attempt) -> tuple[Result, float]:
    began = time.perf_counter()
    result = attempt.run()
    return result, time.perf_counter() - began


def _turn(attempt: Attempt) -> float:
    began = time.perf_counter()
    count = 0
    while True:
        attempt.run()
        count += 1
        spent = time.perf_counter() - began
        if spent >= ENOUGH:
            return spent / count
