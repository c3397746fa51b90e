"""What the Python engine costs a step, beside the loop one would write by hand for this one model.

Both run relaxed midpoint on the forced oscillator with stop, example 1 (Burden et al. 2013, Sec. V-B), with
the same step and relaxation, in turn and in one process, keeping every step. Both must find 49 impacts and
end where the exact solution ends.

    python benchmarks/python_step.py [--repetitions 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from math import cos, pi
from pathlib import Path
from statistics import median
from time import perf_counter

import hsdsl

MODEL = Path(__file__).parent.parent / "models" / "oscillator-with-stop-1.yaml"
STEP, RELAXATION, UNTIL = 1e-3, 2e-8, 40 * pi
IMPACTS = 49
POSITION = 12.9901145114182240  # at the end; closed form, 40 digits
ALLOWED = 4e-4

Answer = tuple[int, int, float]  # accepted steps, impacts, position at the end


def by_hand(step: float, relaxation: float, until: float) -> Answer:
    """Relaxed midpoint with the model written into the loop, every step recorded."""
    damping, c, stiffness, stop = 2 * 0.05, 0.9, 2.5**2, 14.0
    t, x, v = 0.0, 11.36, 31.4
    times, positions, velocities, impacts = [t], [x], [v], 0
    while t < until:
        h = step if t + step < until else until - t
        slope = 20 * cos(2.5 * t) - damping * v - stiffness * x
        while True:
            half = 0.5 * h
            xm = x + half * v
            vm = v + half * slope
            xn = x + h * vm
            vn = v + h * (20 * cos(2.5 * (t + half)) - damping * vm - stiffness * xm)
            depth = xn - stop
            if depth <= relaxation:
                break
            h = half
        t += h
        if depth > 0:
            v = -c * (v + (stop - x) / (xn - x) * (vn - v))
            x = stop
            t += relaxation - depth
            impacts += 1
        else:
            x, v = xn, vn
        times.append(t)
        positions.append(x)
        velocities.append(v)
    return len(times) - 1, impacts, x


def by_hsdsl(model: hsdsl.Model, step: float, relaxation: float, until: float) -> Answer:
    """Run the same with hsdsl."""
    run = model.simulate(until=until, scheme="relaxed", method="midpoint", step=step, relaxation=relaxation)
    steps = sum(arc.last - arc.first for arc in run.arcs if arc.kind == "flow")
    return steps, len(run.transitions), run.final["x"]


def seconds_a_step(run: Callable[[], Answer]) -> float:
    """Time one run; a wrong one has no time."""
    start = perf_counter()
    steps, impacts, position = run()
    elapsed = perf_counter() - start
    if impacts != IMPACTS or abs(position - POSITION) > ALLOWED:
        raise SystemExit(f"{impacts} impacts and x = {position!r}, not {IMPACTS} and {POSITION!r}")
    return elapsed / steps


def main() -> None:
    """Time both in turn and print the medians and their ratio."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=5)
    repetitions = parser.parse_args().repetitions
    model = hsdsl.load(MODEL)
    pairs = [
        (
            seconds_a_step(lambda: by_hand(STEP, RELAXATION, UNTIL)),
            seconds_a_step(lambda: by_hsdsl(model, STEP, RELAXATION, UNTIL)),
        )
        for _ in range(repetitions + 1)
    ][1:]  # the first turn warms both up
    hand, engine = (median(times) for times in zip(*pairs, strict=True))
    ratios = [b / a for a, b in pairs]
    print(f"oscillator 1, relaxed midpoint, step {STEP}, relaxation {RELAXATION}, {repetitions} turns")
    print(f"by hand {hand * 1e6:7.3f} us a step")
    print(f"hsdsl   {engine * 1e6:7.3f} us a step, the whole call of simulate")
    print(f"ratio   {engine / hand:7.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    main()
