"""``hsdsl run MODEL --json`` of cached models against the imports of its libraries, and first runs.

A cached run and the imports alternate. A first run has an empty cache of its own, so that it reads, lowers and compiles
the model. It counts from the wheel of this platform, which has the loop compiled; from a checkout the loop is compiled
before. Python's own cache of compiled modules is in use, as for an installed package; the first turn fills it.

    python benchmarks/startup.py [MODEL...]
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory

MODELS = Path(__file__).parent.parent / "models"
ROUNDS, FIRST = 15, 5
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
LOOP = "from hsdsl.engine.runtime.kernel import runtime; runtime()"


def seconds(*words: str, cache: str | None = None) -> float:
    """Wall time of one process."""
    environment = ENVIRONMENT | ({} if cache is None else {"XDG_CACHE_HOME": cache})
    began = time.perf_counter()
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True, env=environment)
    return time.perf_counter() - began


def first(model: str) -> float:
    """Wall time of a first run."""
    with TemporaryDirectory() as cache:
        seconds("-c", LOOP, cache=cache)
        taken = seconds("-m", "hsdsl", "run", model, "--json", cache=cache)
        seconds("-m", "hsdsl", "run", model, "--json", cache=cache)  # waits for the compiler, if that goes on
        return taken


def main() -> None:
    """Print the medians of a cached run and of the imports with their ratio, and the least of first runs."""
    models = sys.argv[1:] or sorted(map(str, MODELS.glob("*.yaml")))
    cached = next((model for model in models if model.endswith("thermostat.yaml")), models[0])
    commands = ("-c", "import numpy, yaml, typer"), ("-m", "hsdsl", "run", cached, "--json")
    rounds = [[seconds(*command) for command in commands] for _ in range(ROUNDS + 1)][1:]
    imports, run = (median(times) for times in zip(*rounds, strict=True))
    print(f"imports {imports:.3f} s, run {run:.3f} s, ratio {run / imports:.2f}")
    least = {model: min(first(model) for _ in range(FIRST)) for model in models}
    for model, time_ in least.items():
        print(f"first run {time_:.3f} s  {Path(model).stem}")
    print(f"first run {mean(least.values()):.3f} s on average")


if __name__ == "__main__":
    main()
