"""Files that earlier versions of the formats were written in: they stay readable, and say the same.

`formats` has a file for each version of each format, written by the hsdsl of its time. None of them is ever written
again; a new version of a format adds one.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import hsdsl
from hsdsl.analysis import store
from hsdsl.analysis.store import npz, table
from hsdsl.analysis.sweep import load, manifest

FORMATS = Path(__file__).parent / "formats"
MODEL = FORMATS / "model.yaml"


def versions(pattern: str) -> list[int]:
    return sorted(int(path.stem.rpartition("-")[2]) for path in FORMATS.glob(pattern))


def test_every_version_has_its_file():
    assert versions("execution-*.npz") == [*range(1, npz.VERSION + 1)]
    assert versions("table-*.csv") == [*range(1, table.VERSION + 1)]
    assert versions("sweep-*") == [*range(1, manifest.VERSION + 1)]


@pytest.mark.parametrize("version", versions("execution-*.npz"))
def test_executions(version):
    run = store.load(FORMATS / f"execution-{version}.npz")
    own = hsdsl.load(MODEL).simulate()
    assert run.stop == own.stop and [t.edge for t in run.transitions] == [t.edge for t in own.transitions]
    assert np.allclose(run.sample([0.3, 1.7])["x"], own.sample([0.3, 1.7])["x"], rtol=1e-8)


@pytest.mark.parametrize("version", versions("table-*.csv"))
def test_sidecars_of_tables(version):
    found = store.read_sidecar(FORMATS / f"table-{version}.csv")
    assert found["title"] == "A ball that is thrown" and found["stop"]["reason"] == "until"


@pytest.mark.parametrize("version", versions("sweep-*"))
def test_sweeps(version):
    pytest.importorskip("pyarrow")
    found = load(FORMATS / f"sweep-{version}")
    assert found.complete and found.reasons == {"until": 6}
    row = found.table().to_pylist()[3]
    run = hsdsl.load(MODEL).simulate(parameters={"c": row["c"], "g": row["g"]})
    assert row["transition.time"] == pytest.approx([t.time for t in run.transitions], rel=1e-8)
    assert row["final.x"] == pytest.approx(run.final["x"], rel=1e-8) and row["verdict"] == run.verdict.theorem


def test_a_sidecar_of_a_later_version_is_refused(tmp_path):
    for name in ("table-1.csv", "table-1.csv.json"):
        shutil.copy(FORMATS / name, tmp_path)
    path = tmp_path / "table-1.csv.json"
    path.write_text(path.read_text().replace('"model"', '"version": 99, "model"', 1))
    with pytest.raises(hsdsl.UsageError, match="a later version"):
        store.read_sidecar(tmp_path / "table-1.csv")
