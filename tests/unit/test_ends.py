"""How runs end: jumps of inputs there are made once; a run that cannot get to its end stops with the right reason."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from engines import ENGINES, assert_engines_agree, needs_compiler

import hsdsl

STEPS = """
hsdsl: 1
parameters: {period: 1}
inputs: {u: {times: [0, 3*period, 4*period], values: [0, 3, 4], hold: zero}}
outputs: {steps: floor(t/period), curved: floor(t**3/period**3), u: u, y: 2*x}
modes:
  low: {flow: {x: 1 + u}, transitions: [{when: u >= 2, to: high, reset: {x: x + 100}}]}
  high: {flow: {x: u}}
initial: {mode: low, x: 0}
experiment: {until: 3*period}
"""
PLAIN = "hsdsl: 1\nmodes: {a: {flow: {x: 1}}}\ninitial: {mode: a, x: 0}\nexperiment: {until: 1}\n"


def inputs(**outputs: str) -> Any:
    text = ", ".join(f"{name}: '{value}'" for name, value in outputs.items())
    return hsdsl.loads(f"{PLAIN}outputs: {{{text}}}\n")


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scheme", ["located", "relaxed"])
@pytest.mark.parametrize("period", [1, 0.1, 1 / 3, 7e-9, 1e8 / 7])
def test_jumps_at_the_end_are_made_in_any_unit_of_time(period: float, scheme: str, engine: str) -> None:
    model = hsdsl.loads(STEPS)
    run = model.simulate(parameters={"period": period}, scheme=scheme, engine=engine, relaxation=period / 1000)
    assert [(made.time, made.entry, made.target) for made in run.transitions] == [(run.stop.time, True, "high")]
    assert run.stop.reason == "until" and run.final.mode == "high"
    assert run.final.outputs == {"steps": 3, "curved": 27, "u": 3, "y": pytest.approx(6 * period + 200)}
    sampled = run.sample([run.stop.time])
    assert sampled["steps"].tolist() == [3] and sampled["u"].tolist() == [3]
    before = run.sample([run.stop.time], side="left")
    assert before["x"].tolist() == [pytest.approx(3 * period)]


def test_a_run_that_goes_on_does_not_make_the_jump_again() -> None:
    first = hsdsl.loads(STEPS).simulate()
    model = hsdsl.loads(STEPS.replace("values: [0, 3, 4]", "values: [3, 3, 4]"))
    further = model.simulate(initial={"mode": first.final.mode, **first.final.state}, until=2)
    assert not further.transitions and further.final.state["x"] == pytest.approx(first.final.state["x"] + 6)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scheme", ["located", "relaxed"])
def test_what_is_not_reached_or_has_no_value_behind_the_end_is_as_before(scheme: str, engine: str) -> None:
    crest = inputs(crest="floor(sin(t))", root="floor(sqrt(pi/2 - t))", kink="abs(t - pi/2)")
    run = crest.simulate(until="pi/2", scheme=scheme, engine=engine)
    assert run.final.outputs["crest"] == 0 and run.final.outputs["root"] == 0
    assert len(run.arcs) == 2  # the root falls below 1 at pi/2 - 1


def test_the_verdict_names_an_entry_at_the_end_and_holds_without_one() -> None:
    entered = hsdsl.loads(STEPS).simulate(tolerance=1e-9).verdict
    assert entered.theorem == "unknown" and any("within the error of the end" in reason for reason in entered.reasons)
    assert inputs(steps="floor(t/2)").simulate(until=10, tolerance=1e-9).verdict.theorem == "holds"


def test_engines_agree_at_the_end() -> None:
    for scheme in ("located", "relaxed"):
        assert_engines_agree(hsdsl.loads(STEPS), scheme=scheme, tolerance=1e-7)


@pytest.mark.parametrize("engine", ENGINES)
def test_ensembles_have_the_values_behind_the_jump(engine: str) -> None:
    many = hsdsl.loads(STEPS).ensemble(parameters={"period": [1.0, 1.5]}, samples=4, engine=engine)
    assert many.mode.tolist() == ["high", "high"] and many.outputs["steps"].tolist() == [3, 3]
    assert many.samples["steps"].tolist() == [[0, 1, 2, 3]] * 2 and many.samples["u"][:, -1].tolist() == [3, 3]


@needs_compiler
def test_streamed_rows_end_behind_the_jump(tmp_path: Path) -> None:
    streamed = hsdsl.loads(STEPS).stream(tmp_path / "run.csv", every=10**9)
    last = (tmp_path / "run.csv").read_text().splitlines()[-1].split(",")
    assert streamed.transitions == 1 and "high" in last and float(last[0]) == 3


TICKS = """
hsdsl: 1
modes: {a: {flow: {x: 1, c: 0}, transitions: [{when: x >= 1, to: a, reset: {x: 0, c: c + 1}}]}}
initial: {mode: a, x: 0, c: 0}
experiment: {until: 10}
"""
HELD = """
hsdsl: 1
modes:
  a:
    flow: {h: v, v: -10, w: 1, s: sqrt(1 - w)}
    transitions: [{when: h <= 0, if: v <= 0, to: a, reset: {v: -v/2}}]
initial: {mode: a, h: 0, v: 0, w: 0, s: 0}
experiment: {until: 3}
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("method", ["taylor", "dopri5", "radau"])
@pytest.mark.parametrize("until", [1e4, 1e12, 1e14])
def test_the_length_of_a_run_makes_no_instants_one(until, method, engine):
    run = hsdsl.loads(TICKS).simulate(until=until, method=method, max_transitions=50, engine=engine)
    assert run.stop.reason == "transition_limit"
    assert [made.time for made in run.transitions] == pytest.approx(range(1, 51), rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_too_long_for_its_steps_says_so(engine):
    stop = hsdsl.loads(TICKS).simulate(until=1e300, engine=engine).stop
    assert (stop.reason, stop.time) == ("not_finite", 0)
    assert "take a shorter one" in stop.message


@pytest.mark.parametrize("engine", ENGINES)
def test_a_flow_without_a_value_along_a_guard_is_named(engine):
    stop = hsdsl.loads(HELD).simulate(engine=engine).stop
    assert stop.message.startswith("the flow of s, sqrt(1 - w), has no finite value at t = 1 ")


@pytest.mark.parametrize("engine", ENGINES)
def test_steps_whose_interpolant_overflows_are_not_made(engine):
    model = hsdsl.load(Path(__file__).parents[2] / "models" / "stiff-switch.yaml")
    run = model.simulate(method="dop853", tolerance=1e-4, max_transitions=100, engine=engine)
    assert run.stop.reason == "transition_limit"  # a wrong run, of an explicit method, but one that ends
