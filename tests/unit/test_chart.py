"""Charts: errors against exact executions, what counts as wrong, turns, peers, and the table."""

from __future__ import annotations

import csv
from functools import partial
from importlib.util import find_spec
from math import isnan
from pathlib import Path

import numpy as np
import pytest

import hsdsl
from hsdsl.chart import PEERS, Refused, Scene, work_precision
from hsdsl.chart.judge import judge
from hsdsl.chart.peers import prepare
from hsdsl.chart.result import Attempt, Result
from hsdsl.chart.rows import COLUMNS, as_csv
from hsdsl.chart.stopwatch import race

MODELS = Path(hsdsl.__file__).parent.parent / "models"
PACKAGES = {"sksundae": "sksundae", "casadi": "casadi", "heyoka": "heyoka", "diffrax": "diffrax", "scipy": "scipy"}
SHEDDING = """
hsdsl: 1
modes:
  heavy:
    flow: {x: -x, y: 1}
    transitions: [{when: y >= 1, to: light}]
  light:
    flow: {x: -2*x}
initial: {mode: heavy, x: 1, y: 0}
experiment: {until: 2}
"""


@pytest.fixture(scope="module")
def ball():
    return Scene.of(hsdsl.load(MODELS / "bouncing-ball.yaml"), samples=500)


def exactly(scene, **changed):
    """The exact execution as a result."""
    given = {
        "values": scene.exact_values.copy(),
        "modes": scene.exact_modes.copy(),
        "transitions": len(scene.exact.transitions),
    }
    found = given | changed
    return Result(
        found["values"],
        lambda: found["modes"],
        lambda: found["transitions"],
        found.get("problem"),
        found.get("execution"),
    )


def test_the_exact_execution_is_right_and_without_error(ball):
    judgement = judge(ball, exactly(ball))
    assert (judgement.verdict, judgement.error) == ("right", 0)


def test_the_error_is_the_largest_difference_away_from_jumps(ball):
    values = ball.exact_values.copy()
    clear = np.flatnonzero(ball.clear)[7]
    near = np.flatnonzero(~ball.clear)[0]
    values[clear, 1] += 0.25
    values[near, 0] += 100
    assert judge(ball, exactly(ball, values=values)).error == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("changed", "verdict", "why"),
    [
        ({"transitions": 11}, "wrong", "11 transitions instead of 12"),
        ({"transitions": 13}, "wrong", "13 transitions instead of 12"),
        ({"transitions": None}, "right", ""),
        ({"problem": "gave up"}, "failed", "gave up"),
    ],
)
def test_another_execution_is_wrong_however_small_its_error(ball, changed, verdict, why):
    judgement = judge(ball, exactly(ball, **changed))
    assert (judgement.verdict, judgement.why) == (verdict, why)


def test_an_error_of_the_size_of_the_states_is_wrong(ball):
    span = ball.exact_values.max() - ball.exact_values.min()
    assert judge(ball, exactly(ball, values=ball.exact_values + 0.2 * span)).verdict == "wrong"
    assert judge(ball, exactly(ball, values=ball.exact_values + 0.05 * span)).verdict == "right"


def test_another_mode_is_wrong():
    scene = Scene.of(hsdsl.load(MODELS / "digital-control.yaml"), samples=100)
    modes = scene.exact_modes.copy()
    modes[modes == "D3"] = "D0"
    assert judge(scene, exactly(scene, modes=modes)).why.startswith("another mode at")


def test_past_a_zeno_point_transitions_are_not_counted():
    scene = Scene.of(hsdsl.load(MODELS / "oscillator-with-stop-2.yaml"), samples=100)
    assert judge(scene, exactly(scene, transitions=20_000)).verdict == "right"


def test_modes_with_other_states_compare_what_both_have():
    model = hsdsl.loads(SHEDDING)
    scene = Scene.of(model, samples=101)
    assert scene.states == ("x", "y")
    rows, _ = work_precision(
        scene, schemes=["relaxed"], methods=["dopri5"], engines=["python"], tolerances=[1e-6, 1e-9], rounds=1
    )
    assert [row.judgement.verdict for row in rows] == ["right", "right"]
    assert rows[1].judgement.error < 1e-7 < rows[0].judgement.error


