"""How near the forced oscillator with stop is to a program written by hand for it: `taylor_by_hand.c`.

Both run Taylor's method at many tolerances, warm and in turns, in one process; the program by hand is compiled as a
person would who wants speed (-O3 -march=native, products and sums contracted), knows only this one model and hands over
nothing but the samples. What counts is the least time at which the largest position error over 2,000 samples is below a
target. Ours is a call of `model.simulate` and one of `sample`, from Python.

    python benchmarks/bound.py
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from engines import compiled

import hsdsl
from hsdsl.chart import Scene
from hsdsl.chart.judge import judge
from hsdsl.chart.plan import own_runs
from hsdsl.chart.result import Attempt, Result
from hsdsl.chart.stopwatch import race

HERE = Path(__file__).parent
NUMBERS = (0.05, 0.9, 20.0, 2.5, 11.36, 31.4)  # a, c, amplitude, omega, x and v at the start
TARGETS = (1e-3, 1e-6, 1e-9, 1e-11)
TOLERANCES = tuple(10 ** -(k / 2) for k in range(8, 27))
HAND = "by hand"


def by_hand(folder: Path, scene: Scene) -> Callable[[float], Result]:
    """Compile the program; returns what runs it at a tolerance."""
    library = compiled(folder, "taylor_by_hand")
    library.prepare()
    grid, until, modes = np.ascontiguousarray(scene.grid), float(scene.grid[-1]), scene.exact_modes

    def run(tolerance: float) -> Result:
        found = np.empty((len(grid), 1))
        numbers = [ctypes.c_double(v) for v in (*NUMBERS, tolerance, until)]
        places: list[Any] = [ctypes.c_void_p(array.ctypes.data) for array in (grid, found)]
        count = library.taylor(*numbers, len(grid), *places)
        return Result(found, lambda: modes, lambda: count)

    return run


def main() -> None:
    """Print both times and their ratio for each target."""
    scene = Scene.of(hsdsl.load(HERE.parent / "models" / "oscillator-with-stop-1.yaml"), states=["x"])
    with tempfile.TemporaryDirectory() as folder:
        hand = by_hand(Path(folder), scene)
        attempts = list(own_runs(scene, ["located"], ["taylor"], ["c"], TOLERANCES, (), []))
        attempts += [Attempt(HAND, "", "", "tolerance", value, partial(hand, value)) for value in TOLERANCES]
        rows = list(race(attempts, lambda _, result: judge(scene, result), 9, 5.0, lambda _: None))
    print(f"{'error':>7} {'ours/us':>9} {'by hand':>9} {'ratio':>7}")
    for target in TARGETS:
        least = [
            min(
                timed.spread[0] * 1e6
                for attempt, judgement, timed in rows
                if (attempt.tool == HAND) is hand and judgement.verdict == "right" and judgement.error <= target
            )
            for hand in (False, True)
        ]
        print(f"{target:7.0e} {least[0]:9.1f} {least[1]:9.1f} {least[0] / least[1]:7.2f}")


if __name__ == "__main__":
    main()
