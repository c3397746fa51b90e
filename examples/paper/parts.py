"""The parts: a name for ``--only``, what it reproduces, and the function that does it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from paper.accuracy import accuracy
from paper.oscillators import exact, stop, table_1
from paper.quadrants import digital_control
from paper.results import Desk, Finding
from paper.runner import runner
from paper.times import times


@dataclass(frozen=True)
class Part:
    """One part of the paper."""

    summary: str
    run: Callable[[Desk], list[Finding]]


PARTS: dict[str, Part] = {
    "digital-control": Part("Fig. 1 and Sec. V-A: three executions, distances against delta", digital_control),
    "table-1": Part("Table I: the oscillators' parameters", table_1),
    "stop": Part("Fig. 14a: the oscillator with a stop", stop),
    "exact": Part("Fig. 14b and 14c: the exact trajectories", exact),
    "accuracy": Part("Fig. 14d and 14e: rho and rho-hat against step and relaxation", accuracy),
    "times": Part("Fig. 14f: computation times", times),
    "runner": Part("Fig. 15 to 17: the runner, its guards and two strides", runner),
}
