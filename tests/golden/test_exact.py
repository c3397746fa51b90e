"""Exact executions: the numbers known of them, the models they solve, and the error they state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from references.bouncing_ball import bouncing_ball
from references.digital_control import digital_control
from references.impact_oscillator import exact_example_1, exact_example_2
from references.oscillators import oscillator
from references.stiff_switch import stiff_switch
from references.thermostat import thermostat
from scipy.integrate import solve_ivp
from shipped import shipped

import hsdsl
from hsdsl.analysis import exact
from hsdsl.analysis.exact.references import residual
from hsdsl.analysis.store import load

ZENO = 12.850588106343579


# name: (model, the execution of it)
SCENES: dict[str, tuple[str, Callable[..., Any]]] = {
    "oscillator 1": ("oscillator-with-stop-1", lambda: oscillator(1)),
    "oscillator 2": ("oscillator-with-stop-2", lambda: oscillator(2)),
    "ball": ("bouncing-ball", bouncing_ball),
    "ball past its Zeno point": ("bouncing-ball", lambda: bouncing_ball(until=15)),
    "thermostat": ("thermostat", thermostat),
    "stiff switch": ("stiff-switch", stiff_switch),
    "digital control": ("digital-control", digital_control),
    "digital control, x behind": ("digital-control", lambda: digital_control("-1.1", -1)),
    "digital control, y behind": ("digital-control", lambda: digital_control(-1, "-1.1")),
    "digital control, to a guard": ("digital-control", lambda: digital_control(until=1)),
}


@lru_cache
def scene(name: str) -> Any:
    """An exact execution with its model's name on it, made once."""
    of, make = SCENES[name]
    return replace(make(), digest=shipped(of).program.digest)


FIRST = [
    (0.0921688846962224, 25.63319276295),
    (2.50726703183029, 9.553841056913),
    (5.17014144099789, 6.423540818419),
    (7.59723563299129, 23.51720843596),
    (12.6384702081505, 26.51527341105),
    (15.1125718953819, 4.867779979315),
]
FIRST_AFTER_REST = [
    (4.666529220829659, 0.20074827327271),
    (4.890984802322314, 0.094864277230307),
    (4.982391960472027, 0.04608270512409),
]


def test_oscillator_1_as_known() -> None:
    run = scene("oscillator 1")
    impacts = [(t.time, t.before["v"]) for t in run.transitions]
    assert len(impacts) == 49
    assert np.allclose(impacts[:6], FIRST, rtol=0, atol=1e-11)
    assert np.allclose(impacts[-1], (123.216813425158, 12.98447924966), rtol=0, atol=1e-11)
    end = [run.final.state[name] for name in "xv"]
    assert np.allclose(end, (12.9901145114182240, 17.3732865289423411), rtol=0, atol=1e-14)
    assert run.verdict.theorem == "holds"
    assert "misses the stop by 0.0403" in run.verdict.reasons[1]


def test_oscillator_2_as_known() -> None:
    run = scene("oscillator 2")
    impacts = [(t.time, t.before["v"]) for t in run.transitions]
    assert np.allclose(impacts[:3], FIRST_AFTER_REST, rtol=0, atol=1e-14)
    assert np.allclose([t for t, _ in impacts[3:5]], [5.024481807718650, 5.044750230855995], rtol=0, atol=1e-14)
    second = [t for t, _ in impacts if t > 6]
    assert abs(second[0] - 10.949714528009245) <= 2e-14
    for last, zeno in ((max(t for t, _ in impacts if t < 6), 5.064540575784349), (second[-1], 11.347725882963935)):
        assert zeno - 1e-13 <= last <= zeno + 1e-14
    for t, moving in (
        (0, False),
        (2.49, False),
        (2.51, True),
        (5.0646, False),
        (8.78, False),
        (8.79, True),
        (12, False),
    ):
        assert (run(t).state != {"x": -0.8, "v": 0.0}) is moving
    assert run.final.state == {"x": -0.8, "v": 0.0}
    assert run.verdict.theorem == "left"


