"""Charts: errors against exact executions, what counts as wrong, turns, peers, and the table."""

from __future__ import annotations

import csv
import json
import math
import time
from dataclasses import dataclass, field
from importlib.util import find_spec
from math import isnan
from pathlib import Path

import numpy as np
import pytest
from sympy import Symbol

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.base.functions import FUNCTIONS
from hsdsl.interface.chart import PEERS, Refused, Scene, work_precision
from hsdsl.interface.chart.outcome import judge
from hsdsl.interface.chart.peers import prepare
from hsdsl.interface.chart.rows import COLUMNS, as_csv
from hsdsl.interface.chart.scene import Attempt, Result, Tool
from hsdsl.interface.chart.stopwatch import Deadline, race
from hsdsl.interface.chart.translation import as_function, in_floats, translate

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
    span = np.ptp(ball.exact_values, axis=0)  # of each state
    assert judge(ball, exactly(ball, values=ball.exact_values + 0.2 * span)).verdict == "wrong"
    assert judge(ball, exactly(ball, values=ball.exact_values + 0.05 * span)).verdict == "right"


def test_another_mode_is_wrong():
    scene = Scene.of(hsdsl.load(MODELS / "digital-control.yaml"), samples=100)
    modes = scene.exact_modes.copy()
    modes[modes == "D3"] = "D0"
    assert judge(scene, exactly(scene, modes=modes)).why.startswith("another mode at")


FAST = """hsdsl: 1
modes: {a: {flow: {x: 1}, transitions: [{when: x >= 1e-5, to: b}]}, b: {flow: {x: -1}}}
initial: {mode: a, x: 0}
experiment: {until: 3e-5}
"""


def test_runs_of_microseconds_have_samples_clear_of_jumps():
    """The time around jumps that does not count is a part of a short run."""
    model = hsdsl.loads(FAST)
    exact = model.simulate()
    scene = Scene.of(model, exact=exact, samples=101)
    assert scene.clear.sum() == 100 and judge(scene, scene.result(exact)).verdict == "right"
    with pytest.raises(UsageError, match=r"no sample is farther than 0.0001 from a jump and the end"):
        Scene.of(model, exact=exact, clearance=1e-4)


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
    loose, tight = (row for row in rows if row.attempt.tool.method == "dopri5")
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


@dataclass
class Calls:
    """Attempts that sleep, and the result of a run that is left to its end."""

    made: list[str] = field(default_factory=list)
    interrupted: bool = False

    def attempt(self, tool, name, seconds=0.0):
        def run():
            self.made.append(name)
            time.sleep(seconds)
            return self

        return Attempt(Tool(tool), "step", 1.0, run)


def test_turns_alternate_and_the_slow_are_ended():
    calls = Calls()
    attempts = [calls.attempt("a", "a1", 60), calls.attempt("a", "a2"), calls.attempt("b", "b1")]
    began = time.perf_counter()
    done = list(race(attempts, lambda _, result: result, 2, 0.2, lambda _: None))
    assert time.perf_counter() - began < 30
    assert [(attempt.tool.name, result) for attempt, result, _ in done] == [("a", None), ("b", calls)]
    assert calls.made.count("a1") == 1
    assert "a2" not in calls.made
    assert calls.made.count("b1") >= 3


def test_a_search_for_rho_is_ended(ball, monkeypatch):
    monkeypatch.setattr("hsdsl.interface.chart.rho", lambda *_: time.sleep(60))
    (row,), _ = work_precision(
        ball, schemes=["located"], methods=["taylor"], engines=["python"], tolerances=[1e-6], patience=0.5, rounds=1
    )
    assert (row.judgement.verdict, row.judgement.rho) == ("right", None)


def test_a_run_is_ended_after_a_destructor_forgot_it():
    class Destroyed:
        def __del__(self):
            time.sleep(60)

    with Deadline(0.2) as deadline:
        Destroyed()
        time.sleep(60)
    assert deadline.passed


