"""What a run was given beyond its file: recorded in every form of it, and used by distances."""

from __future__ import annotations

import json
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from engines import COMPILER, ENGINES

import hsdsl
from hsdsl.analysis.report import as_json, dumps
from hsdsl.analysis.report.summary import summary
from hsdsl.analysis.store import load
from hsdsl.interface.cli import main
from hsdsl.interface.model.distances import distance_of_runs as distance

MODEL = """hsdsl: 1
parameters: {c: 1/2, wall: 1, far: {value: 2*wall, min: 0}}
modes:
  m:
    flow: {x: v, v: 0}
    transitions: [{when: x >= wall, to: m, reset: {x: -far, v: c*v}}]
initial: {mode: m, x: 0, v: 1}
experiment: {until: 3, step: 0.1, method: rk4, scheme: located}
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "model.yaml").write_text(MODEL)
    return tmp_path / "model.yaml"


@pytest.mark.parametrize("engine", ENGINES)
def test_recorded_as_written(path, engine):
    model = hsdsl.load(path)
    assert model.simulate(engine=engine).overrides == {}
    run = model.simulate(
        until="2+1", tolerance=1e-8, parameters={"c": "1/3", "wall": np.float64(0.75)},
        initial={"v": Fraction(3, 2)}, settings={"step": "1e-3", "samples": [0, "1/2"]}, engine=engine,
    )  # fmt: skip
    assert run.overrides == {
        "c": "1/3", "wall": 0.75, "initial.v": "3/2",
        "experiment.until": "2+1", "experiment.tolerance": 1e-8, "experiment.samples": [0, "1/2"],
    }  # fmt: skip
    assert as_json(run)["overrides"] == run.overrides
    assert "with c = 1/3, wall = 0.75, initial.v = 3/2" in summary(run)


@pytest.mark.parametrize("value", [np.float32(0.75), np.int8(3), np.array(0.75)])
def test_numbers_of_numpy_are_numbers(path, value):
    model, number = hsdsl.load(path), value.tolist()
    run = model.simulate(until=value, parameters={"c": value}, initial={"v": value})
    assert run == model.simulate(until=number, parameters={"c": number}, initial={"v": number})
    assert run.overrides == {"c": number, "initial.v": number, "experiment.until": number}


@pytest.mark.parametrize("value", ["0.1", 3, 0.25, mp.mpf("0.3")])
def test_kept_in_files(path, tmp_path, value):
    run = hsdsl.load(path).simulate(parameters={"c": value}, precision=30 if isinstance(value, mp.mpf) else None)
    run.save(tmp_path / "run.npz")
    again = load(tmp_path / "run.npz")
    assert again == run and again.overrides == {"c": value}
    run.save(tmp_path / "run.csv")
    sidecar = json.loads((tmp_path / "run.csv.json").read_text())
    assert sidecar["overrides"] == json.loads(dumps({"c": value}))


def test_a_file_from_before_has_none(path, tmp_path):
    run = hsdsl.load(path).simulate()
    run.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        arrays = {name: archive[name] for name in archive.files}
    header = json.loads(arrays.pop("header").tobytes())
    del header["overrides"]
    np.savez(tmp_path / "old.npz", header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)
    assert load(tmp_path / "old.npz") == run


def test_a_distance_is_that_of_the_run_s_own_space(path, tmp_path):
    model = hsdsl.load(path)
    overrides = {"wall": "3/4", "far": "1"}
    a, b = (model.simulate(until=1.5, parameters=overrides, initial={"x": x}) for x in (0, 0.125))
    expected = distance(a, b, model=model, parameters=overrides)
    plain = [run.__class__(**{**run.__getstate__(), "overrides": {}}) for run in (a, b)]
    assert distance(*plain).interval != expected.interval  # in the file's space the runs are elsewhere
    for run, name in ((a, "a.npz"), (b, "b.npz")):
        run.save(tmp_path / name)
    found = distance(load(tmp_path / "a.npz"), load(tmp_path / "b.npz"))
    assert found.interval == expected.interval and found.note == expected.note


def test_parameters_that_differ_are_said(path):
    model = hsdsl.load(path)
    a, b = (model.simulate(parameters={"c": c}) for c in ("0.5", "0.7"))
    found = distance(a, b)
    assert "c = 0.5 and 0.7" in found.note and "of the first" in found.note
    assert "parameters" not in distance(a, model.simulate()).note  # 0.5 is the file's own
    assert "parameters" not in distance(a, b, parameters={"c": 1}).note


@pytest.mark.parametrize("every", [[], ["--every", "3"]])
def test_on_the_command_line(path, tmp_path, monkeypatch, capsys, every):
    if every and not COMPILER:
        pytest.skip("only compiled runs stream")
    command = ["run", str(path), "--set", "c=2/3", "--set", "initial.x=0.5", "--set", "experiment.step=1/8"]
    command += ["--until", "1", "--json", "--out", str(tmp_path / "run.csv"), *every]
    monkeypatch.setattr("sys.argv", ["hsdsl", *command])
    with pytest.raises(SystemExit):
        main()
    found = json.loads(capsys.readouterr().out)["overrides"]
    assert found == {"c": "2/3", "initial.x": "0.5", "experiment.step": "1/8", "experiment.until": "1"}
