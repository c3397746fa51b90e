"""Oscillators with a stop, restitution and initial velocity varied: a sweep on two Dask workers of this machine against
`model.ensemble` with two threads, and the memory of every process while it goes on.

    python benchmarks/sweep.py [--rows 1000000] [--baseline 50000] [--rounds 5] [--method taylor] [--here]

Both begin warm, and take turns on `--baseline` rows, `--rounds` times. Then one sweep has all rows.
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
from hsdsl.analysis.sweep import load
from hsdsl.analysis.sweep.variation import read
from hsdsl.base.processes import processor_seconds

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
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--method", choices=("taylor", "file"), default="taylor")
    parser.add_argument("--here", action="store_true")
    given = parser.parse_args()
    settings: dict[str, Any] = {"until": 10, "engine": "c"}
    if given.method == "taylor":
        settings |= {"scheme": "located", "method": "taylor", "tolerance": 1e-9}
    model, memory = hsdsl.load(MODEL), list[tuple[float, list[float]]]()
    ensembles, sweeps = list[tuple[float, float]](), list[tuple[float, float]]()
    rate_of_ensemble(model, 100, settings)
    with tempfile.TemporaryDirectory() as folder, workers(given.here) as (where, processes):

        def processors() -> float:
            return process_time() + sum(map(processor_seconds, processes))

        def rate_of_sweep(name: str, rows: int, **more: Any) -> tuple[float, float]:
            began, busy = perf_counter(), processors()
            model.sweep(VARY, Path(folder) / name, random=rows, **settings, **where, **more)
            return rows / (perf_counter() - began), rows / (processors() - busy)

        def watch(done: int, rows: int) -> None:
            if done >= rows * len(memory) / 4:
                memory.append((done / rows, [resident(each) for each in ("self", *processes)]))

        rate_of_sweep("warm", 1000)
        for k in range(given.rounds):  # in turn, as other programs on the machine come and go
            ensembles.append(rate_of_ensemble(model, given.baseline, settings))
            sweeps.append(rate_of_sweep(str(k), given.baseline))
        rate, _ = rate_of_sweep("large", given.rows, progress=watch)
        size = sum(path.stat().st_size for path in load(Path(folder) / "large").chunks.values())
    for what, found in (("ensemble, 2 threads", ensembles), ("sweep, 2 workers", sweeps)):
        walls, busy = np.transpose(found)
        print(f"{what}: {given.baseline:,} rows at {', '.join(f'{rate:,.0f}' for rate in walls)} rows/s,")
        print(f"    {np.median(busy):,.0f} rows for each second of a processor")
    ratios = np.array(sweeps)[:, 0] / np.array(ensembles)[:, 0]
    print(f"ratio: median {np.median(ratios):.2f} of rounds {', '.join(f'{ratio:.2f}' for ratio in ratios)}")
    print(f"one sweep of {given.rows:,} rows, {size / 1e6:.1f} MB of files: {rate:,.0f} rows/s")
    for share, sizes in memory:
        print(f"at {share:4.0%}: MB of this process and the workers: {', '.join(f'{size:.0f}' for size in sizes)}")


if __name__ == "__main__":
    main()
