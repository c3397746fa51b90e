# pyright: basic
"""Time single runs and verdicts of this checkout against another one, in turns: how much slower a change makes them.

A worker of each checkout runs the same scenes in turns; what is printed is the median over the rounds of the ratio of
the median processor times of their calls.

    python benchmarks/paired.py ELSEWHERE [--rounds 40]

ELSEWHERE is a folder with another version of this repository, as `git worktree add ELSEWHERE COMMIT` makes it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from statistics import median

HERE = Path(__file__).parent.parent
SCENES = {  # with the calls of one turn
    "oscillator-with-stop-1": 15, "oscillator-with-stop-2": 30, "bouncing-ball": 60, "pronking-runner": 30,
    "stiff-switch": 5,
}  # fmt: skip
WORKER = """
import gc, json, sys, time
import hsdsl
gc.disable()
models = {}
for line in sys.stdin:
    scene, count = json.loads(line)
    if scene not in models:
        models[scene] = hsdsl.load(f"models/{scene}.yaml")
    runs, verdicts = [], []
    for _ in range(count):
        began = time.thread_time()
        run = models[scene].simulate(scheme="located", tolerance=1e-9, engine="c")
        ended = time.thread_time()
        run.verdict
        runs.append(ended - began)
        verdicts.append(time.thread_time() - ended)
    gc.collect()
    print(json.dumps([sorted(each)[count // 2] for each in (runs, verdicts)]), flush=True)
"""


class Worker:
    """A process that runs scenes by the code of one checkout."""

    def __init__(self, folder: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1"}
        command, pipe = [sys.executable, "-c", WORKER], subprocess.PIPE
        self._process = subprocess.Popen(command, cwd=folder, env=environment, stdin=pipe, stdout=pipe, text=True)

    def turn(self, scene: str, count: int) -> list[float]:
        """The median times of a run and of its verdict, in seconds."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps([scene, count]), file=self._process.stdin, flush=True)
        return json.loads(self._process.stdout.readline())


def main() -> None:
    """Print a line for each scene."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("elsewhere", type=Path)
    parser.add_argument("--rounds", type=int, default=40)
    given = parser.parse_args()
    other, own = Worker(given.elsewhere.resolve()), Worker(HERE)
    print(f"{'scene':24}{'run':>10}{'ratio':>8}{'verdict':>12}{'ratio':>8}")
    for scene, count in SCENES.items():
        for worker in (other, own):
            worker.turn(scene, count)  # compiles, and warms up
        turns: list[tuple[list[float], list[float]]] = []
        for k in range(given.rounds):
            first, second = (other, own) if k % 2 else (own, other)
            found = {id(worker): worker.turn(scene, count) for worker in (first, second)}
            turns.append((found[id(other)], found[id(own)]))
        times = [median(now[i] for _, now in turns) * 1e6 for i in (0, 1)]
        ratios = [median(now[i] / before[i] for before, now in turns) for i in (0, 1)]
        print(f"{scene:24}{times[0]:7.1f} us{ratios[0]:8.3f}{times[1]:9.1f} us{ratios[1]:8.3f}", flush=True)


if __name__ == "__main__":
    main()
