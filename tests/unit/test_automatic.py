"""What `method: auto` is: from the expressions, and from what decays near the start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from shipped import MODELS

import hsdsl
from hsdsl.analysis.report.summary import summary
from hsdsl.analysis.store import load
from hsdsl.engine.preparation import automatic

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
    "a root of time at the start": ("{x: 1 + sqrt(t)}", "x: 0", "1", "dopri5"),
    "a root of time at a switch": ("{x: '1 + sqrt(max(0.4 - t, 0))'}", "x: 0", "1", "dopri5"),
    "a root, and switches of something else": ("{x: floor(5*t) - sqrt(x)}", "x: 2", "1", "taylor"),
}


def made(flow: str, initial: str, until: str) -> hsdsl.Model:
    return hsdsl.loads(ROOT.format(flow=flow, initial=initial, until=until))


def prepared(model: hsdsl.Model, **given: object):
    return model.pipeline.prepare({"engine": "python", **given}).settings


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


# flights between transitions or samples, of so many times of the fastest decay, and the method
FLIGHTS = {
    "a thermostat": (
        """
modes:
  heat: {flow: {T: 5*(30 - T)}, transitions: [{when: T >= 21, to: cool}]}
  cool: {flow: {T: 5*(10 - T)}, transitions: [{when: T <= 19, to: heat}]}
initial: {mode: heat, T: 15}
""",
        "taylor",
    ),
    "a thermostat that starts beyond its band": (
        """
modes:
  heat: {flow: {T: 5*(30 - T)}, transitions: [{when: T >= 21, to: cool}]}
  cool: {flow: {T: 5*(10 - T)}, transitions: [{when: T <= 19, to: heat}]}
initial: {mode: heat, T: 25}
""",
        "taylor",
    ),
    "a slow thermostat with a fast sensor": (
        """
modes:
  heat: {flow: {T: (30 - T)/5, s: 1e3*(T - s)}, transitions: [{when: s >= 21, to: cool}]}
  cool: {flow: {T: (10 - T)/5, s: 1e3*(T - s)}, transitions: [{when: s <= 19, to: heat}]}
initial: {mode: heat, T: 15, s: 15}
""",
        "radau",
    ),
    "a clock that samples before anything has decayed": (
        """
modes:
  run: {flow: {x: u - x, u: 0}, transitions: [{when: since >= 8, to: run, reset: {u: 1 - x/2}}]}
initial: {mode: run, x: 0, u: 1}
""",
        "taylor",
    ),
    "a clock that samples when all has decayed": (
        """
modes:
  run: {flow: {x: 1000*(u - x), u: 0}, transitions: [{when: since >= 8, to: run, reset: {u: 1 - x/2}}]}
initial: {mode: run, x: 0, u: 1}
""",
        "radau",
    ),
    "samples of an input before anything has decayed": (
        """
inputs: {u: {times: [k for], values: [v for]}}
modes: {run: {flow: {x: u - x}}}
initial: {mode: run, x: 0}
""",
        "taylor",
    ),
    "samples of an input when all has decayed": (
        """
inputs: {u: {times: [k for], values: [v for]}}
modes: {run: {flow: {x: 100*(u - x)}}}
initial: {mode: run, x: 0}
""",
        "radau",
    ),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_mode_is_stiff_by_what_decays_within_a_flight(name: str) -> None:
    text, method = FLIGHTS[name]
    times, values = [str(8 * k) for k in range(500)], [str(k % 3) for k in range(500)]
    text = text.replace("k for", ", ".join(times)).replace("v for", ", ".join(values))
    run = hsdsl.loads(f"hsdsl: 1{text}experiment: {{until: 4000, tolerance: 1e-6}}").simulate()
    assert run.stop.complete and run.method == method


def test_a_decay_that_follows_time_is_seen_under_way() -> None:
    """A clock beside it: at the start the run has no size, and nothing counts as straight."""
    text = """
hsdsl: 1
modes:
  run: {flow: {x: sin(t/1e4) - x, n: 0}, transitions: [{when: since >= 1000, to: run, reset: {n: n + 1}}]}
