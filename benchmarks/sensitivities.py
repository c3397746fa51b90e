"""What derivatives cost: the processor time of a sensitivity as a multiple of that of the run, both prepared before.

Both are timed in turns in one process; the ratios are medians. Methods of high order keep a finer tolerance for
derivatives: the last column is the ratio to a run that keeps it too.

    python benchmarks/sensitivities.py
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

import hsdsl

MODELS = (
    "oscillator-with-stop-1", "bouncing-ball", "constrained-pendulum", "thermostat", "stiff-switch",
    "gallery/two-crossings", "gallery/moving-guard", "gallery/stiff-contact", "gallery/equal-balls",
    "gallery/lorenz-section", "gallery/fast-clock",
)  # fmt: skip
SECONDS, TURNS = 0.02, 15
TOLERANCE = 1e-9


def ratios(calls: Sequence[Callable[[], Any]]) -> tuple[float, list[float]]:
    """The processor time of the first call, and those of the others as multiples of it, each a median over turns."""
    turns = [[cost(call) for call in calls] for _ in range(TURNS)]
    shares = [median(turn[k] / turn[0] for turn in turns) for k in range(1, len(calls))]
    return median(turn[0] for turn in turns), shares


def cost(call: Callable[[], Any]) -> float:
    """Processor time of a call, averaged."""
    began, count = time.process_time(), 0
    while time.process_time() - began < SECONDS:
        call()
        count += 1
    return (time.process_time() - began) / count


def line(name: str) -> str:
    """What is printed of a model."""
    model = hsdsl.load(f"models/{name}.yaml")
    states = model.program.modes[model.program.initial_mode].states
    names = [*model.program.parameters, *(f"initial.{x}" for x in states)]
    tolerance = model.sensitivity(names, tolerance=None).setting.augmented.settings.tolerance or TOLERANCE
    settings: dict[str, Any] = {"scheme": "located", "method": "auto"}
    calls = [
        lambda: model.simulate(**settings, tolerance=TOLERANCE),
        lambda: model.sensitivity(names[:1], tolerance=None),
        lambda: model.sensitivity(names, tolerance=None),
        lambda: model.simulate(**settings, tolerance=tolerance),
    ]
    for call in calls:
        call()
    took, (one, every, finer) = ratios(calls)
    return f"{name:26} {took * 1e3:8.3f} {one:12.2f} {every:7.2f} {1 + len(names):10} {every / finer:15.2f}"


def main() -> None:
    """Print a line for each model."""
    print(f"{'model':26} {'run, ms':>8} {'of one name':>12} {'of all':>7} {'names + 1':>10} {'same tolerance':>15}")
    for name in MODELS:
        print(line(name), flush=True)


if __name__ == "__main__":
    main()
