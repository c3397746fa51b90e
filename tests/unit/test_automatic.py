"""What `method: auto` is: from the expressions, and from what decays near the start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

import hsdsl
from hsdsl.model import automatic
from hsdsl.report.summary import summary
from hsdsl.store import load

MODELS = Path(__file__).parents[2] / "models"
ROOT = """
hsdsl: 1
modes: {{m: {{flow: {flow}}}}}
initial: {{mode: m, {initial}}}
experiment: {{until: {until}, tolerance: 1e-6, method: auto}}
"""
# flow, start, until, method
CASES = {
    "nothing decays": ("{x: v, v: -x}", "x: 1, v: 0", "1e6", "taylor"),
    "a decay alone, still under way": ("{x: 1000*(sin(1000*t) - x)}", "x: 1", "10", "taylor"),
    "a decay that the run is too short for": ("{x: -100*(x - cos(t))}", "x: 1", "10", "taylor"),
    "oscillation that hardly decays": ("{x: v, v: -1e8*x - 10*v}", "x: 1, v: 0", "1000", "taylor"),
    "a fast decay to a slow curve": ("{x: -1e5*(x - cos(t))}", "x: 3", "10", "radau"),
    "a fast decay beside an oscillation": ("{x: v, v: -x, z: -1e5*(z - x)}", "x: 1, v: 0, z: 5", "10", "radau"),
    "van der Pol": ("{x: v, v: 1000*(1 - x**2)*v - x}", "x: 2, v: 0", "2000", "radau"),
    "van der Pol without haste": ("{x: v, v: (1 - x**2)*v - x}", "x: 2, v: 0", "20", "taylor"),
    "a chaos that lasts": ("{x: 10*(y - x), y: x*(28 - z) - y, z: x*y - 8/3*z}", "x: 1, y: 1, z: 1", "1e5", "taylor"),
    "chaos from near where it would rest": (
        "{x: 10*(y - x), y: x*(28 - z) - y, z: x*y - 8/3*z}",
        "x: 8.4, y: 8.5, z: 27",
        "1e4",
        "taylor",
    ),
    "a root that a stage of dopri5 has no value of": (
        "{a: -2*sqrt(a - b), b: sqrt(a - b) - 3*sqrt(b - c), c: sqrt(b - c) - sqrt(c)/2}",
        "a: 5, b: 0, c: 0",
        "0.1",
        "dop853",
    ),
    "a root that stages have values of": ("{a: -sqrt(a - b), b: sqrt(a - b) - sqrt(b)}", "a: 2, b: 0", "0.1", "dopri5"),
    "a fast decay in a nanosecond": ("{x: -1e14*(x - cos(1e9*t))}", "x: 3", "1e-8", "radau"),
    "a decay to rest": ("{x: -x}", "x: 1", "1e6", "radau"),
    "kinked": ("{x: v, v: -abs(x)}", "x: 1, v: 0", "1", "dopri5"),
    "kinked and stiff": ("{x: -1e5*(x - abs(cos(t)))}", "x: 3", "10", "radau"),
    "nothing moves": ("{x: 0}", "x: 1", "1e9", "taylor"),
    "no derivatives at the start": ("{x: -1e9*sqrt(x)}", "x: 0", "1", "dopri5"),
    "a tank that fills": ("{x: 1 - sqrt(x)}", "x: 0", "1", "dopri5"),
    "derivatives by the states alone": ("{x: 1 + sqrt(t)}", "x: 0", "1", "taylor"),
}


def made(flow: str, initial: str, until: str) -> hsdsl.Model:
    return hsdsl.loads(ROOT.format(flow=flow, initial=initial, until=until))


def prepared(model: hsdsl.Model, **asked: object):
    return model.pipeline.prepare({"engine": "python", **asked}).settings


@pytest.mark.parametrize("name", CASES)
def test_what_auto_is(name: str) -> None:
    flow, initial, until, method = CASES[name]
    settings = prepared(made(flow, initial, until))
    assert settings.method.name == method
    assert settings.method_chosen.startswith(f"{method}: ")


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.yaml")), ids=lambda path: path.stem)
def test_the_models(path: Path) -> None:
    settings = prepared(hsdsl.load(path), method="auto", tolerance=1e-6)
    assert settings.method.name == ("radau" if path.stem == "stiff-switch" else "taylor")


def test_a_stiff_mode_that_an_edge_leads_to() -> None:
    text = """
hsdsl: 1
modes:
  slow: {flow: {x: 1}, transitions: [{when: x >= 1, to: fast}]}
  fast: {flow: {x: -1e6*(x - cos(t))}}
initial: {mode: slow, x: 0}
experiment: {until: 10}
"""
    settings = prepared(hsdsl.loads(text))
    assert settings.method.name == "radau" and "fast is stiff" in settings.method_chosen


def test_a_fixed_step_and_digits_are_not_looked_into() -> None:
    model = made(*CASES["a fast decay to a slow curve"][:3])
    assert prepared(model, step=1e-3).method.name == "dopri5"
    assert prepared(model, precision=30).method.name == "taylor"


def test_what_was_picked_is_said_and_estimates_keep_it(tmp_path: Path) -> None:
    model = made("{x: v, v: -x}", "x: 1, v: 0", "1")
    run = model.simulate(engine="python")
    assert run.method == "taylor" and run.settings["method_chosen"].startswith("taylor: every flow is smooth")
    assert "method_chosen" not in model.simulate(method="taylor", engine="python").settings
    assert model.estimate(run).same_transitions
    assert "method auto is taylor: every flow is smooth" in summary(run)
    run.save(tmp_path / "run.npz")
    assert load(tmp_path / "run.npz").settings == run.settings


def test_a_stiff_run_takes_few_steps() -> None:
    flow, initial, until, _ = CASES["a fast decay to a slow curve"]
    run = made(flow, initial, until).simulate(engine="python")
    assert len(run.times) < 500
    assert run.final["x"] == pytest.approx(np.cos(10) + np.sin(10) * 1e-5, abs=1e-7)


def test_every_method_it_picks_is_one_that_can_be_named() -> None:
    picked = {method for *_, method in CASES.values()}
    assert picked == {"taylor", "dopri5", "dop853", "radau"} and picked <= set(automatic.METHODS)
    assert yaml.safe_load(ROOT.format(flow="{x: 1}", initial="x: 1", until=1))["experiment"]["method"] == "auto"


@pytest.mark.parametrize("engine", ["python", "c"])
def test_a_stage_without_a_value_is_named(engine: str) -> None:
    flow, initial, until, _ = CASES["a root that a stage of dopri5 has no value of"]
    model = made(flow, initial, until)
    stop = model.simulate(engine=engine, method="dopri5").stop
    assert stop.reason == "not_finite"
    assert stop.message.startswith("the flow of c, sqrt(b - c) - sqrt(c)/2, has no finite value at t = ")
    assert "where a stage of dopri5 from t = 0 is; a method with other stages may go on, such as dop853" in stop.message
    found, fine = model.simulate(engine=engine), model.simulate(engine=engine, method="rk4", step=1e-5)
    assert found.stop.complete and fine.stop.complete
    assert [found.final[x] for x in "abc"] == pytest.approx([fine.final[x] for x in "abc"], rel=1e-4)
