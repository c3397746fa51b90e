"""Oscillators with a stop, restitution and initial velocity varied: a sweep on two Dask workers of this machine against
`model.ensemble` with two threads, and the memory of every process while it goes on.

    python benchmarks/sweep.py [--rows 1000000] [--baseline 50000] [--rounds 3] [--method taylor] [--here]

Both begin warm. The ensemble is timed before and after, `--rounds` times each, on fewer rows; its best rate counts.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np

import hsdsl
from hsdsl.processes import processor_seconds
from hsdsl.sweep.variation import read

MODEL = Path(__file__).parent.parent / "models" / "oscillator-with-stop-1.yaml"
VARY = ["c~uniform(0.5, 0.95)", "initial.v~uniform(10, 40)"]


def resident(process: int | str) -> float:
    """The memory of a process in MB."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def rate_of_ensemble(model: hsdsl.Model, rows: int, settings: dict[str, Any]) -> tuple[float, float]:
    """Rows a second of the same rows in memory, by two threads; and rows a second of processors."""
    values = read(VARY, rows, 0, lambda value, _: float(value)).values(0, rows)
    began, busy = perf_counter(), process_time()
    model.ensemble(parameters={"c": values["c"]}, initial={"v": values["initial.v"]}, threads=2, **settings)
    return rows / (perf_counter() - began), rows / (process_time() - busy)


@contextmanager
def workers(here: bool) -> Generator[tuple[dict[str, Any], list[int]]]:
    """Two workers, as arguments of a sweep, and their processes."""
    if here:
        yield {"processes": 2}, []
        return
    from distributed import LocalCluster

    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield {"cluster": cluster.scheduler_address}, [nanny.pid for nanny in cluster.workers.values()]


def main() -> None:
    """Print both rates, their ratio, and memory at quarters of the sweep."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--baseline", type=int, default=50_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--method", choices=("taylor", "file"), default="taylor")
    parser.add_argument("--here", action="store_true")
    given = parser.parse_args()
    settings: dict[str, Any] = {"until": 10, "engine": "c"}
    if given.method == "taylor":
        settings |= {"scheme": "located", "method": "taylor", "tolerance": 1e-9}
    model, memory = hsdsl.load(MODEL), list[tuple[float, list[float]]]()
    rate_of_ensemble(model, 100, settings)
    before = [rate_of_ensemble(model, given.baseline, settings) for _ in range(given.rounds)]
    with tempfile.TemporaryDirectory() as folder, workers(given.here) as (where, processes):
        model.sweep(VARY, Path(folder) / "warm", random=1000, **settings, **where)

        def watch(done: int, rows: int) -> None:
            if done >= rows * len(memory) / 4:
                memory.append((done / rows, [resident(each) for each in ("self", *processes)]))

        def processors() -> float:
            return process_time() + sum(map(processor_seconds, processes))

        began, busy = perf_counter(), processors()
        found = model.sweep(VARY, Path(folder) / "sweep", random=given.rows, progress=watch, **settings, **where)
        rate, by_processors = given.rows / (perf_counter() - began), given.rows / (processors() - busy)
        size = sum(path.stat().st_size for path in found.chunks.values())
    rounds = before + [rate_of_ensemble(model, given.baseline, settings) for _ in range(given.rounds)]
    rates, of_processors = np.transpose(rounds)
    print(f"ensemble, {given.baseline:,} rows, 2 threads: {rates.max():,.0f} rows/s (of {rates.round(-1).tolist()})")
    print(f"sweep, {given.rows:,} rows in {len(found.chunks)} files of {size / 1e6:.1f} MB in all: {rate:,.0f} rows/s")
    print(f"ratio {rate / rates.max():.2f} of the best, {rate / np.median(rates):.2f} of the median")
    print(f"a second of processors: ensemble {np.median(of_processors):,.0f} rows, sweep {by_processors:,.0f}")
    for share, sizes in memory:
        print(f"at {share:4.0%}: MB of this process and the workers: {', '.join(f'{size:.0f}' for size in sizes)}")


if __name__ == "__main__":
    main()