def test_ctrl_c_ends_a_race():
    with pytest.raises(KeyboardInterrupt):
        list(race([Calls(interrupted=True).attempt("a", "a1")], lambda *_: None, 1, 10, lambda _: None))


def test_an_earlier_end_has_a_reference_of_its_own():
    seen = []
    scene = Scene.of(hsdsl.load(MODELS / "bouncing-ball.yaml"), until="3/2", samples=50, digits=6, watch=seen.append)
    assert scene.exact.engine == "refined" and scene.grid[-1] == scene.exact.final.time == pytest.approx(1.5)
    assert len(scene.exact.transitions) == 1 and [float(each.until) for each in seen] == [1.5, 1.5]


@pytest.mark.parametrize("engine", ["c", "python"])
def test_runs_that_are_ended_or_stop_have_rows(engine):
    model = hsdsl.loads(
        "hsdsl: 1\nmodes: {m: {flow: {x: v, v: -1e12*x}}}\ninitial: {mode: m, x: 1, v: 0}\nexperiment: {until: 1}"
    )
    scene = Scene.of(model, exact=model.simulate(until=0.001), until=100, samples=10)
    rows, _ = work_precision(
        scene, schemes=["located"], methods=["dopri5", "euler"], engines=[engine], tolerances=[1e-6], steps=[1e-3],
        patience=0.3, rounds=1,
    )  # fmt: skip
    ended, grown = rows
    assert (ended.judgement.verdict, ended.judgement.why) == ("failed", "no end within 0.3 s")
    assert grown.judgement.verdict == "failed"
    assert grown.judgement.rho is None


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


OPERATIONS = {
    **{name: f"{name}(0.3 + x/4)" for name in FUNCTIONS if FUNCTIONS[name][1] == 1},
    **{"acosh": "acosh(1.2 + x)", "floor": "floor(2*x + 0.25)", "sign": "sign(x - 0.4)", "abs": "abs(x - 0.4)"},
    **{"atan2": "atan2(x, 0.7)", "min": "min(x, 0.4, 2)", "max": "max(x, 0.4)", "select": "select(x - 0.4, 2, x)"},
    **{"a power": "x**1.3", "a square": "x**2/3", "a constant": "sqrt(2)*pi", "of time": "select(t - 0.6, 1, 0.3)"},
}
"""Expressions by what they use: every function of the language."""
KINKED = ("floor", "sign", "abs", "min", "max", "select", "of time")
NAMES = {name: getattr(math, name, None) for name in (*FUNCTIONS, "pi")} | {"abs": abs, "min": min, "max": max}
NAMES |= {"sign": lambda x: (x > 0) - (x < 0), "select": lambda c, a, b: a if c > 0 else b}
POINTS = ((0.1, 0.15), (0.45, 0.4), (0.7, 1.3))
KINKS = """
hsdsl: 1
inputs: {u: "select(0.9 - t, 1, 0.6)"}
modes:
  up:
    flow: {x: "u - min(x, 0.3)"}
    transitions: [{when: "max(x - 0.55, abs(x - 0.1) - 4) >= 0", to: down}]
  down:
    flow: {x: -u - floor(t/50)}
    transitions: [{when: x <= 0.2, to: up, reset: {x: "0.3*sign(x)"}}]
initial: {mode: up, x: 0}
experiment: {until: 2.3}
"""


@pytest.fixture(scope="module")
def operations():
    """A mode over x, and the operations as expressions of it."""
    text = SHEDDING.replace("modes:", f"outputs: {json.dumps(dict(enumerated(OPERATIONS)))}\nmodes:")
    model = hsdsl.loads(text)
    mode = translate(Scene.of(hsdsl.loads(SHEDDING), samples=2)).modes[0]
    names = {Symbol(name, real=True): plain for name, plain in zip("xy", mode.symbols, strict=True)}
    plain = [in_floats(value.xreplace(names)) for value in model.system.modes[0].outputs]
    return mode, dict(zip(OPERATIONS, plain, strict=True))


def enumerated(operations):
    return ((f"o{i}", text) for i, text in enumerate(operations.values()))


