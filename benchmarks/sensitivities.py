"""What derivatives cost: the processor time of a sensitivity as a multiple of that of the run, both prepared before.

python benchmarks/sensitivities.py
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import hsdsl

MODELS = (
    "oscillator-with-stop-1", "bouncing-ball", "constrained-pendulum", "thermostat", "stiff-switch",
    "gallery/two-crossings", "gallery/moving-guard", "gallery/stiff-contact", "gallery/equal-balls",
    "gallery/lorenz-section", "gallery/fast-clock",
)  # fmt: skip
SECONDS = 0.3


def cost(call: Callable[[], Any]) -> float:
    """Processor time of a call, averaged."""
    call()
    began, count = time.process_time(), 0
    while time.process_time() - began < SECONDS:
        call()
        count += 1
    return (time.process_time() - began) / count


def main() -> None:
    """Print a line for each model."""
    print(f"{'model':26} {'run, ms':>8} {'of one name':>12} {'of all':>7} {'names + 1':>10}")
    for name in MODELS:
        model = hsdsl.load(f"models/{name}.yaml")
        states = model.program.modes[model.program.initial_mode].states
        names = [*model.program.parameters, *(f"initial.{x}" for x in states)]
        settings: dict[str, Any] = {"scheme": "located", "method": "auto", "tolerance": 1e-9}
        run = cost(lambda model=model, settings=settings: model.simulate(**settings))
        one = cost(lambda model=model, names=names: model.sensitivity(names[:1], tolerance=None)) / run
        every = cost(lambda model=model, names=names: model.sensitivity(names, tolerance=None)) / run
        print(f"{name:26} {run * 1e3:8.3f} {one:12.2f} {every:7.2f} {1 + len(names):10}", flush=True)


if __name__ == "__main__":
    main()
