"""Sweeps whose workers and clients are killed at random moments: resumed, the dataset is that of an undisturbed one."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest

import hsdsl
from hsdsl.analysis.sweep import load

pytestmark = pytest.mark.campaign
MODEL = Path(__file__).parents[2] / "models" / "oscillator-with-stop-1.yaml"
WORDS = [
    "--vary", "c=0.5:0.95:40", "--vary", "a~uniform(0.04, 0.06)", "--random", "100", "--seed", "5",
    "--record", "final,transitions,outputs:every=1", "--until", "10", "--quiet",
]  # fmt: skip
KILLS, ROWS = 20, 4000


def started(out: Path, more: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "hsdsl", "sweep", str(MODEL), *WORDS, "--out", str(out), *more])


def children_of(process: int) -> list[int]:
    tasks = Path(f"/proc/{process}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def disturbed(out: Path, more: list[str], files: int, workers: Callable[[int], list[int]], seed: int) -> None:
    """Run to the end through kills, each soon after so many files are there; a killed client is started again."""
    dice = random.Random(seed)
    client = started(out, more)
    for count in sorted(dice.sample(range(1, files * 3 // 4), KILLS)):
        while len(list(out.glob("*.parquet"))) < count:
            time.sleep(0.001)
            assert client.poll() is None, f"the sweep ended before {count} files were there"
        time.sleep(dice.uniform(0, 0.01))
        victims = workers(client.pid)
        if victims and dice.random() < 0.5:
            os.kill(dice.choice(victims), signal.SIGKILL)
        else:
            client.kill()
            client.wait()
            client = started(out, more)
    assert client.wait() == 0


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="children are found in /proc")
@pytest.mark.parametrize(("there", "chunk"), [(False, 5), (True, 25)], ids=["here", "cluster"])
def test_kills_change_nothing(tmp_path, there, chunk):
    distributed = pytest.importorskip("distributed")
    arguments = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**arguments) if there else nullcontext() as cluster:
        more = ["--cluster", cluster.scheduler_address] if there else ["--processes", "2"]
        more += ["--chunk", str(chunk)]

        def workers(client: int) -> list[int]:
            return [nanny.pid for nanny in cluster.workers.values() if nanny.pid] if there else children_of(client)

        disturbed(tmp_path / "disturbed", more, ROWS // chunk, workers, seed=int(there))
    whole = hsdsl.load(MODEL).sweep(
        ["c=0.5:0.95:40", "a~uniform(0.04, 0.06)"], tmp_path / "whole", random=100, seed=5, until="10",
        record="final,transitions,outputs:every=1", chunk=400,
    )  # fmt: skip
    found = load(tmp_path / "disturbed")
    assert found.complete and found.rows == ROWS
    assert found.table().equals(whole.table())
    print(f"{KILLS} kills, {found.rows} rows equal")