def by_casadi(mode, value, points):
    import casadi as ca

    from hsdsl.interface.chart.peers.casadi_rosenbrock import FUNCTIONS

    t, x = ca.SX.sym("t"), ca.SX.sym("x")
    function = ca.Function("f", [t, x], [as_function(mode, (value,), FUNCTIONS)(t, x, x)[0]])
    return [float(function(*point)) for point in points]


def by_diffrax(mode, value, points):
    import jax.numpy as jnp

    from hsdsl.export import jax
    from hsdsl.interface.chart.peers.diffrax_event import FUNCTIONS

    jax.config.update("jax_enable_x64", True)
    function = as_function(mode, (value,), FUNCTIONS)
    return [float(function(jnp.asarray(t), jnp.asarray(x), x)[0]) for t, x in points]


def by_heyoka(mode, value, points):
    import heyoka as hy

    from hsdsl.interface.chart.peers.heyoka_taylor import FUNCTIONS

    x = hy.expression("x")
    function = hy.cfunc([hy.expression(as_function(mode, (value,), FUNCTIONS)(hy.time, x, x)[0])], [x])
    return [function([x], time=t)[0] for t, x in points]


def by_numbers(mode, value, points):
    return [as_function(mode, (value,))(t, x, x)[0] for t, x in points]


def test_every_function_is_among_the_operations():
    assert FUNCTIONS.keys() <= OPERATIONS.keys()


@pytest.mark.parametrize("operation", OPERATIONS)
@pytest.mark.parametrize("evaluate", [by_numbers, by_casadi, by_diffrax, by_heyoka])
def test_a_peer_has_a_function_or_refuses_it_in_words(operations, evaluate, operation):
    if find_spec(evaluate.__name__.removeprefix("by_").replace("numbers", "math")) is None:
        pytest.skip("not installed")
    mode, values = operations
    if evaluate is by_heyoka and operation in KINKED:
        with pytest.raises(Refused, match=r"`[a-z]+` is not translated"):
            evaluate(mode, values[operation], POINTS)
        return
    known = [eval(OPERATIONS[operation], NAMES | {"t": t, "x": x}) for t, x in POINTS]
    assert evaluate(mode, values[operation], POINTS) == pytest.approx(known, rel=1e-12)


@pytest.mark.parametrize("name", PEERS)
def test_peers_run_a_model_with_kinks_and_jumps(name):
    if find_spec(PACKAGES[name]) is None:
        pytest.skip(f"{name} is not installed")
    scene = Scene.of(hsdsl.loads(KINKS), samples=300, digits=6)
    if name == "heyoka":
        with pytest.raises(Refused, match=r"`[a-z]+` is not translated"):
            prepare(name, scene)
        return
    judgement = judge(scene, prepare(name, scene)(1e-9))
    assert judgement.verdict == "right", judgement
    assert judgement.error < 1e-3


def test_linear_equations_are_refused():
    solve = 'solve: {unknowns: [a, b], equations: ["2*a + x*b == x", "a - b == 1"]}'
    text = SHEDDING.replace("modes:", f"{solve}\nmodes:").replace("-2*x", "-a")
    with pytest.raises(Refused, match="`solve` is not translated"):
        prepare("scipy", Scene.of(hsdsl.loads(text), samples=50))


def test_events_of_several_conditions_are_translated():
    text = SHEDDING.replace("when: y >= 1", "event: 'y >= 0.7 and min(t, 3) >= 0.4'")
    scene = Scene.of(hsdsl.loads(text), samples=50)
    assert judge(scene, prepare("scipy", scene)(1e-9)).verdict == "right"


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
    from hsdsl.interface.chart import peers

    def broken(_):
        raise RuntimeError("no convergence\nat step 3")

    monkeypatch.setattr("hsdsl.interface.chart.peers.scipy_ivp.prepare", lambda _: broken)
    judgement = judge(ball, peers.prepare("scipy", ball)(1e-6))
    assert (judgement.verdict, judgement.why) == ("failed", "at step 3")
    assert isnan(judgement.error)
