"""Ensembles: every instance is what a single run gives, whoever runs it."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest
from engines import ENGINES, needs_compiler
from shipped import MODELS, shipped

import hsdsl
from hsdsl.analysis.plot.ensembles import Spread
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers.arithmetic import FLOAT64
from hsdsl.engine.execution.records import same
from hsdsl.engine.preparation.experiment import initial_state
from hsdsl.engine.preparation.values import with_parameters
from hsdsl.engine.simulate import output_buffers
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"
FAST = {"method": "dopri5", "tolerance": 1e-6, "until": 12}


def model(text: str) -> Model:
    return Model(elaborate("model.yaml", text=text.encode()))


def assert_as_single_runs(ensemble):
    """Compare everything that is kept with runs one by one."""
    for place in np.ndindex(ensemble.shape):
        run = ensemble.run(*place)
        assert (run.stop.reason, run.final.mode) == (ensemble.stop[place], ensemble.mode[place])
        assert run.times[-1] == ensemble.time[place] and len(run.transitions) == ensemble.transitions[place]
        for kept, own in ((ensemble.state, run.final.state), (ensemble.outputs, run.final.outputs)):
            assert all(same(float(kept[name][place]), own.get(name, float("nan"))) for name in kept), place
        found = ensemble.transition_times[place]
        times = [t.time for t in run.transitions[: len(found)]]
        assert found[: len(times)].tolist() == times and np.isnan(found[len(times) :]).all()
        given = ensemble.sample_times[place]
        inside = given <= run.times[-1] + 1e-12 * max(1, run.times[-1])
        samples = run.sample(given[inside])
        for name, column in ensemble.samples.items():
            assert np.isnan(column[place][~inside]).all()
            if name in samples.names:
                assert same(column[place][inside], np.array(samples[name])), (place, name)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scheme", ["relaxed", "located"])
def test_instances_are_single_runs(engine, scheme):
    ensemble = hsdsl.load(OSCILLATOR).ensemble(
        parameters={"c": [0.3, 0.6, 0.9], "a": "1/20"},
        initial={"v": np.array([[31.4], [20.0]])},
        samples=40,
        transition_times=6,
        **FAST,
        scheme=scheme,
        engine=engine,
    )
    assert ensemble.shape == (2, 3) and ensemble.engine == engine and not ensemble.failed.any()
    assert ensemble.varied["c"].tolist() == [[0.3, 0.6, 0.9]] * 2 and ensemble.failures() == ()
    assert_as_single_runs(ensemble)


def varied_by_the_first_name(model):
    """The first parameter, or the first state of a start where there is none, with three values near its own."""
    values = with_parameters(model.pipeline.values(FLOAT64), {})
    names, numbers, group = model.program.parameters, values.parameters, "parameters"
    if not names:
        (_, names, numbers), group = initial_state(values, {}), "initial"
    return {group: {names[0]: numbers[0] + np.array([0, 1e-3, -2e-3])}}


@needs_compiler
@pytest.mark.parametrize("name", sorted(path.stem for path in MODELS.glob("*.yaml")))
@pytest.mark.parametrize("how", [{}, {"method": "dopri5", "tolerance": 1e-7}, {"method": "rk4", "step": 1e-2}])
def test_instances_of_every_model_are_single_runs(name, how):
    model = shipped(name)
    stiff = name == "stiff-switch" and how.get("method") == "dopri5"  # of which it takes millions of steps
    until = 1e-3 if stiff else 2 * model.simulate(max_transitions=2, **how).times[-1]
    assert_as_single_runs(model.ensemble(**varied_by_the_first_name(model), until=until, samples=5, **how))


FUNCTIONS = """
hsdsl: 1
parameters:
  a: 1
  w: 3
  curved: {value: sinh(w/3) + tanh(a)**0.3 - asinh(w)*cos(a), min: w - 100}
  whole: max(floor(3*a), sign(w - 2)) - abs(min(a, w))/3
