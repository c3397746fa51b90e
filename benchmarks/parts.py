"""What a system of twenty legs costs against the runner with two: first load and compile, memory, time per event.

python benchmarks/parts.py
"""

from __future__ import annotations

import json
import os
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


def measured(path: str, initial: dict[str, float]) -> list[float]:
    """Seconds to the end of the first run with an empty cache, microseconds per event, MiB and events."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "XDG_CACHE_HOME": folder}
        words = [sys.executable, "-c", ONE, str(MODELS / path), json.dumps(initial)]
        return json.loads(subprocess.run(words, env=environment, check=True, capture_output=True).stdout)


def main() -> None:
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
