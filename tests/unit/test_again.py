"""Runs again: what is prepared once serves every later call, and no run sees another's numbers."""

from __future__ import annotations

import pickle
import threading
from dataclasses import replace

import numpy as np
import pytest
from engines import ENGINES, alike, needs_compiler
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.interface.model.call_cache import CallCache, call_key

OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"
FAST = {"scheme": "relaxed", "method": "dopri5", "tolerance": 1e-6, "until": 10}


def fresh(**given):
    return hsdsl.load(OSCILLATOR).simulate(**given)


@pytest.mark.parametrize("engine", ENGINES)
def test_every_later_call_gives_what_the_first_gave(engine):
    model = hsdsl.load(OSCILLATOR)
    calls = [
        {},
        {"parameters": {"c": 0.5}},
        {"parameters": {"c": "1/2"}},
        {"initial": {"v": 0}},
        {"until": 3},
        {"relaxation": 1e-3},
        {"samples": [0, 1.5]},
    ]
    first = [model.simulate(**FAST | call, engine=engine) for call in calls]
    again = [model.simulate(**FAST | call, engine=engine) for call in reversed(calls)]
    for call, run, other in zip(calls, first, reversed(again), strict=True):
        assert alike(run) == alike(other) == alike(fresh(**FAST | call, engine=engine)), call


def test_a_changed_override_is_another_call():
    model, overrides = hsdsl.load(OSCILLATOR), {"c": 0.9}
    before = model.simulate(**FAST, parameters=overrides)
    overrides["c"] = 0.1
    assert model.simulate(**FAST, parameters=overrides) != before


def test_what_is_refused_is_refused_again():
    model = hsdsl.load(OSCILLATOR)
    assert model.simulate(**FAST | {"until": 1}).stop.time == 1
    for _ in range(2):
        with pytest.raises(UsageError, match="expected a number or an expression"):
            model.simulate(**FAST | {"until": True})


@needs_compiler
def test_a_run_keeps_its_numbers_when_others_follow():
    model = hsdsl.load(OSCILLATOR)
    run = model.simulate(**FAST, engine="c")
    kept = {name: getattr(run, name).copy() for name in ("times", "values", "coefficients", "depth")}
    for c in (0.1, 0.5, 0.7):
        model.simulate(**FAST, parameters={"c": c}, engine="c")
    assert all(np.array_equal(column, getattr(run, name)) for name, column in kept.items())
    assert alike(run) == alike(fresh(**FAST, engine="c"))


@needs_compiler
def test_runs_in_threads_and_runs_within_runs_do_not_meet():
    model = hsdsl.load(OSCILLATOR)
    expected = model.simulate(**FAST, engine="c")
    inner, found = [], []

    def watch(_):
        inner.append(model.simulate(**FAST, engine="c"))

    def work():
        found.extend(model.simulate(**FAST, engine="c") for _ in range(20))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    outer = model.simulate(**FAST, engine="c", watch=watch)
    for thread in threads:
        thread.join()
    assert all(alike(run) == alike(expected) for run in (*inner, *found, outer))


@needs_compiler
def test_what_is_made_later_is_as_if_it_had_been_there():
    run = hsdsl.load(OSCILLATOR).simulate(**FAST, engine="c")
    assert "transitions" not in vars(run) and "arcs" not in vars(run)
    checked = replace(run)  # looks at everything, and checks it
    assert checked == run and checked.transitions is run.transitions
    with pytest.raises(AttributeError, match="'Execution' object has no attribute 'transition'"):
        _ = run.transition
    samples = run.sample([0.0, 1.0])
    assert set(samples.mode.tolist()) == {"free"} and "present" not in vars(samples)
    copied = pickle.loads(pickle.dumps(samples))
    assert copied.present.all() and copied["x"].tolist() == samples["x"].tolist()


def test_chosen_columns_of_samples():
    for engine in ENGINES:
        run = hsdsl.load(OSCILLATOR).simulate(**FAST, engine=engine)
        both, one = run.sample([0.0, 1.0]), run.sample([0.0, 1.0], columns=["v"])
        assert one.names == ("v",) and one["v"].tolist() == both["v"].tolist()
        with pytest.raises(UsageError, match="no state or output is called w"):
            run.sample([0.0], columns=["w"])
        with pytest.raises(ValueError, match="time 11 is outside the run, which goes from 0 to 10"):
            run.sample([0.0, 11.0, 12.0])
        assert len(run.sample([])) == 0


def test_keys_tell_apart_what_is_not_the_same():
    values = [1, 1.0, True, "1", 0.0, None, [1], (1,), {"a": 1}, {"a": 1.0}, {"b": 1}]
    assert len({call_key(value) for value in values}) == len(values)
    assert call_key(np.float64(1)) is None and call_key({"a": object()}) is None


def test_only_the_last_are_remembered():
    remembered = CallCache[int](2)
    for number in range(3):
        remembered.keep((number,), number)
    remembered.keep(None, 7)
    assert [remembered.find(key) for key in ((0,), (1,), (2,), None)] == [None, 1, 2, None]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_made_again_is_the_same_run(engine):
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    assert model.simulate(2, engine=engine) == model.simulate(2, engine=engine)
    assert model.simulate(2, engine=engine) != model.simulate(1, engine=engine)
