"""Runs that would fill the memory: they stop with what was computed, or are refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from engines import ENGINES, needs_compiler
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.limits import Limits
from hsdsl.engine.execution import records
from hsdsl.engine.simulate import output_buffers

OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"
LONG = {
    "located": {"step": 1e-12, "method": "dopri5"},
    "relaxed": {"step": 1e-12, "method": "rk4", "scheme": "relaxed"},
    "taylor": {"tolerance": 1e-12, "until": 1e9, "max_transitions": 1e15},
    "stiff method": {"step": 1e-10, "method": "radau"},
    "paoli-schatzman": {"step": 1e-12, "scheme": "paoli-schatzman"},
}
WIDE = (
    "hsdsl: 1\nmodes: {m: {flow: {" + ", ".join(f"x{i}: 1" for i in range(100)) + "}}}\n"
    "initial: {mode: m, " + ", ".join(f"x{i}: 0" for i in range(100)) + "}\nexperiment: {until: 1, step: 1e-9}\n"
)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", LONG)
def test_a_run_that_fills_its_memory_keeps_what_was_computed(engine, kind):
    if engine == "c" and kind == "paoli-schatzman":
        pytest.skip("no compiled loop")
    model = hsdsl.load(OSCILLATOR, limits=Limits(memory=2_000_000))
    run = model.simulate(engine=engine, **LONG[kind])
    assert run.stop.reason == "memory_limit" and "limit 'memory'" in run.stop.message
    assert len(run.times) > 500 and run.times[-1] == run.stop.time > 0
    kept = sum(getattr(run, name).nbytes for name in ("times", "values", "coefficients", "outputs", "depth"))
    assert 100_000 < kept < 4_000_000
    assert run.verdict.theorem != "holds"
    longer = hsdsl.load(OSCILLATOR, limits=Limits(memory=3_000_000)).simulate(engine=engine, **LONG[kind])
    count = len(run.times) - 1  # where it stops, a run of the two-step scheme has a last row of its own
    assert len(longer.times) > count and (longer.times[:count] == run.times[:count]).all()
    assert (longer.values[:count] == run.values[:count]).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_rows_of_many_states_are_counted_by_their_size(engine):
    run = hsdsl.loads(WIDE, limits=Limits(memory=3_000_000)).simulate(engine=engine, method="rk4")
    assert run.stop.reason == "memory_limit"
    assert run.values.nbytes + run.coefficients.nbytes < 30_000_000


@needs_compiler
def test_memory_that_is_refused_by_the_system_ends_a_run_as_well(monkeypatch):
    opened = []

    def empty(*arguments, **named):
        opened.append(arguments)
        if len(opened) == 40:
            raise MemoryError
        return original(*arguments, **named)

    original = np.empty
    model = hsdsl.load(OSCILLATOR)
    monkeypatch.setattr(output_buffers, "MOST_ROWS", 1 << 14)  # what the tests before have left room for
    monkeypatch.setattr(output_buffers.np, "empty", empty)
    run = model.simulate(engine="c", step=1e-7, method="rk4", until=1)
    monkeypatch.undo()
    assert run.stop.reason == "memory_limit" and run.times[-1] == run.stop.time > 0


@needs_compiler
def test_a_streamed_run_has_no_such_limit(tmp_path):
    model = hsdsl.load(OSCILLATOR, limits=Limits(memory=100_000))
    run = model.stream(tmp_path / "run.csv", step=1e-5, until=1, every=10_000, method="rk4")
    assert run.stop.reason == "until" and run.steps > 100_000


def test_samples_that_would_fill_the_memory_are_refused():
    model = hsdsl.load(OSCILLATOR, limits=Limits(memory=1_000_000))
    for samples in (10**6, 10**15):
        with pytest.raises(UsageError, match="limit 'memory'"):
            model.simulate(samples=samples)
        with pytest.raises(UsageError, match="limit 'memory'"):
            model.ensemble(samples=samples)
    assert model.simulate(samples=100, until=1).stop.complete
    with pytest.raises(UsageError, match="limit 'memory'"):
        model.ensemble(parameters={"c": [0.5] * 1000}, transition_times=10**6)


def test_the_limit_on_the_command_line(tmp_path):
    import json
    import subprocess
    import sys

    command = [sys.executable, "-m", "hsdsl", "run", str(OSCILLATOR), "--step", "1e-12", "--json", "--out", "run.csv"]
    done = subprocess.run([*command, "--limit", "memory=1e6"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 3 and json.loads(done.stdout)["stop"]["reason"] == "memory_limit"
    assert (tmp_path / "run.csv").stat().st_size > 10_000


@needs_compiler
def test_transitions_of_a_long_run_are_a_sequence_made_where_it_is_looked_at(monkeypatch):
    monkeypatch.setattr(records, "BLOCK", 3)
    monkeypatch.setattr(records, "MOST_BLOCKS", 2)
    thermostat = hsdsl.load(MODELS / "thermostat.yaml")
    made = thermostat.simulate(until=100, engine="c").transitions
    exact = thermostat.simulate(until=100, engine="python").transitions
    assert len(made) == len(exact) > 6 and made == exact and exact == made and made[-1] == exact[-1]
    assert made[2:7] == exact[2:7] and [each.index for each in made[::-1]] == [*range(len(made))][::-1]
    assert made != exact[:-1] and pickle.loads(pickle.dumps(made)) == exact and (*made[:1], *made[1:]) == exact
    with pytest.raises(IndexError):
        made[len(made)]


@needs_compiler
@pytest.mark.parametrize("name", ["thermostat", "pronking-runner", "bouncing-ball"])
def test_chunks_gathered_are_the_columns_of_one_chunk(name, monkeypatch):
    monkeypatch.setattr(output_buffers, "MOST_KEPT", 0)
    whole = hsdsl.load(MODELS / f"{name}.yaml").simulate(engine="c")
    monkeypatch.setattr(output_buffers, "LEAST_ROWS", 16)
    parts = hsdsl.load(MODELS / f"{name}.yaml").simulate(engine="c")
    assert parts == whole and parts.transitions == whole.transitions


@needs_compiler
def test_transitions_at_one_instant_take_no_memory_for_steps_between_them():
    model = WIDE.replace("}}}\n", "}, transitions: [{when: x0 <= 0, to: m, reset: {x0: x0 + 1}}]}}\n").replace(
        "x0: 0", "x0: -4000"
    )
    run = hsdsl.loads(model, limits=Limits(memory=20_000_000)).simulate(step=0.25, method="taylor", max_transitions=1e6)
    assert run.stop.reason == "until" and len(run.transitions) == 4000
    assert run.values[-1, 0] == 1 and not run.coefficients[:4000].any() and run.coefficients[4000:-1, 0].all()