def test_ball_as_known() -> None:
    """Bounces accumulate at the Zeno point, and it lies still behind it."""
    run = scene("ball past its Zeno point")
    assert ZENO - 1e-13 <= run.transitions[-1].time <= ZENO + 1e-14
    assert run(ZENO + 1e-9).state == run.final.state == {"h": 0.0, "v": 0.0}
    assert run.verdict.theorem == "left"
    assert scene("ball").verdict.theorem == "holds"
    assert [t.time for t in scene("ball").transitions] == [t.time for t in run.transitions[:12]]


@pytest.mark.parametrize("d", ["1e-1", "1e-3", "1e-6", "1e-20"])
def test_digital_control_beside_the_diagonal(d: str) -> None:
    """The side is right however small d is; at t = 2 (1 - d, 1 - d/5) and (1 - 3 d/10, 1 - d)."""
    behind_x, behind_y = digital_control(-1 - Fraction(d)), digital_control(-1, -1 - Fraction(d))
    assert [t.target for t in behind_x.transitions] == ["D1", "D3"]
    assert [t.target for t in behind_y.transitions] == ["D2", "D3"]
    assert behind_x.final.state == {"x": float(1 - Fraction(d)), "y": float(1 - Fraction(d) / 5)}
    assert behind_y.final.state == {"x": float(1 - 3 * Fraction(d) / 10), "y": float(1 - Fraction(d))}


def test_digital_control_on_the_diagonal() -> None:
    first, second = scene("digital control").transitions
    assert (first.edge, first.alternatives, second.edge, second.alternatives) == ("D0->D2", ("D0->D1",), "D2->D3", ())
    assert first.time == second.time == 1
    assert scene("digital control, to a guard").final.mode == "D3"


def reference(name: str) -> Callable[[Any], tuple[Any, ...]]:
    """State at a time, to thirty digits or more, by the shortest way there is."""
    mp = mpmath.mp.clone()
    mp.dps = 40

    def ball(t: Any) -> tuple[Any, ...]:
        t = mp.mpf(float(t))
        g, v, start = mp.mpf("9.81"), mp.sqrt(2 * mp.mpf("9.81") * 10), -mp.sqrt(20 / mp.mpf("9.81"))
        while t >= start + 2 * v / g:
            start, v = start + 2 * v / g, v * mp.mpf("0.8")
            if v < mp.mpf(10) ** -30:
                return mp.mpf(0), mp.mpf(0)
        s = t - start
        return s * (v - g * s / 2), v - g * s

    def heater(t: Any) -> tuple[Any, ...]:
        t = mp.mpf(float(t))
        up, period = 10 * mp.log(mp.mpf(10) / 8), 10 * mp.log(mp.mpf(12) / 8)
        if t < up:
            return (30 - 10 * mp.exp(-t / 10),)
        k = mp.floor((t - up) / period)
        s = t - up - k * period
        return (10 + 12 * mp.exp(-s / 10),) if k % 2 == 0 else (30 - 12 * mp.exp(-s / 10),)

    def two_states(t: Any) -> tuple[Any, ...]:
        """By variation of constants, mode by mode, with the switches by bisection."""
        t, start, x, up = mp.mpf(float(t)), mp.mpf(0), (mp.mpf("4.2"), mp.mpf("0.3")), True
        fast, slow = mp.mpf(2_700_000), mp.mpf("3.5651205")
        while True:
            shift, goal, level = [mp.mpf(v) for v in (("0.4", "5.5", "5.8") if up else ("-0.3", "2.73", "2.5"))]

            def at(s: Any, x: Any = x, shift: Any = shift, goal: Any = goal) -> tuple[Any, Any]:
                y = (x[1] - goal) * fast / (fast - slow)
                drift = y * (mp.exp(-slow * s) - mp.exp(-fast * s))
                return (x[0] - shift - goal) * mp.exp(-fast * s) + shift + goal + drift, goal + (x[1] - goal) * mp.exp(
                    -slow * s
                )

            low, high, sign = mp.mpf(0), mp.mpf(2), 1 if up else -1
            for _ in range(140):
                middle = (low + high) / 2
                low, high = (low, middle) if sign * (at(middle)[0] - level) >= 0 else (middle, high)
            if t < start + low:
                return at(t - start)
            start, x, up = start + low, (level, at(low)[1]), not up

    def quadrants(x: Fraction, y: Fraction) -> Callable[[Any], tuple[Any, ...]]:
        def at(t: Any) -> tuple[Any, ...]:
            t = Fraction(t)
            first, last = min(-x, -y), max(-x, -y)
            between, after = max(0, min(t, last) - first), max(0, t - last)
            slow = Fraction("0.7") * between if x > y else x + min(t, first) + between + after
            if x > y:
                return min(t, first) + x + slow + after, y + t
            return x + t, min(t, first) + y + Fraction("0.8") * between + after

        return at

    known: dict[str, Callable[[Any], tuple[Any, ...]]] = {
        "oscillator 1": lambda t: exact_example_1().exactly(t),
        "oscillator 2": lambda t: exact_example_2().exactly(t),
        "ball": ball,
        "ball past its Zeno point": ball,
        "thermostat": heater,
        "stiff switch": lru_cache(two_states),
        "digital control": quadrants(Fraction(-1), Fraction(-1)),
        "digital control, x behind": quadrants(Fraction("-1.1"), Fraction(-1)),
        "digital control, y behind": quadrants(Fraction(-1), Fraction("-1.1")),
        "digital control, to a guard": quadrants(Fraction(-1), Fraction(-1)),
    }
    return known[name]


