"""Points that findings name, tried out: the simulator does from there what the finding says."""

import re
from functools import cache

import pytest

import hsdsl
from hsdsl.analysis.lint import lint, selected

BEYOND = """hsdsl: 1
modes:
  up: {flow: {x: 1, y: 0}, transitions: [{when: x >= 2, to: down, reset: {x: y}}]}
  down: {flow: {x: -1, y: 0}, transitions: [{when: x >= 1, to: up, reset: {x: 0}}]}
initial: {mode: up, x: 0, y: 0}
experiment: {until: 5}
"""
WALL = """hsdsl: 1
modes:
  up: {flow: {x: 1, y: 0}, transitions: [{when: x >= 2, to: down, reset: {x: y**2 - 1}}]}
  down: {flow: {x: -1, y: 0}, domain: [x <= 1]}
initial: {mode: up, x: 0, y: 0}
experiment: {until: 5}
"""
PASSED = """hsdsl: 1
modes:
  m: {flow: {x: 1, y: 1}, transitions: [{when: x >= 1, if: y >= 0, to: out, reset: {}}]}
  out: {final: true}
initial: {mode: m, x: 0, y: -3}
experiment: {until: 10}
"""
CYCLE = """hsdsl: 1
modes:
  a: {flow: {x: 1}, transitions: [{when: x >= 1, to: b}]}
  b: {flow: {x: 1}, transitions: [{when: x >= 0, to: a}]}
initial: {mode: a, x: 0}
experiment: {until: 5}
"""
SLIDE = """hsdsl: 1
modes:
  a: {flow: {x: y, y: 0}, transitions: [{when: x >= 0, to: b}]}
  b: {flow: {x: -y, y: 0}, transitions: [{when: x <= 0, to: a}]}
initial: {mode: a, x: -1, y: 1}
experiment: {until: 2, relaxation: 1e-2}
"""


@pytest.fixture
def found(tmp_path):
    def look(text, code):
        path = tmp_path / "model.yaml"
        path.write_text(text)
        (finding,) = [f for f in lint(path, selected([code])).findings if f.code == code]
        point = {name: float(number) for name, number in re.findall(r"(\w+) = (-?[\d.]+(?:e-?\d+)?)", finding.message)}
        return hsdsl.load(path), point, finding

    return look


def test_it_fires_at_once(found):
    model, point, _ = found(BEYOND, "HS506")
    run = model.simulate(initial={**point, "x": point["x"] - 0.5})
    assert [t.edge for t in run.transitions[:2]] == ["up->down", "down->up"] and run.transitions[1].entry


def test_it_stops_beyond_the_wall(found):
    model, point, _ = found(WALL, "HS506")
    assert model.simulate(initial={**point, "x": point["x"] - 0.5}).stop.reason == "left_domain"
    assert model.simulate().stop.reason != "left_domain"


def test_nothing_fires_where_the_condition_turns_true(found):
    model, point, _ = found(PASSED, "HS502")
    run = model.simulate()
    assert not run.transitions and run(3.0)["x"] > 1 and point["y"] == 0


def test_the_cycle_ends_the_run(found):
    model, point, _ = found(CYCLE, "HS510")
    stop = model.simulate(max_transitions=200).stop
    assert stop.reason == "zeno" and stop.time == pytest.approx(point["x"], abs=1e-3)


def test_sliding_stops_the_run(found):
    model, point, _ = found(SLIDE, "HS509")
    assert point["y"] > 0
    assert model.simulate().stop.message.startswith("sliding at t = ")
    assert len(model.simulate(initial={"y": -1.0}).transitions) == 0


@cache
def said_of(model):
    report = lint(f"models/{model}.yaml")
    return (*report.findings, *(i.diagnostic for i in report.ignored))


@pytest.mark.parametrize(
    ("model", "code", "says"),
    [
        ("oscillator-with-stop-2", "HS462", "starts on the guard of 'impact' with the flow pointing out"),
        ("oscillator-with-stop-2", "HS507", "lands on its own guard"),
        ("oscillator-with-stop-1", "HS505", "x = 14, v = 0, t = 0, where r does not change along the flow"),
        ("bouncing-ball", "HS507", "Zeno is possible"),
        ("digital-control", "HS508", "overlap, at x = 0, y = 0; they commute"),
        ("pronking-runner", "HS508", "'aerial->left' and 'aerial->right' overlap"),
        ("pronking-runner", "HS508", "'ground->last_right' and 'ground->last_left' overlap"),
        ("pronking-runner", "HS507", "'left->ground' lands on the guard of 'ground->last_left'"),
    ],
)
def test_scenes_say_what_the_paper_says(model, code, says):
    found = said_of(model)
    assert any(f.code == code and says in f.message for f in found)


def test_oscillator_1_is_not_zeno():
    """Its stop pushes back too hard: L_f^2 r is negative on the guard wherever v = 0."""
    assert not [f for f in said_of("oscillator-with-stop-1") if f.code == "HS507"]
