"""Every model in ``models/`` gives what its ``reference:`` block knows.

Where the flow is the same at all times the relaxed execution is the execution delayed: transition times are compared
*corrected*, recorded time less the delays (``resumed - time``) of earlier transitions, and a state known at time T is
read off the run at T plus those delays (or at its end, which costs their sum times the speed). A forced flow does not
wait for the run, so there times are compared as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from exact.arithmetic import evaluate

import hsdsl

MODELS = {path.stem: path for path in sorted((Path(__file__).parents[2] / "models").glob("*.yaml"))}


@dataclass(frozen=True)
class Check:
    """How a model is run for its check, and how close it must come: ``time``, a state by name, ``default``."""

    within: dict[str, float]
    settings: dict[str, str] = field(default_factory=lambda: {"tolerance": "1e-12", "relaxation": "1e-9"})
    forced: bool = False


EPS = 1e-9
CHECKS: dict[str, Check] = {
    # strips delay by eps/speed at most; the state at the end is off by their sum times its largest rate
    "bouncing-ball": Check({"time": 1e-12, "default": 12 * 1.1 * EPS * 9.81}),
    "constrained-pendulum": Check({"time": 1e-9, "default": 19 * EPS * 1.3}),
    "digital-control": Check({"time": 1e-14, "default": 3 * EPS}),
    "pronking-runner": Check({"time": 1e-10, "default": 1e-10}),
    # times as the tolerance allows; the last switch is so near the end that y1 still moves at 1e6 there
    "stiff-switch": Check({"time": 2e-12, "y1": 3e6 * 2e-12, "y2": 1e-10}, {"tolerance": "1e-11", "scheme": "located"}),
    "thermostat": Check({"time": 1e-10, "default": 6 * EPS / 0.8 * 1.1}),
    # an impact's time off by 5 eps; below 60 in speed and 220 in acceleration
    "oscillator-with-stop-1": Check({"time": 5 * EPS, "x": 300 * EPS, "v": 1100 * EPS}, forced=True),
    # eps for the depth, chords of parabolas h^2/8 |x''|; past a Zeno point speeds of sqrt(2 |x''| eps/(1 - c^2)) stay
    "oscillator-with-stop-2": Check(
        {"x": 3e-6, "v": 2.2e-3}, {"method": "midpoint", "step": "1e-3", "relaxation": "1e-6"}, forced=True
    ),
}


def read(path: Path) -> Any:
    """YAML with every scalar as text."""
    return yaml.load(path.read_text(), Loader=yaml.BaseLoader)


def references() -> list[Any]:
    """Every reference of every model; a single one is written without a list."""
    found = []
    for name, path in MODELS.items():
        block = read(path).get("reference", [])
        for number, one in enumerate(block if isinstance(block, list) else [block]):
            found.append(pytest.param(name, number, one, id=f"{name}-{number}"))
    return found


def arguments(settings: dict[str, str]) -> dict[str, Any]:
    """What ``set`` overrides, as arguments of ``simulate``."""
    call: dict[str, Any] = {"parameters": {}, "initial": {}}
    for name, value in settings.items():
        group, _, key = name.rpartition(".")
        if group == "experiment":
            call[key] = value
        else:
            call["initial" if group == "initial" else "parameters"][key] = value
    return call


class Compared:
    """A run beside its reference."""

    def __init__(self, run: Any, check: Check, trust: float) -> None:
        self.run, self.check, self.trust = run, check, trust
        self.delays = [0.0]
        for transition in run.transitions:
            waits = transition.resumed is not None and not check.forced
            self.delays.append(self.delays[-1] + (transition.resumed - transition.time if waits else 0.0))

    def close(self, actual: float, expected: str, name: str, what: str) -> None:
        """Assert that a number is the reference's."""
        allowed = self.trust + (self.check.within[name] if name in self.check.within else self.check.within["default"])
        off = abs(actual - float(evaluate(expected)))
        assert off <= allowed, f"{what}: {name} off by {off:.3g}, allowed {allowed:.3g}"

    def transitions(self, known: list[Any]) -> None:
        """Compare transitions in order."""
        assert len(self.run.transitions) == len(known), [(t.edge, t.time) for t in self.run.transitions][:60]
        for k, (actual, one) in enumerate(zip(self.run.transitions, known, strict=True)):
            one = one if isinstance(one, dict) else {"time": one}
            what = f"transition {k}"
            self.close(actual.time - self.delays[k], one["time"], "time", what)
            assert actual.edge == one.get("edge", actual.edge), what
            for side in ("before", "after"):
                for name, expected in one.get(side, {}).items():
                    self.close(getattr(actual, side)[name], expected, name, f"{what} {side}")

    def states(self, known: list[Any]) -> None:
        """Compare states at known times."""
        for one in known:
            one = dict(one)
            time = float(evaluate(one.pop("time")))
            made = sum(t.time - d <= time for t, d in zip(self.run.transitions, self.delays, strict=False))
            point = self.run(min(time + self.delays[made], self.run.stop.time))
            assert point.mode == one.pop("mode", point.mode)
            for name, expected in one.items():
                self.close(float(point.state[name]), expected, name, f"state at {time}")


@pytest.mark.parametrize(("name", "block", "reference"), references())
def test_reference(name: str, block: int, reference: dict[str, Any]) -> None:
    check = CHECKS[name]
    run = hsdsl.load(MODELS[name]).simulate(**check.settings, **arguments(reference.get("set", {})))
    assert run.stop.complete, run.stop.message
    compared = Compared(run, check, float(reference["trust"]))
    if "transitions" in reference:
        compared.transitions(reference["transitions"])
    compared.states(reference.get("states", []))


@pytest.mark.parametrize(("name", "block", "reference"), references())
def test_reference_execution(name: str, block: int, reference: dict[str, Any]) -> None:
    """Every block of every model has an exact execution, and the numbers of the block are its numbers.

    A time is written in 16 digits: a state known at it is off by the rest of them times its rate.
    """
    run = hsdsl.exact.reference(hsdsl.load(MODELS[name]), block)
    hours, rises = np.diff(run.times), np.nan_to_num(np.abs(np.diff(run.values, axis=0)))
    fastest = float(np.max(rises[hours > 1e-6] / hours[hours > 1e-6, None]))
    rest = 5e-16 * max(1.0, float(run.times[-1]))
    within = {"default": run.settings["error"] + rest * fastest, "time": rest}
    compared = Compared(run, Check(within), float(reference["trust"]))
    if "transitions" in reference:
        compared.transitions(reference["transitions"])
    compared.states(reference.get("states", []))


def test_every_model_is_checked() -> None:
    assert set(CHECKS) == set(MODELS)
    assert all("reference" in read(path) for path in MODELS.values())


@pytest.mark.parametrize("name", MODELS)
def test_model_starts_with_the_modeline(name: str) -> None:
    assert MODELS[name].read_text().startswith("# yaml-language-server: $schema=../schemas/model.schema.json\n")
