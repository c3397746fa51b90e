"""Outputs without a value, in modes that do not define them or at some instants: the others have theirs."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from engines import ENGINES, assert_engines_agree, needs_compiler

import hsdsl
from hsdsl.analysis.report import as_json, dumps
from hsdsl.analysis.store import load

CASE = Path(__file__).parent.parent / "conformance" / "cases" / "outputs-of-modes.yaml"
OF_A, OF_B = ("stretch", "pull"), ("swing",)


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


@needs_compiler
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


def many_outputs(count: int) -> str:
    """Outputs of three shapes with a part in common; of each shape some have no value at most times."""
    shapes = ("log(x - {at})/(x - {pole}) + log(2 - x)", "sqrt({at} - x)*x + min(2, x)", "{at} + x")
    written = (f"o{k}: '{shapes[k % 3].format(at=k / count, pole=2 * k / count)}'" for k in range(count))
    return f"""
hsdsl: 1
outputs: {{{", ".join(written)}}}
modes: {{a: {{flow: {{x: 1}}}}}}
initial: {{mode: a, x: 0}}
experiment: {{until: 2.5}}
"""


def own_value(k: int, count: int, x: float) -> float:
    """The value of one of them at x, not-a-number where it has none."""
    at, pole = k / count, 2 * k / count
    try:
        if k % 3 == 0:
            return math.log(x - at) / (x - pole) + math.log(2 - x)
        return math.sqrt(at - x) * x + min(2, x) if k % 3 == 1 else at + x
    except (ValueError, ZeroDivisionError):
        return math.nan


@pytest.mark.parametrize("engine", ["python", pytest.param("c", marks=needs_compiler)])
@pytest.mark.parametrize("count", [12, 300])  # as C in one function, and in pieces with loops
def test_an_output_without_a_value_leaves_the_others_theirs(count, engine):
    run = hsdsl.loads(many_outputs(count)).simulate(engine=engine)
    times = np.linspace(0.001, 2.499, 21)
    samples = run.sample(times)
    for k in range(count):
        expected = [own_value(k, count, t) for t in times]
        np.testing.assert_allclose(samples[f"o{k}"], expected, rtol=1e-12, atol=1e-12)


@needs_compiler
@pytest.mark.parametrize("count", [12, 300])
def test_engines_agree_on_outputs_without_values(count):
    assert_engines_agree(hsdsl.loads(many_outputs(count)))
