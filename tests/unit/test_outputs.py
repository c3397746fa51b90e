"""Outputs that only some modes define: no value elsewhere, whichever way they are asked for."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from engines import COMPILER

import hsdsl
from hsdsl.report import as_json, dumps
from hsdsl.store import load

CASE = Path(__file__).parent.parent / "conformance" / "cases" / "outputs-of-modes.yaml"
OF_A, OF_B = ("stretch", "pull"), ("swing",)
ENGINES = ["python", *(["c"] if COMPILER else [])]


@pytest.mark.parametrize("engine", ENGINES)
def test_in_points_samples_tables_and_json(engine, tmp_path):
    run = hsdsl.load(CASE).simulate(until=1.5, engine=engine)
    for time, here, elsewhere in ((0.25, OF_A, OF_B), (1.25, OF_B, OF_A)):
        point = run(time)
        assert all(point[name] == point[name] for name in ("power", "both", *here))
        assert all(np.isnan(point[name]) for name in elsewhere)
    in_a = run.rows().mode == "a"
    samples = run.sample(run.rows().time[in_a][:-1])
    assert all(np.isfinite(samples[name]).all() for name in OF_A)
    assert np.isnan(samples["swing"]).all()
    run.save(tmp_path / "run.csv")
    header, *lines = (tmp_path / "run.csv").read_text().splitlines()
    for line in lines:
        cells = dict(zip(header.split(","), line.split(","), strict=True))
        empty = {name for name in (*OF_A, *OF_B) if cells[name] == ""}
        assert empty == set(OF_B if cells["mode"] == "a" else OF_A)
    final = json.loads(dumps(as_json(run)))["final"]["outputs"]
    assert final["stretch"] is None and final["pull"] is None and final["swing"] == 4.5
    run.save(tmp_path / "run.npz")
    assert load(tmp_path / "run.npz") == run


@pytest.mark.parametrize("engine", ENGINES)
def test_asked_for_alone(engine):
    model = hsdsl.load(CASE)
    whole = model.simulate(until=1.5, engine=engine)
    alone = model.simulate(until=1.5, engine=engine, outputs=["pull", "power"])
    assert alone.output_names == ("power", "pull") and np.isnan(alone.final.outputs["pull"])
    assert alone.final.outputs["power"] == whole.final.outputs["power"]


@pytest.mark.skipif(not COMPILER, reason="compiled engine")
def test_in_ensembles_and_streams(tmp_path):
    model = hsdsl.load(CASE)
    many = model.ensemble(parameters={"k": [1, 3]}, until=1.5, samples=[0.5, 1.25])
    assert many.samples["pull"][:, 0].tolist() == pytest.approx([0.5, 1.5])
    assert np.isnan(many.samples["pull"][:, 1]).all() and np.isnan(many.samples["swing"][:, 0]).all()
    assert np.isnan(many.outputs["pull"]).all() and many.outputs["swing"].tolist() == [4.5, 4.5]
    streamed = model.stream(tmp_path / "run.csv", until=1.5)
    assert np.isnan(streamed.final["pull"][0]) and streamed.final["swing"][0] == 4.5
    header, *_, last = (tmp_path / "run.csv").read_text().splitlines()
    assert dict(zip(header.split(","), last.split(","), strict=True))["pull"] == ""


def test_a_picture_has_gaps(tmp_path):
    model = hsdsl.load(CASE)
    model.plot(model.simulate(until=1.5), tmp_path / "run.svg")
    assert (tmp_path / "run.svg").stat().st_size