STATED = {"oscillator 1": 6e-13, "oscillator 2": 1e-14, "stiff switch": 1.1e-9}  # half a unit of a time, times 2e6


@pytest.mark.parametrize("name", SCENES)
def test_the_stated_error_holds_at_random_times(name: str) -> None:
    run, truth = scene(name), reference(name)
    assert run.settings["error"] <= STATED.get(name, 2e-13)
    end = float(run.times[-1])
    times = np.random.default_rng(1).uniform(0, end, 100)
    # and just behind and before the transitions, where round-off of their times shows
    near = [np.nextafter(t.time, to) for t in run.transitions[:20] for to in (0, end)]
    times = np.array([t for t in (*times, *near) if all(t != other.time for other in run.transitions)])
    columns = run.sample(times)
    expected = [truth(float(t)) for t in times]
    worst = 0.0
    for k, column in enumerate(columns.state_columns.T):
        for value, exactly in zip(column, expected, strict=True):
            off = Fraction(float(value)) - exactly[k] if isinstance(exactly[k], Fraction) else exactly[k] - float(value)
            worst = max(worst, abs(float(off)))
    assert worst <= run.settings["error"]


DEFECTS = {"stiff switch": 2e-10}  # pieces of 2e-7 s: values right to 1e-14 leave that much in a slope of 1e5


@pytest.mark.parametrize("name", SCENES)
def test_it_solves_the_model_as_written(name: str) -> None:
    assert residual(shipped(SCENES[name][0]).program, scene(name)) <= DEFECTS.get(name, 1e-11)


def test_rest_is_where_the_flow_pushes_out() -> None:
    """The mass stays on the stop while cos t >= -0.8, and no longer."""
    run = scene("oscillator 2")
    rests = [a for a in run.arcs if np.all(run.values[a.first : a.last + 1] == (-0.8, 0.0)) and a.last > a.first]
    rests = [a for a in rests if run.times[a.last] > run.times[a.first] + 1e-9]
    assert len(rests) == 3
    for arc in rests:
        times = np.linspace(run.times[arc.first], run.times[arc.last], 50)
        assert np.all(np.cos(times) >= -0.8 - 1e-15)
    released = [run.times[a.last] for a in rests[:2]]
    assert np.allclose(released, [2.498091544796509, 8.781276851976095], rtol=0, atol=1e-14)


def test_another_integrator_finds_the_first_impacts() -> None:
    def flow(t: float, x: Any) -> list[float]:
        return [x[1], 20 * np.cos(2.5 * t) - 0.1 * x[1] - 6.25 * x[0]]

    def stop(t: float, x: Any) -> float:
        return x[0] - 14

    stop.terminal, stop.direction = True, 1  # type: ignore[attr-defined]
    t, x = 0.0, [11.36, 31.4]
    for impact in scene("oscillator 1").transitions[:6]:
        found = solve_ivp(
            flow, (t, t + 10), x, "DOP853", events=stop, rtol=1e-13, atol=1e-13, max_step=0.05, dense_output=True
        )
        t, v = float(found.t_events[0][0]), float(found.y_events[0][0][1])
        assert abs(t - impact.time) <= 1e-10
        assert abs(v - impact.before["v"]) <= 1e-9
        t, x = t + 1e-9, [14 - 1e-9 * 0.9 * v, -0.9 * v + 1e-9 * flow(t, [14, -0.9 * v])[1]]