inputs: {u: {times: [0, 0.3, 1.1], values: [0, 2, 0], hold: linear}}
modes:
  one:
    flow: {x: 1 + a + u/10 + sign(sin(3*t)), y: -a*y + abs(cos(t/5))}
    transitions: [{when: x >= curved, to: one, reset: {x: curved - a}}]
initial: {mode: one, x: y/5 - 2, y: exp(w) + whole}
experiment: {until: 3}
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("how", [{}, {"until": "a + abs(w)/5"}, {"initial": {"y": np.linspace(0, 2, 9)}}])
def test_numbers_of_columns_are_those_of_single_runs(engine, how):
    several = model(FUNCTIONS)
    given = {"a": np.geomspace(0.1, 9, 9), "w": np.linspace(-4, 4, 9)}
    assert_as_single_runs(several.ensemble(parameters=given, engine=engine, tolerance=1e-6, **how))


MODES = """
hsdsl: 1
parameters: {a: 1, twice: {value: 2*a, max: 12}, stop: {value: 1/a}}
inputs: {u: {times: [0, 0.3, 1], values: [0, 1, 0], hold: linear}}
modes:
  one:
    flow: {x: a + u/10}
    transitions: [{when: x >= 1, to: two, reset: {y: x, z: 0}}]
  two:
    flow: {y: -y, z: 1/(z - 5 + stop)}
    transitions: [{when: y <= 1/2, to: one, reset: {x: y - 1}}, {when: z >= 3/2, to: over}]
  over: {final: true}
outputs: {energy: a*t}
initial: {mode: one, x: 0}
experiment: {until: 3*a, relaxation: 1e-6}
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_modes_of_several_sizes_inputs_and_failures(engine):
    several, a = model(MODES), [0.25, 0.5, 1, 2, 4, 0, 7, float("nan"), -1]
    ensemble = several.ensemble(parameters={"a": a}, samples=[0.0, 0.1, 0.7, 2.0, 6.5], engine=engine, tolerance=1e-6)
    assert ensemble.reasons["refused"] == 4 and ensemble.stop[:5].tolist().count("refused") == 0
    refused = {failure.index: failure.message for failure in ensemble.failures() if failure.reason == "refused"}
    assert refused[5,] == "parameter stop has no finite value with these parameters"
    assert refused[6,] == "parameter twice = 14 is beyond its maximum 12"
    assert "has no finite value" in refused[7,] and "until" in refused[8,]
    first = several.ensemble(initial={"x": [float("nan"), 0]}, engine=engine, tolerance=1e-6)
    assert first.stop.tolist() == ["refused", "until"] and "initial.x: nan" in first.failures()[0].message
    assert np.isnan(ensemble.time[5:]).all() and set(ensemble.mode[5:]) == {""}
    kept = several.ensemble(parameters={"a": a[:5]}, samples=[0.0, 0.1, 0.7, 2.0, 6.5], engine=engine, tolerance=1e-6)
    assert_as_single_runs(kept)
    assert all(same(kept.state[name], ensemble.state[name][:5]) for name in kept.state)


@needs_compiler
def test_small_chunks_give_the_same(monkeypatch):
    monkeypatch.setattr(output_buffers, "LEAST_ROWS", 16)
    for loaded in (hsdsl.load(OSCILLATOR), model(MODES)):
        name = "a" if "a" in loaded.program.parameters and "c" not in loaded.program.parameters else "c"
        values = np.linspace(0.3, 0.9, 5)
        assert_as_single_runs(
            loaded.ensemble(parameters={name: values}, samples=50, transition_times=3, tolerance=1e-7, engine="c")
        )


@needs_compiler
def test_engines_and_numbers_of_threads_agree():
    arguments = {"parameters": {"c": np.linspace(0.3, 0.9, 70)}, "samples": 5, **FAST, "until": 3}
    runs = [hsdsl.load(OSCILLATOR).ensemble(**arguments, engine="c", threads=threads) for threads in (1, 3)]
    runs.append(hsdsl.load(OSCILLATOR).ensemble(**arguments, engine="python"))
    for run in runs[1:]:
        assert (run.stop == runs[0].stop).all() and (run.transitions == runs[0].transitions).all()
        assert all((run.samples[name] == runs[0].samples[name]).all() for name in ("x", "v"))


@needs_compiler
def test_control_c_keeps_what_is_done_and_progress_is_told():
    answer = []

    def progress(done, count):
        answer.append((done, count))
        if done:
            os.kill(os.getpid(), signal.SIGINT)

    ensemble = hsdsl.load(OSCILLATOR).ensemble(
        parameters={"c": np.linspace(0.3, 0.9, 400)}, method="rk4", step=1e-4, threads=1, progress=progress, engine="c"
    )
    assert ensemble.reasons["interrupted"] > 0 and answer[0][1] == 400 and threading.active_count() < 5
    done = int(np.argmax(ensemble.stop == "interrupted"))
    assert (ensemble.stop[:done] == "until").all() and np.isnan(ensemble.time[done:]).all()
    assert "interrupted" in ensemble.failures(1)[0].message
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_cannot_be_served_is_refused():
    oscillator = hsdsl.load(OSCILLATOR)
    for arguments, sentence in (
        ({"parameters": {"c": [1, 2], "a": [1, 2, 3]}}, "no common shape"),
        ({"parameters": {"d": [1, 2]}}, "the model has no parameter 'd'"),
        ({"initial": {"w": [1, 2]}}, "mode free has no state 'w'"),
        ({"parameters": {"c": ["x", "y"]}}, "or an array of numbers"),
        ({"parameters": {"c": [float("nan")]}}, "no instance of the ensemble can be run"),
        ({"samples": 1}, "samples of an ensemble"),
        ({"steps": 1}, "an ensemble has no argument 'steps'"),
        ({"threads": 0}, "threads must be at least 1"),
        ({"parameters": {"a": [1, 2]}, "step": "a"}, "step differs between the instances"),
    ):
        with pytest.raises(UsageError, match=sentence):
            oscillator.ensemble(**arguments)
    with pytest.raises(UsageError) as lengths:
        oscillator.ensemble(parameters={"c": [0.7] * 4, "a": [0.1] * 3})
    assert lengths.value.hint == "for every combination give columns and rows: c as array[:, None]"
    with pytest.raises(IndexError, match="expected an index of an ensemble of shape"):
        oscillator.ensemble(parameters={"c": [0.5, 0.6]}, **FAST).run(2)


def test_bands_of_an_ensemble_hold_their_shares():
    """The quantiles of 0, 1, ..., 100 are these numbers; a run that has ended has none."""
    values = np.column_stack(
        [np.arange(101.0), np.where(np.arange(101) < 51, np.arange(101.0), np.nan), [np.nan] * 101]
    )
    spread = Spread.of(values, [0.5, 0.9])
    assert spread.median[:2].tolist() == [50, 25] and np.isnan(spread.median[2])
    assert [*spread.bands] == [0.9, 0.5]
    assert [float(side[0]) for side in spread.bands[0.9]] == pytest.approx([5, 95])
    assert [float(side[1]) for side in spread.bands[0.5]] == pytest.approx([12.5, 37.5])


def test_an_ensemble_is_drawn_or_refused(tmp_path):
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    found = model.ensemble(initial={"h": np.linspace(1, 2, 6).reshape(2, 3)}, samples=20, until=1)
    found.plot(tmp_path / "p.svg", ["v"], shares=[0.8])
    assert (tmp_path / "p.svg").stat().st_size > 1000
    uneven = model.ensemble(parameters={"e": [0.5, 0.8]}, samples=20, until="e")
    for ensemble, options, sentence in (
        (model.ensemble(until=1), {}, "has no samples"),
        (found, {"columns": ["w"]}, "no state or output is called w"),
        (found, {"shares": [1]}, "between 0 and 1, got 1"),
        (uneven, {}, "the sample times of the instances differ"),
    ):
        with pytest.raises(UsageError, match=sentence):
            ensemble.plot(tmp_path / "q.svg", **options)


def test_nothing_varied_is_one_run():
    ensemble = hsdsl.load(OSCILLATOR).ensemble(**FAST)
    assert ensemble.shape == () and ensemble.run().final.state["x"] == float(ensemble.state["x"])
    assert "shape ()" in repr(ensemble)


def test_instances_of_short_runs_have_their_own_default_relaxation():
    ensemble = hsdsl.load(OSCILLATOR).ensemble(parameters={"c": [0.5, 0.6]}, until=0.5, scheme="relaxed")
    assert_as_single_runs(ensemble)


@pytest.mark.parametrize("engine", ENGINES)
def test_every_transition_is_kept_with_the_states_around_it(engine, monkeypatch):
    monkeypatch.setattr("hsdsl.engine.simulate.ensemble.LOG_ROOM", 2)
    several = model(MODES)
    ensemble = several.ensemble(
        parameters={"a": [0.5, 0, 2, 4]}, every_transition=True, engine=engine, tolerance=1e-6, scheme="relaxed"
    )
    table = ensemble.transition_table
    assert table.first.tolist() == [0, *np.cumsum(ensemble.transitions)] and ensemble.transitions[2] > 2
    for k in (0, 2, 3):
        made, here = ensemble.run(k).transitions, table.of(k)
        assert table.time[here].tolist() == [t.time for t in made]
        assert table.edge[here].tolist() == [t.edge for t in made]
        assert table.entry[here].tolist() == [t.entry for t in made]
        for kept, own in ((table.before, [t.before for t in made]), (table.after, [t.after or {} for t in made])):
            for name, column in kept.items():
                assert same(column[here], np.array([state.get(name, float("nan")) for state in own])), (k, name)


@pytest.mark.parametrize("engine", ENGINES)
def test_samples_at_multiples_of_an_expression(engine):
    ensemble = model(MODES).ensemble(parameters={"a": [1, 0, 0.25]}, samples="a/3", engine=engine, tolerance=1e-6)
    assert ensemble.sample_times.shape == (3, 10)
    assert same(ensemble.sample_times[2], np.minimum(np.arange(10) * (0.25 / 3), 0.75))
    assert np.isnan(ensemble.sample_times[1]).all()
    one = model(MODES).ensemble(parameters={"a": [0.25]}, samples=ensemble.sample_times[2], tolerance=1e-6)
    assert same(ensemble.samples["energy"][2], one.samples["energy"][0])
    with pytest.raises(UsageError, match="must be positive, not -1"):
        model(MODES).ensemble(parameters={"a": [1]}, samples="-a")


@pytest.mark.parametrize("engine", ENGINES)
def test_runs_at_the_centre_of_initial_ranges_say_so(engine):
    text = "hsdsl: 1\nmodes: {a: {flow: {x: 1}}}\ninitial: {mode: a, x: {min: 0, max: 4}}\nexperiment: {until: 1}"
    box = hsdsl.loads(text)
    assert box.ensemble(engine=engine).warning_counts == {"HS707": 1}
    assert box.ensemble(initial={"x": [1, 2]}, engine=engine).warning_counts == {}


def test_pictures_of_ensembles_have_units_and_say_of_which_runs_bands_are(tmp_path):
    text = "hsdsl: 1\nunits: {t: s, x: m}\nmodes:\n  b: {flow: {y: 1}}\n"
    text += "  a: {flow: {x: 1}, transitions: [{when: x >= 1, to: b, reset: {y: 0}}]}\n"
    both = hsdsl.loads(f"{text}initial: {{mode: a, x: 0}}\nexperiment: {{until: 2}}")
    both.ensemble(initial={"x": [0, 0.5]}, samples=9).plot(tmp_path / "p.svg", ["x"])
    both.ensemble(initial={"x": [0, 0.5]}, samples=[0, 0.25]).plot(tmp_path / "q.svg", ["x"])
    drawn, whole = ((tmp_path / f"{name}.svg").read_text() for name in "pq")
    for words in ("x [m]", "time t [s]"):
        assert f"<!-- {words} -->" in drawn
    assert "<!-- 50 % of the runs that have it -->" in drawn and "<!-- 50 % of the runs -->" in whole
