"""Values of an execution at any time, its rows, and what it refuses to be."""

from __future__ import annotations

import copy
import math
import pickle
import sys
from dataclasses import replace

import hand_made
import numpy as np
import pytest
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Stop

FIFTY = decimals.context_of(50)

# t, side, mode, j, kind, state
AT = [
    (0.0, "right", "a", 0, "flow", {"x": 0.0, "y": 10.0}),
    (0.0, "left", "a", 0, "flow", {"x": 0.0, "y": 10.0}),
    (0.25, "right", "a", 0, "flow", {"x": 0.25, "y": 9.75}),
    (1.0, "left", "a", 0, "flow", {"x": 1.0, "y": 9.0}),
    (1.0, "right", "a", 3, "flow", {"x": 7.0, "y": 8.0}),
    (2.0, "left", "a", 3, "flow", {"x": 8.0, "y": 7.0}),
    (3.0, "left", "a", 3, "flow", {"x": 9.0, "y": 6.0}),
    (3.0, "right", "end", 4, "flow", {"y": 6.0, "w": -1.0}),
]


@pytest.mark.parametrize(("t", "side", "mode", "jump", "kind", "state"), AT)
def test_value_at_a_time(t, side, mode, jump, kind, state):
    point = hand_made.modes_of_different_size()(t, side)
    assert (point.time, point.mode, point.jump, point.kind, point.state) == (t, mode, jump, kind, state)


@pytest.mark.parametrize(
    ("t", "kind", "jump", "h", "v"),
    [
        (1.5, "flow", 0, 0.875, -1.5),
        (2.0, "strip", 0, 0.0, -2.0),
        (2.0625, "strip", 0, 0.0, -2.0),
        (2.125, "flow", 1, 0.0, 1.0),
        (2.375, "flow", 1, 0.21875, 0.75),
    ],
)
def test_flight_follows_its_parabola_and_a_strip_waits(t, kind, jump, h, v):
    point = hand_made.bouncing_ball(wait=0.125)(t)
    assert (point.kind, point.jump, point["h"], point["v"]) == (kind, jump, h, v)


def test_left_of_a_strip_is_the_flow_that_reached_it():
    ball = hand_made.bouncing_ball(wait=0.125)
    assert ball(2.0, "left").kind == "flow"
    assert ball(2.125, "left").kind == "strip"


@pytest.mark.parametrize("t", [-1e-9, 2.1, float("nan"), float("inf")])
def test_a_time_outside_is_refused_with_the_span(t):
    with pytest.raises(ValueError, match="outside the run, which goes from 0 to 2"):
        hand_made.jumping_input()(t)


def test_the_tie_tolerance_reaches_the_ends():
    run = hand_made.jumping_input()
    assert run(2.0 + 1e-12)["x"] == 0.0
    assert run(-1e-13)["x"] == 0.0


def test_an_unknown_side_is_refused():
    with pytest.raises(ValueError, match="'right' or 'left'"):
        hand_made.jumping_input()(1.0, "up")


def test_outputs_between_rows_come_from_the_function_and_without_one_from_the_line():
    ball = replace(hand_made.bouncing_ball(pieces=1), output_function=None)
    assert ball.output_names == ("energy",)
    line = replace(ball, outputs=ball.times[:, None] ** 2)
    assert line(0.5)["energy"] == 0.5 * 2.0  # the line from (0, 0) to (2, 4)
    calls = []

    def energy(mode, t, state):
        calls.append((mode, t, state))
        return (state[0] + state[1] ** 2 / 2,)

    assert replace(line, output_function=energy)(0.5)["energy"] == 2.0
    assert calls == [("fly", 0.5, (1.875, -0.5))]
    assert replace(line, output_function=energy)(2.0, "left")["energy"] == 4.0  # recorded: the function is not called


def test_an_output_without_a_value_is_not_a_number():
    def root(mode, t, state):
        return (math.sqrt(state[1]),)

    ball = replace(hand_made.bouncing_ball(), output_function=root)
    assert math.isnan(ball(0.5)["energy"])


def test_samples_are_points_in_any_order():
    run = hand_made.modes_of_different_size()
    times = [3.0, 0.0, 1.0, 2.5, 0.5, 1.0]
    samples = run.sample(times)
    assert samples.time.tolist() == times
    for i, t in enumerate(times):
        point = run(t)
        assert (samples.mode[i], samples.jump[i], samples.kind[i]) == (point.mode, point.jump, point.kind)
        for name in run.states:
            expected = point.state.get(name, float("nan"))
            assert samples[name][i] == expected or (np.isnan(samples[name][i]) and np.isnan(expected))
            assert samples.present[i, run.states.index(name)] == (name in point.state)
    assert samples.states == ("x", "y", "z", "w")
    assert samples.outputs == ("double",)
    assert len(run.sample([])) == 0
    with pytest.raises(KeyError, match="no state or output is called q; there are x, y, z, w, double"):
        samples["q"]


def test_samples_from_the_left():
    samples = hand_made.modes_of_different_size().sample([1.0, 3.0], side="left")
    assert samples["x"].tolist() == [1.0, 9.0]
    assert samples.jump.tolist() == [0, 3]


