"""Long runs of the thermostat by Taylor's method: microseconds of a processor for each transition, and memory.

One process keeps the whole run, another one streams it to a file: the first row, the last, and both of each jump.

    python benchmarks/long.py [--transitions 10000000]
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time
from typing import Any

import hsdsl
from hsdsl.base.limits import Limits

MODEL = Path(__file__).parent.parent / "models" / "thermostat.yaml"
LIMITS = Limits(memory=1 << 32)  # bytes that a run may keep
SETTINGS: dict[str, Any] = {"until": 1e12, "method": "taylor", "tolerance": 1e-9, "engine": "c"}


def measure(how: str, transitions: int, file: Path) -> None:
    """Print a line for one run of this process."""
    model = hsdsl.load(MODEL, limits=LIMITS)

    def run(most: int) -> int:
        settings: dict[str, Any] = {**SETTINGS, "max_transitions": most}
        if how == "simulate":
            return len(model.simulate(**settings).transitions)
        return model.stream(file, every=2**62, **settings).transitions

    run(1000)
    began = process_time()
    made = run(transitions)
    took, memory = process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"{how:9} {made:>11,} {took / made * 1e6:6.2f} us {memory / 1024:8.0f} MiB", flush=True)


def main() -> None:
    """Print a line for each way to run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--transitions", type=int, default=10**7)
    parser.add_argument("--how", choices=("simulate", "stream"))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if given.how:
            return measure(given.how, given.transitions, Path(folder) / "run.csv")
        for how in ("simulate", "stream"):
            subprocess.run([sys.executable, __file__, *sys.argv[1:], "--how", how], check=True)
    return None


if __name__ == "__main__":
    main()