@pytest.mark.parametrize("name", SCENES)
def test_it_is_an_execution_like_any_other(name: str, tmp_path: Path) -> None:
    run = scene(name)
    assert (run.scheme, run.engine, run.digest) == ("exact", "closed form", shipped(SCENES[name][0]).system.digest)
    run.save(tmp_path / "run.npz")
    assert load(tmp_path / "run.npz") == run
    assert "closed form" in run._repr_html_()
    assert run.settings["source"].startswith("closed form")
    for t in run.transitions:
        assert t.time == t.resumed


def test_the_two_sides_of_a_jump_are_the_rows() -> None:
    run = scene("oscillator 1")
    for t in run.transitions:
        assert run(t.time, side="left").state == t.before
        assert run(t.time).state == t.after


REFUSED: dict[str, Callable[[], Any]] = {
    "example 3": lambda: oscillator(3),
    "a start outside": lambda: digital_control("0.1", -1),
    "no number": lambda: digital_control("east"),
    "not finite": lambda: bouncing_ball(float("inf")),
    "restitution 1": lambda: bouncing_ball(e=1),
    "too hot": lambda: thermostat(23),
    "until below 0": lambda: thermostat(until=-1),
    "above the level": lambda: stiff_switch(6),
    "not stiff": lambda: stiff_switch(fast=3),
    "too many digits": lambda: exact.precise(shipped("thermostat"), 20),
    "a run that stops": lambda: exact.precise(shipped("bouncing-ball"), 4, max_transitions=2),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str) -> None:
    with pytest.raises(hsdsl.UsageError):
        REFUSED[case]()


def test_refined_pendulum() -> None:
    """Against Taylor series: the error that is stated bounds what it is off by."""
    run = exact.precise(shipped("constrained-pendulum"), 6, until=3)
    assert len(run.transitions) == 4
    for found, known in zip(
        run.transitions, exact.reference(shipped("constrained-pendulum")).transitions, strict=False
    ):
        assert abs(found.time - known.time) <= run.settings["error"] <= 1e-6
        assert abs(found.before["w"] - known.before["w"]) <= run.settings["error"]
        assert abs(found.after["w"] - known.after["w"]) <= run.settings["error"]
        assert found.resumed == found.time
    assert all(arc.kind == "flow" for arc in run.arcs)


def test_refined_ball_between_its_bounces(tmp_path: Path) -> None:
    run = exact.precise(shipped("bouncing-ball"), 8, until=4)
    truth = bouncing_ball(until=4)
    times = np.linspace(0.01, 3.99, 200)
    for name in ("h", "v"):
        assert np.max(np.abs(run.sample(times)[name] - truth.sample(times)[name])) <= run.settings["error"]
    run.save(tmp_path / "run.npz")
    assert load(tmp_path / "run.npz") == run


RUNNER = {
    "0": ([0.2435646781063, 0.2435646781063, 0.6755930236353, 0.6755930236353, 0.9259377788821], {"th": 0, "w": 0}),
    "-0.4": (
        [0.2043666230745, 0.2419518050349, 0.6049710813402, 0.6091929509614, 0.6683909550717],
        {"x": 2.3618733996885, "z": 0.6055261514604, "th": -0.1227264410551, "w": 0.0125403527471},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("w", RUNNER)
def test_refined_runner(w: str) -> None:
    """Against two integrators of high order, which agree to eleven digits."""
    times, end = RUNNER[w]
    run = exact.precise(shipped("pronking-runner"), 11, initial={"w": w})
    assert np.allclose([t.time for t in run.transitions], times, rtol=0, atol=2e-11)
    for name, value in end.items():
        assert abs(run.final.state[name] - value) <= 2e-11
