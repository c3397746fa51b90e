"""What systems of many parts cost: rooms in a row, `count: n`, by n; twenty legs against the runner with two.

For each number of rooms: seconds to load and lower, seconds of the first run with its compiler, microseconds of a
transition, all of processor time, and the memory of the whole. The more rooms, the shorter the run.

    python benchmarks/parts.py                      the runner and the centipede
    python benchmarks/parts.py 50 200 1000 5000     rooms
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

MODELS = Path(__file__).parent.parent / "models"
ROUNDS = 3
SCENES = {
    "runner, flat": ("pronking-runner.yaml", {"w": -0.4}),
    "runner of parts": ("parts/runner.yaml", {"body.w": -0.4}),
    "centipede": ("parts/centipede.yaml", {}),
}
ONE = """
import json, resource, sys, time
import hsdsl
began = time.perf_counter()
model = hsdsl.load(sys.argv[1])
initial = json.loads(sys.argv[2])
run = model.simulate(initial=initial)
first = time.perf_counter() - began
best = min(model.simulate(initial=initial).seconds["simulate"] for _ in range(30))
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([first, best / len(run.transitions) * 1e6, memory, len(run.transitions)]))
"""


UNTIL = 250.0  # over the number of rooms
ROOMS = """
import json, resource, sys, time
import hsdsl
from hsdsl.base.limits import Limits
def spent():
    return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
began = spent()
model = hsdsl.load(sys.argv[1], limits=Limits(seconds=3600, compile=3600))
model.program
loaded = spent()
until = float(sys.argv[2])
run = model.simulate(until=until)
first, each = spent(), []
for _ in range(5):
    start = spent()
    model.simulate(until=until)
    each.append((spent() - start) / len(run.transitions) * 1e6)
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([loaded - began, first - loaded, min(each), memory, len(run.transitions)]))
"""


def rooms(n: int, folder: str) -> list[float]:
    """Seconds to load, seconds of the first run, microseconds of a transition, MiB and transitions of rooms.

    What is compiled is kept in a folder.
    """
    path = Path(folder, f"{n}.yaml")
    path.write_text(re.sub("count: .*", f"count: {n}", (MODELS / "parts" / "rooms.yaml").read_text()))
    words = [sys.executable, "-c", ROOMS, str(path), repr(UNTIL / n)]
    environment = {**os.environ, "XDG_CACHE_HOME": folder}
    return json.loads(subprocess.run(words, env=environment, check=True, capture_output=True).stdout)


def measured(path: str, initial: dict[str, float]) -> list[float]:
    """Seconds to the end of the first run with an empty cache, microseconds per event, MiB and events."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        words = [sys.executable, "-c", ONE, str(MODELS / path), json.dumps(initial)]
        return json.loads(subprocess.run(words, env=environment, check=True, capture_output=True).stdout)


def main() -> None:
    """Print the requested rows of rooms, or those of the runner."""
    if len(sys.argv) == 1:
        return legs()
    print(f"{'rooms':>6} {'load':>10} {'first run':>11} {'transition':>13} {'memory':>11} {'transitions':>12}")
    with tempfile.TemporaryDirectory() as folder:
        rooms(3, folder)  # compiles the loop, which all models share
        for n in map(int, sys.argv[1:]):
            load, first, each, memory, count = rooms(n, folder)
            print(f"{n:6} {load:8.2f} s {first:9.2f} s {each:10.1f} us {memory:7.0f} MiB {count:12.0f}", flush=True)
    return None


def legs() -> None:
    """Print medians of rounds in which the scenes take turns, and ratios to the flat runner."""
    rounds = [{name: measured(*scene) for name, scene in SCENES.items()} for _ in range(ROUNDS)]
    rows = {name: [median(r[name][k] for r in rounds) for k in range(4)] for name in SCENES}
    base = next(iter(rows.values()))
    print(f"{'':16} {'first run':>16} {'per event':>18} {'memory':>16} {'events':>7}")
    for name, (first, event, memory, count) in rows.items():
        a, b, c = first / base[0], event / base[1], memory / base[2]
        print(
            f"{name:16} {first:7.2f} s ({a:4.2f}) {event:8.1f} us ({b:4.2f}) {memory:6.0f} MiB ({c:4.2f}) {count:6.0f}"
        )


if __name__ == "__main__":
    main()
