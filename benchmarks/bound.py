"""How near the forced oscillators with stop are to a program written by hand for them: `taylor_by_hand.c`.

The second one passes two Zeno points and is held by its stop three times. Ours completes it, once the flights that are
left take less than the relaxation. The program by hand holds the mass after an impact that is slow enough, and knows
when the force lets go. Both choose how soon among matching settings; the best are printed.

Both run Taylor's method at many tolerances, warm and in turns, in one process. The program by hand is compiled for
speed (-O3 -march=native, products and sums contracted), knows only this one model and hands over nothing but the
samples. What counts is the least time at which the largest position error over 2,000 samples is below a target. Ours is
a call of `model.simulate` and one of `sample`, from Python.

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
from hsdsl.interface.chart import Scene
from hsdsl.interface.chart.outcome import Judgement, judge
from hsdsl.interface.chart.scene import Attempt, Result, Tool
from hsdsl.interface.chart.stopwatch import Timed, race

HERE = Path(__file__).parent
RESTS = 1e-9, 1e-6, 2e-5, 1e-3, 1e-2
RELAXATIONS = tuple(4.3 * rest for rest in RESTS)  # a tail of the second one takes 4.3 times its speed
SCENES = {  # a, c, amplitude, omega, frequency, stop, x and v at the start; relaxations, and speeds of rest by hand
    "oscillator-with-stop-1": ((0.05, 0.9, 20.0, 2.5, 2.5, 14.0, 11.36, 31.4), (2e-7,), (0.0,)),
    "oscillator-with-stop-2": ((0.95, 0.5, 1.0, 1.0, 1.0, -0.8, -0.8, 0.0), RELAXATIONS, RESTS),
}
TARGETS = (1e-3, 1e-6, 1e-9, 1e-11)
TOLERANCES = tuple(10 ** -(k / 2) for k in range(2, 27))
HAND = "by hand"


def by_hand(library: ctypes.CDLL, scene: Scene, model: tuple[float, ...], rest: float) -> Callable[[float], Result]:
    """What runs the program at a tolerance."""
    grid, until, modes = np.ascontiguousarray(scene.grid), float(scene.grid[-1]), scene.exact_modes

    def run(tolerance: float) -> Result:
        found = np.empty((len(grid), 1))
        numbers = [ctypes.c_double(v) for v in (*model, rest, tolerance, until)]
        places: list[Any] = [ctypes.c_void_p(array.ctypes.data) for array in (grid, found)]
        count = library.taylor(*numbers, len(grid), *places)
        return Result(found, lambda: modes, lambda: count)

    return run


def ours(scene: Scene, relaxation: float, tolerance: float) -> Result:
    """Run the model at a tolerance."""
    run = scene.model.simulate(
        float(scene.grid[-1]), scheme="located", method="taylor", tolerance=tolerance, relaxation=relaxation, engine="c"
    )
    found = run.sample(scene.grid, columns=scene.states)
    problem = None if run.stop.complete else run.stop.message
    return Result(found.state_columns, lambda: found.mode, lambda: run.made, problem, run)


def main() -> None:
    """Print both times and their ratio for each scene and target."""
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(Path(folder), "taylor_by_hand")
        library.prepare()
        for name, (model, relaxations, rests) in SCENES.items():
            scene = Scene.of(hsdsl.load(HERE.parent / "models" / f"{name}.yaml"), states=["x"])
            attempts = [
                Attempt(Tool("hsdsl", f"{relaxation:.1e}"), "tolerance", value, partial(ours, scene, relaxation, value))
                for relaxation in relaxations
                for value in TOLERANCES
            ]
            for rest in rests:
                hand = by_hand(library, scene, model, rest)
                tool = Tool(HAND, f"{rest:.1e}")
                attempts += [Attempt(tool, "tolerance", value, partial(hand, value)) for value in TOLERANCES]
            print(name)
            report(list(race(attempts, lambda _, result, scene=scene: judge(scene, result), 9, 5.0, lambda _: None)))


def report(rows: list[tuple[Attempt, Judgement, Timed]]) -> None:
    """Print the least times at which a target is met."""
    print(f"{'error':>7} {'ours/us':>9} {'by hand':>9} {'ratio':>7}  relaxation, rest and tolerances of these")
    for target in TARGETS:
        (time, setting), (time_by_hand, setting_by_hand) = (
            min(
                (timed.spread[0] * 1e6, f"{attempt.tool.scheme} {attempt.value:.1e}")
                for attempt, judgement, timed in rows
                if (attempt.tool.name == HAND) is hand and judgement.verdict == "right" and judgement.error <= target
            )
            for hand in (False, True)
        )
        print(f"{target:7.0e} {time:9.1f} {time_by_hand:9.1f} {time / time_by_hand:7.2f}  {setting}; {setting_by_hand}")


if __name__ == "__main__":
    main()