def test_fifty_digits_stay_fifty_digits():
    ball = hand_made.bouncing_ball(convert=FIFTY.mpf, digits=50, restitution="0.8")
    third = FIFTY.mpf(1) / 3
    point = ball(third)
    assert abs(point["h"] - (2 - third**2 / 2)) < FIFTY.mpf(10) ** -49
    assert abs(point["h"] - FIFTY.mpf("1.9444444444444444444444444444444444444444444444444444")) < FIFTY.mpf(10) ** -49
    assert ball.sample([0.5, third])["h"][0] == 1.875
    assert ball(0.5).state == {"h": 1.875, "v": -0.5}


def test_rows_are_two_at_a_jump_and_repeat_nothing():
    rows = hand_made.bouncing_ball(bounces=1, wait=0.125, pieces=1).rows()
    seen = list(zip(rows.time.tolist(), rows.jump.tolist(), rows["h"].tolist(), rows["v"].tolist(), strict=True))
    assert seen == [
        (0.0, 0, 2.0, 0.0),
        (2.0, 0, 0.0, -2.0),  # the guard is reached: end of the flight and beginning of the strip
        (2.03125, 0, 0.0, -2.0),
        (2.125, 0, 0.0, -2.0),
        (2.125, 1, 0.0, 1.0),
        (4.125, 1, 0.0, -1.0),
    ]


def test_a_jump_of_an_input_shows_in_the_outputs():
    rows = hand_made.jumping_input().rows()
    assert rows.time.tolist() == [0.0, 1.0, 1.0, 2.0]
    assert rows["u"].tolist() == [1.0, 1.0, -1.0, -1.0]


def test_to_pandas():
    frame = hand_made.modes_of_different_size().to_pandas()
    assert list(frame.columns) == ["time", "mode", "j", "x", "y", "z", "w", "double"]
    assert frame["j"].tolist() == [0, 0, 1, 2, 3, 3, 4]
    assert frame["z"].dropna().tolist() == [5.0, 6.0]


def test_without_pandas_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(UsageError, match=r"pip install 'hsdsl\[table\]'"):
        hand_made.jumping_input().to_pandas()


@pytest.mark.parametrize("make", hand_made.EVERY)
def test_equal_when_made_again(make):
    assert make() == make()
    assert replace(make(), output_function=lambda mode, t, state: ()) == make()


CHANGES = {
    "method": lambda run: {"method": "euler"},
    "stop": lambda run: {"stop": Stop("zeno", run.stop.time, run.stop.message)},
    "settings": lambda run: {"settings": run.settings | {"step": 2e-3}},
    "setting left out": lambda run: {"settings": {"until": run.settings["until"]}},
    "transition": lambda run: {"transitions": (*run.transitions[:-1], replace(run.transitions[-1], edge="other"))},
    "value": lambda run: {"values": np.where(run.values == 7.0, 7.0000000000000009, run.values)},
    "nan": lambda run: {"values": np.where(run.values == 7.0, np.nan, run.values)},
    "arc": lambda run: {"arcs": (replace(run.arcs[0], mode="other"), *run.arcs[1:])},
    "coefficients": lambda run: {"coefficients": run.coefficients[:, :0]},
    "number type": lambda run: {"times": run.times.astype(object)},
}


@pytest.mark.parametrize("change", CHANGES)
def test_not_equal_when_anything_differs(change):
    run = hand_made.modes_of_different_size()
    assert replace(run, **CHANGES[change](run)) != run


def test_not_equal_to_something_else():
    assert hand_made.jumping_input() != "a run"


BROKEN = {
    "columns differ in length": lambda run: {"depth": run.depth[:-1]},
    "unknown stop reason": lambda run: {"stop": Stop("bored", 0.0, "")},
    "arcs must cover the rows": lambda run: {"arcs": run.arcs[:-1]},
    "arcs must follow each other": lambda run: {"arcs": (run.arcs[0], replace(run.arcs[1], first=3))},
    "time must not run backwards": lambda run: {"times": run.times[::-1]},
    "an arc must begin at the time": lambda run: {"times": run.times + np.array([0, 0, 0.25, 0.5])},
}


@pytest.mark.parametrize("sentence", BROKEN)
def test_data_that_is_no_execution_is_refused(sentence):
    run = hand_made.jumping_input()
    with pytest.raises(ValueError, match=sentence):
        replace(run, **BROKEN[sentence](run))


def test_repr_says_what_happened():
    assert repr(hand_made.bouncing_ball(wait=0.125)) == (
        "<Execution of models/hand-made.yaml: relaxed midpoint, t = 0 to 6.25, 4 transitions, 9 arcs, 27 rows, "
        "stop: until>"
    )


def test_jupyter_shows_escaped_text():
    shown = replace(hand_made.thermostat(30), title="<b>hot & cold</b>")._repr_html_()
    assert "&lt;b&gt;hot &amp; cold&lt;/b&gt;" in shown
    assert "18 more" in shown


@pytest.mark.parametrize("engine", ["auto", "python"])
def test_a_copy_or_a_pickle_is_the_execution(engine):
    run = hsdsl.load(MODELS / "pronking-runner.yaml").simulate(engine=engine)
    for other in (copy.deepcopy(run), pickle.loads(pickle.dumps(run))):
        assert other == run and other.verdict == run.verdict
        assert other(0.3).state == run(0.3).state


def test_one_time_is_one_time():
    run = hsdsl.load(MODELS / "bouncing-ball.yaml").simulate(1)
    for times in ([0.5, 1], []):
        with pytest.raises(ValueError, match="sample"):
            run(times)
