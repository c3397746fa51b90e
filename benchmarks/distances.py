"""How fast distances are: point distances in one call, rho between long runs, and how the cost grows.

Run as ``python benchmarks/distances.py``; prints tables in Markdown. Processor time, where it is repeated the least of
three.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hsdsl
from hsdsl.analysis.metrics.points import distances
from hsdsl.analysis.metrics.space import make_space
from hsdsl.interface.model.distances import distance_of_runs as distance

MODELS = Path(__file__).parents[1] / "models"
OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"
PAIRS = 20_000
REPEATS = 3


def seconds(work: Callable[[], Any]) -> float:
    """Processor time of a call, the least of a few."""
    times: list[float] = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def oscillator_pairs() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Pairs of states of the oscillator, by where they are."""
    rng = np.random.default_rng(5)

    def spread(n: int) -> np.ndarray:
        return np.column_stack([rng.uniform(-15, 14, n), rng.uniform(-40, 40, n)])

    def at_stop(n: int) -> np.ndarray:
        return np.column_stack([14 - rng.exponential(0.1, n), rng.uniform(-30, 30, n)])

    start = spread(PAIRS)
    near = at_stop(PAIRS)
    image = near * (1.0, -0.9) + rng.normal(scale=0.05, size=near.shape)
    image[:, 0] = np.minimum(image[:, 0], 14)
    return {
        "spread over the domain": (start, spread(PAIRS)),
        "close to each other": (start, start + rng.normal(scale=1e-3, size=start.shape) - (5e-3, 0)),
        "both close to the stop": (near, at_stop(PAIRS)),
        "before and after an impact": (near, image),
    }


def point_distances() -> None:
    """Print point distances a second."""
    system = hsdsl.load(OSCILLATOR).system
    space = make_space(system, [float(p.value) for p in system.parameters])
    print(f"| {PAIRS} pairs of states of oscillator 1 | pairs a second |\n|---|---|")
    for name, (p, q) in oscillator_pairs().items():
        distances(space, "free", p[:10], "free", q[:10])
        spent = seconds(lambda p=p, q=q: distances(space, "free", p, "free", q))
        print(f"| {name} | {PAIRS / spent:,.0f} |")


def between_runs() -> None:
    """Print rho between runs of the oscillator, by number of samples."""
    model = hsdsl.load(OSCILLATOR)
    print("\n| samples of each run | transitions | rho | seconds |\n|---|---|---|---|")
    for step in (8e-3, 2e-3, 5e-4):
        runs = [model.simulate(method="midpoint", step=h, relaxation=1e-8) for h in (step, step * 0.998)]
        found = distance(*runs, model=model)
        spent = seconds(lambda runs=runs: distance(*runs, model=model))
        samples = " and ".join(f"{len(run.times):,}" for run in runs)
        print(f"| {samples} | {len(runs[0].transitions)} | {found.upper:.3g} | {spent:.2f} |")


def transitions() -> None:
    """Print how rho's cost grows with the number of transitions, at about the same number of samples."""
    model = hsdsl.load(MODELS / "thermostat.yaml")
    print("\n| transitions | samples | rho | seconds |\n|---|---|---|---|")
    for until in (100, 1000, 10_000):
        runs = [model.simulate(until=until, relaxation=eps, tolerance=1e-8) for eps in (1e-6, 1e-5)]
        found = distance(*runs, model=model)
        spent = seconds(lambda runs=runs: distance(*runs, model=model))
        print(f"| {len(runs[0].transitions):,} | {len(runs[0].times):,} | {found.upper:.3g} | {spent:.2f} |")


def rivals() -> None:
    """Print the cost of the rivals for many transitions."""
    model = hsdsl.load(MODELS / "thermostat.yaml")
    print("\n| metric | transitions | distance | seconds |\n|---|---|---|---|")
    for until in (1000, 27_500):
        runs = [model.simulate(until=until, relaxation=eps, tolerance=1e-8) for eps in (1e-6, 1e-5)]
        for metric in ("sup", "skorokhod", "tau-epsilon"):
            began = time.process_time()
            found = distance(*runs, metric=metric, model=model)
            spent = time.process_time() - began
            print(f"| {metric} | {len(runs[0].transitions):,} | {found.interval} | {spent:.2f} |", flush=True)


def curved() -> None:
    """Print distances where guards are not affine."""
    model = hsdsl.load(MODELS / "pronking-runner.yaml")
    a, relaxed, b = model.simulate(), model.simulate(relaxation=1e-2), model.simulate(initial={"w": -0.4})
    print("\n| runs of the runner | rho | seconds |\n|---|---|---|")
    for name, other in (("relaxation 1e-8 and 1e-2", relaxed), ("th' = 0 and th' = -0.4 at the start", b)):
        began = time.process_time()
        found = distance(a, other, model=model)
        print(f"| {name} | {found.interval} | {time.process_time() - began:.1f} |")


if __name__ == "__main__":
    point_distances()
    between_runs()
    transitions()
    rivals()
    curved()
