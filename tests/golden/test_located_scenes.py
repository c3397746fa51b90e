"""The located scheme against exact executions: oscillators, Zeno points and rest, two legs at once, fifty digits."""

from __future__ import annotations

import random
from functools import lru_cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from references.impact_oscillator import Motion, Oscillator, exact_example_1, exact_example_2
from shipped import MODELS, shipped

import hsdsl

METHODS = ["taylor", "dop853", "dopri5"]


def located(name: str, method: str, tolerance: Any, **more: Any) -> Any:
    return shipped(name).simulate(scheme="located", method=method, tolerance=tolerance, **more)


@pytest.mark.parametrize(("method", "within"), [("taylor", 1e-11), ("dop853", 1e-11)])
def test_all_impacts_of_example_1(method: str, within: float) -> None:
    run, exact = located("oscillator-with-stop-1", method, 1e-12), exact_example_1()
    assert len(run.transitions) == 49
    assert max(abs(t.time - float(i.time)) for t, i in zip(run.transitions, exact.impacts, strict=True)) <= within
    assert all(t.resumed == t.time for t in run.transitions)
    assert np.max(np.abs(run.values[:-1, 0] - exact.at(run.times[:-1])[0])) <= 100 * within


@pytest.mark.parametrize("method", [*METHODS, "radau"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_no_impact_is_missed_or_made_up_at_loose_tolerances(method: str, tolerance: float) -> None:
    assert len(located("oscillator-with-stop-1", method, tolerance).transitions) == 49


def test_fifty_digits() -> None:
    """To 45 digits after twenty impacts, each of which passes its error on."""
    run = located("oscillator-with-stop-1", "taylor", "1e-50", precision=50, until=50)
    impacts = [i for i in exact_example_1().impacts if i.time <= 50]
    with mp.workdps(60):
        off = [abs(mp.mpf(t.time) - mp.mpf(str(i.time))) for t, i in zip(run.transitions, impacts, strict=True)]
        assert max(off) <= mp.mpf(10) ** -45, mp.nstr(max(off), 3)


@pytest.mark.parametrize(("method", "within"), [("taylor", 1e-11), ("dop853", 1e-11), ("dopri5", 2e-10)])
def test_example_2_through_both_zeno_points(method: str, within: float) -> None:
    """Impacts are no faster than 0.2, so an error in position counts at least five times in their times."""
    run, exact = located("oscillator-with-stop-2", method, 1e-12, relaxation=1e-9), exact_example_2()
    assert run.stop.reason == "until"
    assert run.verdict.theorem == "left"
    assert [reason.split()[0] for reason in run.verdict.reasons] == ["at", "Zeno", "at", "Zeno", "at"]
    rests = [a for a in run.arcs if a.last > a.first and np.all(run.values[a.first : a.last + 1, 1] == 0)]
    starts, ends = zip(*((run.times[a.first], run.times[a.last]) for a in rests), strict=True)
    assert np.allclose(starts, [0, *map(float, exact.zeno)], rtol=0, atol=within)
    assert np.allclose(ends[:2], [float(t) for t in exact.released[:2]], rtol=0, atol=1e-11)
    made = [i.time for i in exact.impacts if i.time < exact.zeno[0]]
    tail = [t.time for t in run.transitions if t.time < float(exact.zeno[0])]
    assert 20 <= len(tail) <= len(made)
    assert max(abs(t - float(expected)) for t, expected in zip(tail, made, strict=False)) <= within
    times = np.linspace(0, 12.5, 400)
    assert np.max(np.abs(run.sample(times)["x"] - exact.at(times)[0])) <= 1e-10


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("tolerance", "within"), [(1e-3, 2e-2), (1e-6, 1e-4)])
def test_a_release_from_rest_is_no_impact_at_loose_tolerances(method: str, tolerance: float, within: float) -> None:
    """What an interpolation may be off by must not count as a rise where the flow leaves the guard tangentially."""
    run, exact = located("oscillator-with-stop-2", method, tolerance), exact_example_2()
    assert [reason.split()[0] for reason in run.verdict.reasons[:5]] == ["at", "Zeno", "at", "Zeno", "at"]
    assert abs(run.transitions[0].time - float(exact.impacts[0].time)) <= within
    assert len(run.transitions) < 60


@pytest.mark.parametrize(("tolerance", "within", "most"), [(1e-3, 2e-2, 120), (1e-6, 1e-4, 120), (1e-10, 1e-7, 45)])
def test_a_release_from_rest_is_no_impact_by_an_implicit_method(tolerance: float, within: float, most: int) -> None:
    """Its polynomial has an error in its first terms; at loose tolerances the tail of impacts ends in strips."""
    run, exact = located("oscillator-with-stop-2", "radau", tolerance), exact_example_2()
    assert run.stop.reason == "until" and len(run.transitions) <= most
    assert abs(run.transitions[0].time - float(exact.impacts[0].time)) <= within
    times = np.linspace(0, 12.5, 400)
    assert np.max(np.abs(run.sample(times)["x"] - exact.at(times)[0])) <= within


@pytest.mark.parametrize("method", [*METHODS, "radau"])
def test_ball_comes_to_rest(method: str) -> None:
    run = located("bouncing-ball", method, 1e-12, until=14)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    rest = run.arcs[-1]
    assert run.times[rest.first] == pytest.approx(12.850588106343579, abs=1e-11)
    assert run.final.state["v"] == 0 and abs(run.final.state["h"]) <= 1e-12


ROLLING = """
hsdsl: 1
parameters: {e: 1/2}
modes:
  fly:
    flow: {x: 1, h: v, v: -2}
    transitions: [{when: h <= 0, to: fly, reset: {v: -e*v}}]
initial: {mode: fly, x: 0, h: 1, v: 0}
experiment: {until: 5, scheme: located}
"""


@pytest.mark.parametrize("method", METHODS)
def test_ball_that_bounces_and_rolls_goes_on(method: str) -> None:
    """It falls for 1; flights of 1, 1/2, 1/4, ... follow and end at t = 3."""
    run = hsdsl.loads(ROLLING).simulate(method=method)
    assert run.stop.reason == "until" and run.verdict.theorem == "left"
    assert any("Zeno at t = 3:" in reason for reason in run.verdict.reasons)
    assert any("motion along the guard of fly->fly from t = 3 to t = 5" in reason for reason in run.verdict.reasons)
    assert run.final.state["x"] == pytest.approx(5, abs=1e-9)


def test_without_completion_the_run_stops_at_the_zeno_point() -> None:
    run = hsdsl.loads(ROLLING).simulate(completion="none")
    assert run.stop.reason == "zeno" and "accumulate at t = 3" in run.stop.message
    assert run.stop.time == pytest.approx(3, abs=2e-6)


EDGES = ["aerial->left", "left->ground", "ground->last_right", "last_right->ascent", "ascent->apex"]


@pytest.mark.parametrize("method", [*METHODS, "radau"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("w", ["0", "1e-12", "-1e-12", "1e-10", "-1e-8", "1e-5", "-1e-3", "1e-3", "-0.4"])
def test_both_legs_touch_down(w: str, tolerance: float, method: str) -> None:
    """At once, or apart by about w/10."""
    run = located("pronking-runner", method, tolerance, initial={"w": w})
    assert run.stop.reason == "final" and run.final.mode == "apex", run.stop.message
    assert len(run.transitions) == 5
    assert not any(t.entry for t in run.transitions)
    if w == "0":
        assert run.transitions[0].time == run.transitions[1].time
        assert [t.edge for t in run.transitions] == EDGES


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("w", "apex"), [("0", 0.9259377788821), ("-0.4", 0.6683909550717)])
def test_runner_to_its_apex(w: str, apex: float, method: str) -> None:
    assert located("pronking-runner", method, 1e-13, initial={"w": w}).stop.time == pytest.approx(apex, abs=1e-11)


@lru_cache
def varied() -> Any:
    """Example 1 with the amplitude of its forcing as a parameter."""
    text = (MODELS / "oscillator-with-stop-1.yaml").read_text()
    text = text[: text.index("# Between impacts")].replace("{a: 0.05,", "{A: 20, a: 0.05,").replace("20*cos", "A*cos")
    return hsdsl.loads(text)


@pytest.mark.parametrize(
    "count", [8, pytest.param(40, marks=pytest.mark.slow), pytest.param(150, marks=pytest.mark.campaign)]
)
def test_no_impact_is_missed_or_made_up_whatever_the_parameters(count: int) -> None:
    """Restitution and forcing varied, against the closed form."""
    rng, until = random.Random(7), 37.7
    for _ in range(count):
        c, amplitude = f"{rng.uniform(0.3, 0.95):.6f}", f"{rng.uniform(8, 30):.6f}"
        exact = Motion(Oscillator("0.05", c, "2.5", "14", amplitude), mp.mpf("11.36"), mp.mpf("31.4"), mp.mpf(until))
        run = varied().simulate(
            scheme="located", method="taylor", tolerance=1e-10, until=until, parameters={"c": c, "A": amplitude}
        )
        assert len(run.transitions) == len(exact.impacts), (c, amplitude)
        off = [abs(t.time - float(i.time)) for t, i in zip(run.transitions, exact.impacts, strict=True)]
        assert max(off, default=0) <= 1e-7, (c, amplitude)


CLOCK = """
hsdsl: 1
modes:
  off: {flow: {x: 0}, transitions: [{when: sin(2*pi*t) >= 0.5, to: on}]}
  on: {flow: {x: 1}, transitions: [{when: sin(2*pi*t) <= 0, to: off}]}
initial: {mode: off, x: 0}
experiment: {until: 3}
"""


@pytest.mark.parametrize("until", [250, 300, 301, 1000, 3000])
@pytest.mark.parametrize("method", ["taylor", "dop853"])
def test_a_clock_faster_than_the_flow_is_not_passed_over(method: str, until: int) -> None:
    """The flow alone would allow steps of many periods, and the period divides them: on for 5/12 of each."""
    run = hsdsl.loads(CLOCK).simulate(until, method=method)
    assert len(run.transitions) == 2 * until
    assert run.final.state["x"] == pytest.approx(until * 5 / 12, abs=1e-8)
    assert run.verdict.theorem == "holds"


@pytest.mark.parametrize("method", ["taylor", pytest.param("dopri5", marks=pytest.mark.slow)])
def test_a_clock_of_thousands_of_periods_is_followed(method: str) -> None:
    run = hsdsl.loads(CLOCK).simulate(20_000, method=method)
    assert len(run.transitions) == 40_000
    assert run.final.state["x"] == pytest.approx(20_000 * 5 / 12, abs=1e-5)
    assert len(run.times) < 10 * len(run.transitions)  # a stretch begins with a step as long as the last one allowed


def test_a_clock_too_fast_to_be_followed_is_told_of() -> None:
    run = hsdsl.loads(CLOCK).simulate("1e9", max_transitions=1000)
    assert any("no polynomial fits" in reason for reason in run.verdict.reasons)
    assert run.verdict.theorem != "holds"


def test_the_relaxed_scheme_says_what_it_passed_over() -> None:
    run = hsdsl.loads(CLOCK).simulate(10, scheme="relaxed")
    assert len(run.transitions) < 20
    assert run.verdict.theorem == "unknown" and "passed over" in run.verdict.reasons[0]


@pytest.mark.parametrize("scheme", ["located", pytest.param("relaxed", marks=pytest.mark.campaign)])  # 1000 halvings
def test_more_digits_than_float64_has_exponents_for(scheme: str) -> None:
    run = shipped("bouncing-ball").simulate(
        "1.5", scheme=scheme, method="rk4", step="1/2", relaxation="1e-300", precision=400
    )
    with mp.workdps(400):
        assert abs(run.transitions[0].time - mp.sqrt(mp.mpf(20) / mp.mpf("9.81"))) < mp.mpf(10) ** -290
