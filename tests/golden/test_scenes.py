"""The paper's scenes against their exact solutions, as a person would run them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from references.digital_control import digital_control
from references.impact_oscillator import Motion, exact_example_1, exact_example_2
from shipped import MODELS, shipped

import hsdsl

NAMES = sorted(path.stem for path in MODELS.glob("*.yaml"))


@lru_cache
def default(name: str) -> Any:
    """A model's own experiment, run once."""
    return shipped(name).simulate()


VERDICTS = {
    "bouncing-ball": "holds",
    "constrained-pendulum": "holds",
    "digital-control": "holds",
    "oscillator-with-stop-1": "unknown",  # its step is fixed
    "oscillator-with-stop-2": "left",
    "pronking-runner": "holds",
    "stiff-switch": "holds",
    "thermostat": "holds",
}


@pytest.mark.parametrize("name", NAMES)
def test_a_models_own_experiment_gets_to_its_end(name: str) -> None:
    run = default(name)
    assert run.stop.complete, run.stop.message
    assert run.verdict.theorem == VERDICTS[name]
    assert run.verdict.reasons


OSCILLATORS = [
    ("oscillator-with-stop-1", exact_example_1, "1e-3", "2e-8", 49, 4e-4),
    ("oscillator-with-stop-1", exact_example_1, "5e-4", "1e-8", 49, 1e-4),
    ("oscillator-with-stop-2", exact_example_2, "1e-2", "2e-7", None, 1e-5),
]


@pytest.mark.parametrize(("name", "exact", "step", "relaxation", "impacts", "bound"), OSCILLATORS)
def test_oscillator(name: str, exact: Any, step: str, relaxation: str, impacts: int | None, bound: float) -> None:
    """Largest position error at the samples (the paper's rho-hat), through both Zeno points in example 2."""
    solution: Motion = exact()
    run = shipped(name).simulate(method="midpoint", step=step, relaxation=relaxation)
    assert impacts is None or len(run.transitions) == impacts == len(solution.impacts)
    assert np.max(np.abs(run.values[:, 0] - solution.at(run.times)[0])) <= bound


def corrected(run: Any) -> list[float]:
    """Transition times less the delays of earlier transitions."""
    delay, times = 0.0, []
    for transition in run.transitions:
        times.append(transition.time - delay)
        delay += transition.resumed - transition.time
    return times


def test_pendulum_switches_as_written() -> None:
    run, exact = default("constrained-pendulum"), hsdsl.exact.reference(shipped("constrained-pendulum"))
    assert np.allclose(corrected(run), [t.time for t in exact.transitions], rtol=0, atol=1e-6)


RUNNER = {
    "0": [0.2435646781063, 0.2435646781063, 0.6755930236353, 0.6755930236353, 0.9259377788821],
    "-0.4": [0.2043666230745, 0.2419518050349, 0.6049710813402, 0.6091929509614, 0.6683909550717],
}


@pytest.mark.parametrize("w", RUNNER)
def test_runner_events_as_written(w: str) -> None:
    run = shipped("pronking-runner").simulate(initial={"w": w})
    assert run.stop.reason == "final"
    assert run.final.mode == "apex"
    assert np.allclose(corrected(run), RUNNER[w], rtol=0, atol=1e-6)


@pytest.mark.parametrize("relaxation", ["1e-8", "1e-5", "1e-2"])
def test_runner_lands_on_both_legs_without_turning(relaxation: str) -> None:
    """One strip after the other, the second from where the first ended, so the symmetry theta = 0 is kept."""
    run = shipped("pronking-runner").simulate(relaxation=relaxation)
    first, second = run.transitions[:2]
    assert (first.edge, first.alternatives) == ("aerial->left", ("aerial->right",))
    assert second.edge == "left->ground"
    assert second.time == first.resumed
    assert abs(second.resumed - second.time - float(relaxation)) <= float(relaxation)
    theta = run.values[:, run.arcs[0].states.index("th")]
    assert np.max(np.abs(theta)) <= 1e-14


@pytest.mark.parametrize("w", RUNNER)
def test_runner_keeps_its_energy(w: str) -> None:
    """Kinetic, potential and spring energy, m = I = l = d = 1, k = 30: at lift-off and touchdown springs are slack."""
    run = shipped("pronking-runner").simulate(initial={"w": w}, tolerance="1e-12", relaxation="1e-9")

    def energy(state: dict[str, float]) -> float:
        total = 9.81 * state["z"] + (state["vx"] ** 2 + state["vz"] ** 2 + state["w"] ** 2) / 2
        for side, foot in ((0.5, "pl"), (-0.5, "pr")):
            if foot in state:
                hip = state["x"] + side * np.cos(state["th"]), state["z"] + side * np.sin(state["th"])
                total += 15 * (1 - np.hypot(hip[0] - state[foot], hip[1])) ** 2
        return float(total)

    at_start = 9.81 * 1.1 + (3.4**2 + float(w) ** 2) / 2
    states = [run(t).state for t in np.linspace(0, run.stop.time, 101)]
    drift = max(abs(energy(state) - at_start) for state in states)
    assert drift <= 1e-9, drift


@pytest.mark.parametrize(("dx", "dy", "path"), [("0.1", "0", [0, 1, 3]), ("0", "0.1", [0, 2, 3])])
def test_digital_control_from_beside_the_diagonal(dx: str, dy: str, path: list[int]) -> None:
    run = default_beside(dx, dy)
    assert [t.source for t in run.transitions] + [run.final.mode] == [f"D{k}" for k in path]
    assert all(not t.alternatives for t in run.transitions)
    state = digital_control(-1 - float(dx), -1 - float(dy)).final.state
    expected = [state["x"], state["y"]]
    assert np.allclose([run.final.state["x"], run.final.state["y"]], expected, rtol=0, atol=3e-4)


def default_beside(dx: str, dy: str) -> Any:
    """The run from (-1 - dx, -1 - dy), relaxation 1e-4."""
    start = {"x": f"-1 - {dx}", "y": f"-1 - {dy}"}
    return shipped("digital-control").simulate(scheme="relaxed", relaxation="1e-4", initial=start)


def test_digital_control_on_the_diagonal_says_what_it_passed_over() -> None:
    run = default_beside("0", "0")
    first, second = run.transitions
    assert (first.edge, first.alternatives) == ("D0->D2", ("D0->D1",))
    assert (second.edge, second.alternatives) == ("D2->D3", ())
    assert second.time == first.resumed
    # two strips: (-2 eps, -2 eps) off, up to what a speed below one adds
    assert np.allclose([run.final.state["x"], run.final.state["y"]], [1 - 2e-4, 1 - 2e-4], rtol=0, atol=1e-9)
