"""What derivatives cost: the processor time of a sensitivity as a multiple of that of the run, both prepared before.

Both are timed in turns in one process; the ratios are medians. The run keeps a tolerance of 1e-9. Methods of high order
keep a finer one for derivatives: the last two columns are ratios to a run that keeps it too. With the name of a model
it prints the ratios for the first name, the first two names, and so on.

    python benchmarks/sensitivities.py
    python benchmarks/sensitivities.py stiff-switch
"""

from __future__ import annotations

import sys
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
        lambda: model.sensitivity(names[:2], tolerance=None),
        lambda: model.sensitivity(names, tolerance=None),
        lambda: model.simulate(**settings, tolerance=tolerance),
    ]
    for call in calls:
        call()
    took, (one, two, every, finer) = ratios(calls)
    shares = f"{one:8.2f} {two:9.2f} {every:6.2f} {1 + len(names):10} {one / finer:14.2f} {every / finer:6.2f}"
    return f"{name:26} {took * 1e3:8.3f} {shares}"


def growth(name: str) -> str:
    """The ratios of a model by how many derivatives there are."""
    model = hsdsl.load(f"models/{name}.yaml")
    states = model.program.modes[model.program.initial_mode].states
    names = [*model.program.parameters, *(f"initial.{x}" for x in states)]
    firsts = [names[: k + 1] for k in range(len(names))]
    calls: list[Callable[[], Any]] = [lambda: model.simulate(scheme="located", method="auto", tolerance=TOLERANCE)]
    calls += [lambda first=first: model.sensitivity(first, tolerance=None) for first in firsts]
    for call in calls:
        call()
    took, shares = ratios(calls)
    return f"{name}, run of {took * 1e3:.3f} ms: " + ", ".join(f"{k} {r:.2f}" for k, r in enumerate(shares, 1))


def main() -> None:
    """Print a line for each model, or one for each that is named."""
    if len(sys.argv) > 1:
        print(*map(growth, sys.argv[1:]), sep="\n")
        return
    heads = f"{'one name':>8} {'two names':>9} {'all':>6} {'names + 1':>10} {'same: one name':>14} {'all':>6}"
    print(f"{'model':26} {'run, ms':>8} {heads}")
    for name in MODELS:
        print(line(name), flush=True)


if __name__ == "__main__":
    main()
