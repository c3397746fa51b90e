"""Values for all instances of a `count`, `leg.k`, and for one of them, `leg[3].k`."""

from __future__ import annotations

import numpy as np
import pytest

import hsdsl
from hsdsl import UsageError
from hsdsl.analysis.report.summary import summary
from hsdsl.export import source_of

TEXT = """
hsdsl: 1
automata:
  lamp:
    parameters: {rate: 1, twice: 2*rate}
    modes:
      off: {flow: {x: twice}, transitions: [{when: x >= 1, to: on, reset: {x: 0}}]}
      on: {flow: {x: rate}}
system:
  clock: {automaton: lamp, initial: {mode: off, x: -9}}
  lamp: {automaton: lamp, count: 3, initial: {mode: off, x: 0}}
outputs: {whole: sum(lamp.x)}
experiment: {until: 1/8}
"""


@pytest.fixture(scope="module")
def model():
    return hsdsl.loads(TEXT)


def ends(run):
    return [run.final.state[f"lamp[{k}].x"] for k in (1, 2, 3)]


@pytest.mark.parametrize("order", [1, -1])
def test_one_instance_counts_more_than_all_in_any_order(model, order):
    given = dict([("lamp.rate", 2), ("lamp[2].rate", 1)][::order])
    run = model.simulate(parameters=given)
    assert ends(run) == pytest.approx([0.5, 0.25, 0.5]) and run.final.state["clock.x"] == pytest.approx(-8.75)


def test_initial_values_and_modes_of_all(model):
    run = model.simulate(initial={"lamp.x": "1/2", "lamp[3].x": 0, "lamp.mode": "on", "lamp[1].mode": "off"})
    assert ends(run) == pytest.approx([0.75, 0.625, 0.125])
    assert run.final.mode == "clock=off lamp[1]=off lamp[2]=on lamp[3]=on"


def test_ensembles_vary_all_and_start_in_modes(model):
    rates = np.array([0.5, 1])
    found = model.ensemble(parameters={"lamp.rate": rates}, initial={"lamp.mode": "on", "lamp[2].x": [1, 2]})
    single = [model.simulate(parameters={"lamp.rate": r}, initial={"lamp.mode": "on", "lamp[2].x": x})
              for r, x in ((0.5, 1), (1, 2))]  # fmt: skip
    for name in ("lamp[1].x", "lamp[2].x", "lamp[3].x", "clock.x"):
        assert found.state[name].tolist() == [run.final.state[name] for run in single]


def test_sweeps_vary_all(model, tmp_path):
    pytest.importorskip("pyarrow")
    sweep = model.sweep(["lamp.rate=1:2:3", "initial.lamp.x=0,1/4"], tmp_path, parameters={"lamp[3].rate": 0})
    table = sweep.table().to_pydict()
    assert table["lamp.rate"] == [1, 1, 1.5, 1.5, 2, 2]
    expected = [rate / 4 + x for rate, x in zip(table["lamp.rate"], table["initial.lamp.x"], strict=True)]
    assert table["final.lamp[1].x"] == pytest.approx(expected)
    assert table["final.lamp[3].x"] == pytest.approx(table["initial.lamp.x"])


def test_the_summary_groups_them(model):
    whole = summary(model.simulate(parameters={"lamp.rate": 2}, initial={"lamp.mode": "on"}))
    assert "with lamp.rate of 3 instances = 2, initial.lamp.mode of 3 instances = on\n" in whole
    assert "with lamp[2].rate = 3\n" in summary(model.simulate(parameters={"lamp[2].rate": 3}))


WRONG = [
    ({"parameters": {"lamp.rat": 1}}, "no parameter 'lamp.rat'", "did you mean 'lamp.rate'?"),
    ({"parameters": {"lamp[7].rate": 1}}, "no", "known here: lamp[1].rate to lamp[3].rate, and lamp.rate for all"),
    ({"parameters": {"lamp.x": 1}}, "no parameter", "write initial.lamp.x"),
    ({"initial": {"lamp.y": 1}}, "the model has no state 'lamp.y'", "did you mean 'lamp.x'?"),
    ({"initial": {"lamp[4].x": 1}}, "no state", "known here: lamp[1].x to lamp[3].x, and lamp.x for all"),
    ({"initial": {"lamp.mod": "on"}}, "no state", "did you mean 'lamp.mode'?"),
    ({"initial": {"lamp.mode": "onn"}}, r"lamp\[1\] has no mode 'onn'", "did you mean 'on'?"),
]  # fmt: skip


@pytest.mark.parametrize(("given", "message", "hint"), WRONG)
def test_wrong_names_are_refused_with_what_was_meant(model, given, message, hint):
    with pytest.raises(UsageError, match=message) as caught:
        model.simulate(**given)
    assert caught.value.hint == hint


def sized(text, **arguments):
    return source_of(hsdsl.loads(text), arguments).problem.settings.scale


def test_sizes_of_all():
    sizes = {"lamp[1].x": 3, "lamp[2].x": 1 / 4, "lamp[3].x": 3}
    both = TEXT.replace("1/8}", "1/8, scale: {'lamp[2].x': 1/4, lamp.x: 3}}")
    whole = TEXT.replace("1/8}", "1/8, scale: {lamp.x: 9}}")
    assert sized(both) == sized(whole, scale=sizes) == sized(TEXT, scale={"lamp.x": 3, "lamp[2].x": 1 / 4}) == sizes
    assert sized(TEXT, settings={"scale.lamp[2].x": "1/4", "scale.lamp.x": "3"}) == sizes
    assert sized(whole, scale={"lamp[2].x": 1}) == {"lamp[1].x": 9, "lamp[2].x": 1, "lamp[3].x": 9}


def test_sizes_of_unknown_states_are_refused(model):
    with pytest.raises(UsageError, match=r"no state 'lamp\.y'") as caught:
        model.simulate(scale={"lamp.y": 3})
    assert caught.value.hint == "did you mean 'lamp.x'?"
    with pytest.raises(hsdsl.ModelError, match=r"no state 'lamp\.y'"):
        hsdsl.loads(TEXT.replace("1/8}", "1/8, scale: {lamp.y: 9}}"))


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("lamp.rate", "name one instance: lamp[1].rate, lamp[2].rate, lamp[3].rate"),
        ("initial.lamp.x", "name one instance: initial.lamp[1].x, initial.lamp[2].x, initial.lamp[3].x"),
        ("clock.rat", "did you mean 'clock.rate'?"),
    ],
)
def test_derivatives_and_fits_are_by_one_instance(model, name, hint):
    for call in (lambda: model.sensitivity(name), lambda: model.fit({"time": [0.1, 0.2], "clock.x": [1.0, 2.0]}, name)):
        with pytest.raises(UsageError, match="no parameter or initial state") as caught:
            call()
        assert caught.value.hint == hint
