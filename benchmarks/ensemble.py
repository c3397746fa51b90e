"""Ten thousand oscillators with a stop, restitution and forcing varied: how long, and is every impact right?

Timed on all cores, warm. Then each run's impacts are compared with those of the closed form, followed in
float64 from impact to impact: between two samples of 2e-3 it looks at every maximum that comes near the stop, so that a
short visit is not missed. That takes minutes; `--checked` says how many of the runs are.

    python benchmarks/ensemble.py [--instances 10000] [--checked 10000] [--tolerance 1e-10]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter

import numpy as np

import hsdsl

FILE = Path(__file__).parent.parent / "models" / "oscillator-with-stop-1.yaml"
A, W, STOP, START = 0.05, 2.5, 14.0, (11.36, 31.4)
WD = math.sqrt(W * W - A * A)
UNTIL = 40 * math.pi
GRID = np.arange(1, 4001) * 2e-3
DECAY, COSINE, SINE = np.exp(-A * GRID), np.cos(WD * GRID), np.sin(WD * GRID)
MOST = 200  # impacts of one run
Curve = Callable[[float], float]


def varied() -> hsdsl.Model:
    """The model with the amplitude of its forcing as a parameter."""
    text = FILE.read_text(encoding="utf-8")
    text = text[: text.index("# Between impacts")].replace("{a: 0.05,", "{A: 20, a: 0.05,").replace("20*cos", "A*cos")
    return hsdsl.loads(text)


def impacts(c: float, amplitude: float) -> Iterator[float]:
    """The times of impacts by the closed form."""
    p, t, (x, v) = amplitude / (2 * A * W), 0.0, START
    while t < UNTIL:
        cosine = x - p * math.sin(W * t)
        sine = (v - p * W * math.cos(W * t) + A * cosine) / WD

        def position(s: float, t: float = t, c: float = cosine, d: float = sine) -> float:
            return p * math.sin(W * (t + s)) + math.exp(-A * s) * (c * math.cos(WD * s) + d * math.sin(WD * s))

        def velocity(s: float, t: float = t, c: float = cosine, d: float = sine) -> float:
            co, si = math.cos(WD * s), math.sin(WD * s)
            return p * W * math.cos(W * (t + s)) + math.exp(-A * s) * (-A * (c * co + d * si) + WD * (d * co - c * si))

        there = p * np.sin(W * (t + GRID)) + DECAY * (cosine * COSINE + sine * SINE)
        bracket = first_visit(there, position, velocity)
        if bracket is None:
            s = float(GRID[-1])
            x, v, t = position(s), velocity(s), t + s
            continue
        s = bisected(*bracket, lambda s: position(s) > STOP)
        if t + s > UNTIL:
            return
        x, v, t = STOP, -c * velocity(s), t + s
        yield t


def first_visit(there: np.ndarray, position: Curve, velocity: Curve) -> tuple[float, float] | None:
    """Where the position first goes beyond the stop: a time before it and one beyond."""
    above = np.flatnonzero(there > STOP)
    until = int(above[0]) if len(above) else len(there)
    middle, before, after = there[1:-1], there[:-2], there[2:]
    tops = np.flatnonzero((middle >= before) & (middle >= after) & (middle > STOP - 1e-2)) + 1
    for i in tops[tops < until]:
        top = bisected(float(GRID[i - 1]), float(GRID[i + 1]), lambda s: velocity(s) <= 0)
        if position(top) > STOP:
            return float(GRID[i - 1]), top
    return None if not len(above) else (float(GRID[until - 1]) if until else 0.0, float(GRID[until]))


def bisected(low: float, high: float, beyond: Callable[[float], bool]) -> float:
    """The last number before something holds."""
    while True:
        middle = (low + high) / 2
        if middle in (low, high):
            return low
        low, high = (low, middle) if beyond(middle) else (middle, high)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--instances", type=int, default=10_000)
    parser.add_argument("--checked", type=int)
    parser.add_argument("--tolerance", type=float, default=1e-10)
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    rng = np.random.default_rng(20_260)
    parameters = {"c": rng.uniform(0.3, 0.95, options.instances), "A": rng.uniform(8, 30, options.instances)}
    settings = {"scheme": "located", "method": "taylor", "tolerance": options.tolerance, "until": UNTIL}
    model = varied()
    model.ensemble(parameters={name: values[:8] for name, values in parameters.items()}, **settings)
    spent: list[float] = []
    for _ in range(options.repetitions):
        began = perf_counter()
        found = model.ensemble(parameters=parameters, **settings)
        spent.append(perf_counter() - began)
    print(f"{options.instances:,} runs: {min(spent):.2f} s (of {', '.join(f'{s:.2f}' for s in spent)}), {found}")
    found = model.ensemble(parameters=parameters, transition_times=MOST, **settings)
    wrong, total, worst = 0, 0, 0.0
    for k in range(options.instances if options.checked is None else options.checked):
        exact = np.array([*impacts(float(parameters["c"][k]), float(parameters["A"][k]))])
        total += len(exact)
        off = np.abs(found.transition_times[k][: len(exact)] - exact)
        if found.transitions[k] != len(exact) or not (off < 1e-4).all():
            wrong += 1
            print(
                f"wrong: c = {parameters['c'][k]}, A = {parameters['A'][k]}: {found.transitions[k]}, not {len(exact)}"
            )
            continue
        worst = max(worst, off.max(initial=0.0))
    print(f"{total:,} impacts, {wrong} runs wrong, times within {worst:.2e}")


if __name__ == "__main__":
    main()
