"""``hsdsl run MODEL --json`` of a cached model against the imports of its libraries, in alternating processes.

Python's own cache of compiled modules is in use, as for an installed package; the first turn fills it.

python benchmarks/startup.py [MODEL]
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

MODELS = Path(__file__).parent.parent / "models"
ROUNDS = 15
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def seconds(*words: str) -> float:
    """Wall time of one process."""
    began = time.perf_counter()
    subprocess.run([sys.executable, *words], stdout=subprocess.DEVNULL, check=True, env=ENVIRONMENT)
    return time.perf_counter() - began


def main() -> None:
    """Print both medians and their ratio."""
    model = sys.argv[1] if len(sys.argv) > 1 else str(MODELS / "thermostat.yaml")
    commands = ("-c", "import numpy, yaml, typer"), ("-m", "hsdsl", "run", model, "--json")
    rounds = [[seconds(*command) for command in commands] for _ in range(ROUNDS + 1)][1:]
    imports, run = (median(times) for times in zip(*rounds, strict=True))
    print(f"imports {imports:.3f} s, run {run:.3f} s, ratio {run / imports:.2f}")


if __name__ == "__main__":
    main()
