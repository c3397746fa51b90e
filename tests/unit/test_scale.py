"""Sizes of states that an experiment gives: from the file, `--set` and a call to the settings of a run."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl
from hsdsl.analysis.report import as_json
from hsdsl.base.errors import UsageError
from hsdsl.interface.model import split_overrides

MODEL = """hsdsl: 1
parameters: {k: 2}
modes:
  A:
    flow: {x: v, v: -k*x, z: 1}
initial: {mode: A, x: 1, v: 0, z: 0}
experiment: {until: 0.1, scale: {x: k, z: 1e-3}}
"""


def scale(run):
    return dict(run.settings["scale"])


@pytest.mark.parametrize("engine", ["python", "auto"])
def test_a_later_place_replaces_the_size_of_one_state(engine):
    model = hsdsl.loads(MODEL)
    assert scale(model.simulate(engine=engine)) == {"x": 2, "z": 1e-3}
    assert scale(model.simulate(engine=engine, parameters={"k": 3})) == {"x": 3, "z": 1e-3}
    _, _, settings = split_overrides(["experiment.scale.x=2*k", "experiment.scale.v=5"])
    run = model.simulate(settings=settings, scale={"v": 7}, engine=engine)
    assert scale(run) == {"x": 4, "z": 1e-3, "v": 7}
    assert run.overrides == {"experiment.scale.x": "2*k", "experiment.scale.v": 7}
    assert as_json(run)["settings"]["scale"] == {"x": 4, "z": 1e-3, "v": 7}


def test_a_state_that_is_left_out_has_no_scale():
    run = hsdsl.loads(MODEL).simulate(outputs=["x"], scale={"z": 2, "v": 1})
    assert scale(run) == {"x": 2, "v": 1}


def test_each_instance_of_an_ensemble_has_its_own():
    ensemble = hsdsl.loads(MODEL).ensemble(parameters={"k": np.array([1.0, -1.0, 4.0])})
    assert [scale(ensemble.run(i))["x"] for i in (0, 2)] == [1, 4]
    assert ensemble.refusals == {(1,): "scale.x must be positive, not -1.0"}


@pytest.mark.parametrize(
    "given, message",
    [({"y": 1}, "no state 'y'"), ({"x": 0}, "must be positive"), (3, "expected a mapping from states to sizes")],
)
def test_refused(given, message):
    with pytest.raises(UsageError, match=message):
        hsdsl.loads(MODEL).simulate(scale=given)
