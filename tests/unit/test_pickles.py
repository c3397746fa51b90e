"""What users hold, in another process: models, runs, ensembles, errors."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from engines import ENGINES, alike

import hsdsl
from hsdsl.base.errors import Diagnostic, ModelError, Span, UsageError
from hsdsl.base.limits import Limits
from hsdsl.language.elaborate import elaborate
from hsdsl.language.files import DataRefused

MODELS = sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))
OSCILLATOR = next(path for path in MODELS if path.stem == "oscillator-with-stop-1")
FAST = {"scheme": "relaxed", "method": "rk4", "step": 0.01, "until": 1}
SECONDS = 60  # a pool that does not answer by then hangs
BAD = """hsdsl: 1
modes: {m: {flow: {x: 1, y: q}}}
initial: {mode: n, x: 0}
experiment: {until: 1}
"""


def again(value):
    return pickle.loads(pickle.dumps(value))


ERRORS = [
    ModelError([Diagnostic("HS111", "nothing is called q", Span("m.yaml", 2, 3, 1), "did you mean 'p'?", "x: q")]),
    ModelError([]),
    UsageError("the request is wrong", "another one"),
    UsageError("the request is wrong"),
    DataRefused("HS311", "no regular file", "a hint"),
]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_is_itself_again(error):
    error.add_note("in a worker")
    for copied in (again(error), copy.copy(error), copy.deepcopy(error)):
        assert (type(copied), vars(copied), str(copied)) == (type(error), vars(error), str(error))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
@pytest.mark.parametrize("seen", [False, True])
def test_a_model_is_itself_again(path, seen, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    model = hsdsl.load(path)
    if seen:
        assert model.program
        model = hsdsl.load(path)
    copied = again(model)
    assert copied.program == model.program and copied.system == model.system and copied.columns == model.columns
    assert not {"system", "_compiled"} & set(model.pipeline.__getstate__())


def test_a_model_without_a_file_is_itself_again():
    model = hsdsl.Model(elaborate(OSCILLATOR))
    assert again(model).system == model.system and alike(again(model).simulate(**FAST)) == alike(model.simulate(**FAST))


def test_a_model_in_another_process_needs_no_file(tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text(OSCILLATOR.read_text().replace("u: 20*cos(2.5*t)", "u: {file: u.csv}"))
    (tmp_path / "u.csv").write_text("time,u\n0,20\n1,0\n")
    limits = Limits(modes=50)
    model = hsdsl.load(path, limits)
    model.simulate(**FAST)
    expected, written = alike(model.simulate(**FAST | {"until": "1/2 + 1/4"})), pickle.dumps((model, model.only(["x"])))
    for file in (path, tmp_path / "u.csv"):
        file.unlink()
    copied, part = pickle.loads(written)
    assert alike(copied.simulate(**FAST | {"until": "1/2 + 1/4"})) == expected
    assert copied.system.digest == model.system.digest and part.columns == model.only(["x"]).columns
    assert copied.pipeline._files.limits == limits


@pytest.mark.parametrize("engine", ENGINES)
def test_an_ensemble_is_itself_again(engine):
    model = hsdsl.load(OSCILLATOR)
    ensemble = model.ensemble(initial={"v": [[1.0, 2.0], [3.0, 400.0]]}, samples=3, engine=engine, **FAST)
    copied = again(ensemble)
    for name in ("stop", "time", "mode", "transitions", "sample_times"):
        assert np.array_equal(getattr(copied, name), getattr(ensemble, name))
    assert copied.reasons == ensemble.reasons and copied.failures() == ensemble.failures()
    assert alike(copied.run(1, 0)) == alike(ensemble.run(1, 0)) == alike(model.simulate(initial={"v": 3.0}, **FAST))


@pytest.mark.parametrize("digits", [None, 30, 400])
def test_a_run_of_any_precision_and_its_samples_are_themselves_again(digits):
    run = hsdsl.load(OSCILLATOR).simulate(**FAST | {"step": 0.5}, precision=digits)
    assert again(run) == run and copy.deepcopy(run) == run
    samples = again(run.sample([0, 0.25]))
    assert (samples["x"] == run.sample([0, 0.25])["x"]).all() and type(samples["x"][0]) is type(run.values[0, 0])
    assert samples["x"][0] + run.times[0] == run.values[0, 0]


@pytest.mark.parametrize("method", sorted({"fork", "spawn"} & set(multiprocessing.get_all_start_methods())))
def test_models_and_errors_go_through_a_pool(method, tmp_path):
    bad = tmp_path / "bad.yaml"
    bad.write_text(BAD)
    with pytest.raises(ModelError) as here:
        hsdsl.load(bad)
    model = hsdsl.load(OSCILLATOR)
    expected = model.simulate(**FAST)
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context(method)) as pool:
        tasks = [(pool.submit(hsdsl.load, bad), pool.submit(hsdsl.load, tmp_path / "none.yaml")) for _ in range(100)]
        loaded = pool.submit(hsdsl.load, OSCILLATOR).result(SECONDS)
        runs = [pool.submit(model.simulate, **FAST) for _ in range(3)]
        ensemble = pool.submit(loaded.ensemble, initial={"v": [1.0, 2.0]}, engine="python", **FAST)
        for wrong, missing in tasks:
            with pytest.raises(ModelError) as there:
                wrong.result(SECONDS)
            assert there.value.diagnostics == here.value.diagnostics
            assert len(there.value.diagnostics) > 1 and there.value.diagnostics[0].text
            with pytest.raises(UsageError, match="there is no such file"):
                missing.result(SECONDS)
        assert all(run.result(SECONDS) == expected for run in runs)
        assert ensemble.result(SECONDS).run(1).stop.complete