def test_errors_fall_with_the_tolerance_and_rho_bounds_them(ball):
    rows, remarks = work_precision(
        ball, schemes=["relaxed"], methods=["dopri5", "rk4"], engines=["python"], tolerances=[1e-4, 1e-8], steps=[1e-2]
    )
    assert not remarks
    loose, tight = (row for row in rows if row.attempt.method == "dopri5")
    assert tight.judgement.error < 1e-2 * loose.judgement.error
    for row in rows:
        assert row.judgement.verdict == "right"
        assert row.judgement.rho.upper >= row.judgement.error / np.sqrt(2)
        assert row.seconds > 0


def test_what_cannot_run_is_remarked(ball):
    _, remarks = work_precision(
        ball, schemes=["relaxed"], methods=["taylor"], engines=["c"], tolerances=[1e-6], rounds=1, with_rho=False
    )
    assert all(remark.startswith("relaxed taylor c: ") for remark in remarks)


def test_turns_alternate_and_the_slow_are_run_once():
    calls: list[str] = []

    def run(name):
        calls.append(name)
        return name

    clock = {"slow": 1.0}

    def slow(name):
        import time

        time.sleep(clock["slow"] * 0.05)
        return run(name)

    attempts = [
        Attempt("a", "", "", "step", 1.0, partial(slow, "a1")),
        Attempt("a", "", "", "step", 0.1, partial(slow, "a2")),
        Attempt("b", "", "", "step", 1.0, partial(run, "b1")),
    ]
    done = list(race(attempts, lambda _, result: result, 2, 0.04, lambda _: None))
    assert [attempt.tool for attempt, _, _ in done] == ["a", "b"]  # a2 left out: a1 was beyond patience
    assert calls.count("a1") == 1
    assert calls.count("b1") >= 3


def test_the_table_has_one_line_a_run(ball):
    rows, _ = work_precision(
        ball, methods=["midpoint"], engines=["python"], steps=[0.05], rounds=1, with_rho=False, schemes=["relaxed"]
    )
    (line,) = csv.DictReader(as_csv(rows).splitlines())
    assert tuple(line) == COLUMNS
    assert line["tool"] == "hsdsl python"
    assert float(line["error"]) == rows[0].judgement.error


CHOOSING = """
hsdsl: 1
modes:
  up:
    flow: {x: v, v: -1}
    transitions:
      - {name: bounce, when: x <= 0, if: v < -0.3, to: up, reset: {v: -v/2}}
      - {name: stay, when: x <= 0, if: v >= -0.3, to: down, reset: {v: 0}}
  down:
    flow: {x: 0, v: 0}
initial: {mode: up, x: 1, v: 0}
experiment: {until: 5}
"""


@pytest.mark.parametrize("name", ["scipy", "heyoka", "sksundae", "diffrax"])
def test_a_condition_decides_between_edges_of_one_guard(name):
    if not find_spec(PACKAGES[name]):
        pytest.skip(f"{name} is not installed")
    scene = Scene.of(hsdsl.loads(CHOOSING), samples=500)
    judgement = judge(scene, prepare(name, scene)(1e-10))
    assert (judgement.verdict, judgement.transitions) == ("right", 4)
    assert judgement.error < 1e-7


def test_sampled_inputs_are_refused():
    sampled = "inputs: {u: {times: [0, 2], values: [0, 1]}}\nmodes:"
    text = SHEDDING.replace("modes:", sampled).replace("y: 1}\n", "y: 1 + u}\n")
    with pytest.raises(Refused, match="sampled inputs"):
        prepare("scipy", Scene.of(hsdsl.loads(text), samples=50))


@pytest.mark.parametrize("name", PEERS)
def test_installed_peers_get_a_ball_right(ball, name):
    if find_spec(PACKAGES[name]) is None:
        with pytest.raises(Refused, match="not installed"):
            prepare(name, ball)
        return
    judgement = judge(ball, prepare(name, ball)(1e-9))
    assert judgement.verdict == "right", judgement
    assert judgement.error < 1e-5


def test_what_a_tool_raises_is_a_failed_result(ball, monkeypatch):
    from hsdsl.chart import peers

    def broken(_):
        raise RuntimeError("no convergence\nat step 3")

    monkeypatch.setattr("hsdsl.chart.peers.scipy_ivp.prepare", lambda _: broken)
    judgement = judge(ball, peers.prepare("scipy", ball)(1e-6))
    assert (judgement.verdict, judgement.why) == ("failed", "at step 3")
    assert isnan(judgement.error)