initial: {mode: run, x: 0, n: 0}
experiment: {until: 3e5, tolerance: 1e-6}
"""
    run = hsdsl.loads(text).simulate()
    assert run.method == "radau" and run.final["n"] == 300
    lag = (np.sin(30) - np.cos(30) * 1e-4) / (1 + 1e-8)
    assert run.final["x"] == pytest.approx(lag, abs=1e-6)


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


@pytest.mark.parametrize("order", [("u", "w"), ("w", "u")])
def test_modes_that_edges_lead_to_are_judged_at_values_by_name(order: tuple[str, str]) -> None:
    """Decays at 1 + 3e5 u: u stays zero, whatever place it has among the states."""
    flows = {"u": "0", "w": "-w*(1 + 3e5*u)"}
    later = ", ".join(f"{name}: {flows[name]}" for name in order)
    text = f"""
hsdsl: 1
modes:
  a: {{flow: {{u: 0, w: -w}}, transitions: [{{when: w <= 0.7, to: b}}]}}
  b: {{flow: {{{later}}}}}
initial: {{mode: a, u: 0, w: 1}}
experiment: {{until: 7}}
"""
    assert hsdsl.loads(text).simulate().method == "taylor"
    assert hsdsl.loads(text.replace("u: 0, w: 1", "u: 1, w: 1")).simulate().method == "radau"


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


# flow, start, until: nothing is stiff near the start, and a thousand steps on all is
LATER = {
    "Robertson's reactions, nothing there yet": (
        "{a: -0.04*a + 1e4*b*c, b: 0.04*a - 1e4*b*c - 3e7*b**2, c: 3e7*b**2}",
        "a: 1, b: 0, c: 0",
        "1e4",
    ),
    "a decay that grows with time": ("{x: -2e3*t*(x - cos(t))}", "x: 1", "30"),
    "kinked, and a decay that grows": ("{x: -1e3*y*(x - abs(cos(y))), y: 1}", "x: 1, y: 0", "100"),
}
FAST = """
hsdsl: 1
parameters: {rate: 1e5}
modes:
  first: {flow: {x: 1, y: 0}, transitions: [{when: x >= 1, to: second}]}
  second: {flow: {x: 1, y: 1}, transitions: [{when: y >= 1, to: fast}]}
  fast: {flow: {x: -rate*(x - cos(t)), y: -y}}
initial: {mode: first, x: 0, y: 0}
experiment: {until: 12, tolerance: 1e-6}
"""


@pytest.mark.parametrize("engine", ("c", "python"))
@pytest.mark.parametrize("name", LATER)
def test_a_run_that_becomes_stiff_is_made_again(name: str, engine: str) -> None:
    model = made(*LATER[name])
    run = model.simulate(engine=engine)
    assert prepared(model).method.name != "radau" and run.method == "radau"
    assert "is stiff at t = " in run.settings["method_chosen"]
    assert run.settings["method_chosen"] == model.simulate(engine="c").settings["method_chosen"]
    named = model.simulate(method="radau", engine=engine)
    assert np.array_equal(run.times, named.times) and run.final == named.final


def test_streams_ensembles_and_derivatives_of_such_runs(tmp_path: Path) -> None:
    model = hsdsl.loads(FAST)
    run = model.simulate()
    assert run.method == "radau"
    streamed = model.stream(tmp_path / "rows.csv")
    assert streamed.method == "radau" and streamed.steps == len(run.times)
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == len(run.times) + 1
    ensemble = model.ensemble(parameters={"rate": [1e5, 2e5]})
    assert ensemble.method == "radau" and ensemble.state["x"][0] == run.final["x"]
    fresh = hsdsl.loads(FAST).sensitivity("rate")
    assert fresh.execution.method == "radau" == fresh.run.method


# many rows that no decay asks for
BUSY = {
    "a clock beside a decay that has ended": """
hsdsl: 1
modes:
  run:
    flow: {x: y*(1 - x), y: 1, s: 1}
    transitions: [{when: s >= 1/1000, to: run, reset: {s: 0}}]
initial: {mode: run, x: 1, y: 0, s: 0}
experiment: {until: 4000, max_transitions: 10000, tolerance: 1e-6}
""",
    "chaos": ROOT.format(
        flow="{x: 10*(y - x), y: x*(28 - z) - y, z: x*y - 8/3*z}", initial="x: 1, y: 1, z: 1", until="1000"
    ),
    "a driven oscillator": ROOT.format(flow="{x: v, v: -x - v + cos(t)}", initial="x: 1, v: 0", until="4000"),
}


@pytest.mark.parametrize("name", BUSY)
def test_many_rows_are_not_stiffness(name: str) -> None:
    run = hsdsl.loads(BUSY[name]).simulate()
    assert len(run.times) > 2048 and run.method == "taylor"
