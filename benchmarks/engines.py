"""What the engines cost, beside a C program written by hand for the one model.

Relaxed midpoint on the forced oscillator with stop (Burden et al. 2013, Sec. V-B, example 1), by the Python loop, by
the compiled loop, and by `by_hand.c`, which has the model written into its loop and keeps every step; the runner by
both engines. All in turn and in one process; a run that does not end where the others do has no time.

    python benchmarks/engines.py [--repetitions 7] [--step 1e-3]
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import tempfile
from collections.abc import Callable
from math import pi
from pathlib import Path
from statistics import median
from time import thread_time
from typing import Any

import hsdsl
from hsdsl.engine.runtime.compiler import find_compiler

HERE = Path(__file__).parent
MODELS = HERE.parent / "models"
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
RELAXATION = 2e-8
Scene = tuple[str, dict[str, Any], dict[str, float] | None]
SCENES: list[Scene] = [
    ("oscillator-with-stop-1", {"until": 40 * pi}, {"a": 0.05, "c": 0.9, "f": 20, "w": 2.5, "x": 11.36, "v": 31.4}),
    ("pronking-runner", {"until": 2}, None),
]


def compiled(folder: Path, name: str) -> ctypes.CDLL:
    """Compile a program of this folder as a person would who wants speed."""
    library = folder / f"{name}.so"
    subprocess.run([*find_compiler().command, *FLAGS, "-o", library, HERE / f"{name}.c", "-lm"], check=True)
    return ctypes.CDLL(str(library))


def by_hand(folder: Path) -> Any:
    """The relaxed loop by hand."""
    function = compiled(folder, "by_hand").relaxed_midpoint
    function.restype = ctypes.c_double
    return function


def seconds(run: Callable[[], float]) -> tuple[float, float]:
    """Processor seconds of one run, and what it returns."""
    began = thread_time()
    answer = run()
    return thread_time() - began, answer


def contenders(name: str, settings: dict[str, Any], numbers: dict[str, float] | None, hand: Any) -> dict[str, Any]:
    """What runs a scene, by name: each a function that returns the first state at the end."""
    model = hsdsl.load(MODELS / f"{name}.yaml")

    def run(engine: str) -> float:
        return next(iter(model.simulate(**settings, engine=engine).final.state.values()))

    found: dict[str, Callable[[], float]] = {engine: lambda engine=engine: run(engine) for engine in ("python", "c")}
    if numbers is not None:
        arguments = [ctypes.c_double(v) for v in (*numbers.values(), settings["step"], RELAXATION, settings["until"])]
        found["by hand"] = lambda: hand(*arguments)
    return found


def main() -> None:
    """Time all in turn and print medians and ratios."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--step", type=float, default=1e-3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        hand = by_hand(Path(folder))
        for name, until, numbers in SCENES:
            settings = {
                **until,
                "method": "midpoint",
                "step": options.step,
                "relaxation": RELAXATION,
                "scheme": "relaxed",
            }
            report(name, contenders(name, settings, numbers, hand), options.repetitions)


def report(name: str, found: dict[str, Callable[[], float]], repetitions: int) -> None:
    """Print one scene's medians."""
    times: dict[str, list[float]] = {who: [] for who in found}
    for turn in range(repetitions + 1):
        answers: dict[str, float] = {}
        for who, run in found.items():
            took, answers[who] = seconds(run)
            if turn:  # the first turn warms everything up
                times[who].append(took)
        if max(answers.values()) - min(answers.values()) > 1e-6:
            raise SystemExit(f"{name}: they do not agree: {answers}")
    middle = {who: median(t) for who, t in times.items()}
    print(name)
    for who, took in middle.items():
        ratios = [b / a for a, b in zip(times["c"], times[who], strict=True)]
        print(f"  {who:8} {took * 1e3:9.3f} ms   {median(ratios):8.2f} times the compiled engine")


if __name__ == "__main__":
    main()
