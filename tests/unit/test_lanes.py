"""Ensembles whose runs step many at once: every one has the bits of its single run."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
import pytest
from conformance.test_conformance import CASES
from conformance.test_conformance import model as of_case
from engines import needs_compiler
from shipped import MODELS

import hsdsl
from hsdsl.engine.backends.c.lanes import lane_source
from hsdsl.engine.runtime import library
from hsdsl.engine.runtime.library import vectors
from hsdsl.engine.simulate import ensemble
from hsdsl.engine.simulate.ensemble import BY_INSTANCE, CompiledEnsemble, Kept, ThreadWorkspace

pytestmark = [needs_compiler, pytest.mark.skipif(vectors() is None, reason="no vectors are known of this processor")]
COUNT = 20  # instances: the lanes are filled again, and at the end some are empty
BY: dict[str, Any] = {"scheme": "located", "method": "taylor", "threads": 1}
TEXT = """
hsdsl: 1
modes:
  a: {flow: {x: y, y: "FLOW"}, transitions: [{when: x >= 1, to: a, reset: {x: -1}}]}
initial: {mode: a, x: 0, y: 1}
experiment: {until: 9}
"""


class Together:
    """Runs ensembles with lanes and without, and compares what is kept of them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.teams: list[Any] = []
        self.kept: list[Kept] = []
        self.lanes = False
        look, join, told = CompiledEnsemble.look_for_lanes, ThreadWorkspace.join, Kept.told
        monkeypatch.setattr(ensemble, "FEWEST_IN_LANES", 1)
        monkeypatch.setattr(CompiledEnsemble, "look_for_lanes", lambda own, compiles: self.lanes and look(own, True))
        monkeypatch.setattr(ThreadWorkspace, "join", lambda own, *given: (join(own, *given), self.teams.append(own))[0])
        monkeypatch.setattr(Kept, "told", lambda own: (self.kept.append(own), told(own))[1])

    def compare(self, model: hsdsl.Model, **call: Any) -> hsdsl.Ensemble:
        """The ensemble, of which every number that is kept has the same bits with lanes and without."""
        self.kept.clear()
        for self.lanes in (False, True):
            found = model.ensemble(**BY | {"transition_times": 30} | call)
        alone, together = self.kept
        for name in BY_INSTANCE:
            assert getattr(alone, name).tobytes() == getattr(together, name).tobytes(), name
        return found

    @property
    def stepped(self) -> int:
        """Steps that lanes have made."""
        return sum(team.team.stepped - team.team.failed for team in self.teams)

    @property
    def located(self) -> float:
        """The share of crossings that lanes have found."""
        return sum(team.team.located for team in self.teams) / sum(team.team.crossed for team in self.teams)

    @property
    def jumped(self) -> float:
        """The share of these at which they have made the transition."""
        return sum(team.team.jumped for team in self.teams) / sum(team.team.located for team in self.teams)


@pytest.fixture
def together(monkeypatch: pytest.MonkeyPatch) -> Together:
    return Together(monkeypatch)


def varied(model: hsdsl.Model, seed: int = 1) -> dict[str, Any]:
    """Initial values near those of the model."""
    rng = np.random.default_rng(seed)
    first = model.simulate(until=0).values[0].tolist()
    parts = {name.partition(".")[0] for name in model.program.all_states if "." in name}
    return {
        name: value * rng.uniform(0.99, 1.01, COUNT) + rng.uniform(-1e-3, 1e-3, COUNT) * (k % 2)
        for k, (name, value) in enumerate(zip(model.program.initial_states, first, strict=False))
        if name not in parts  # whose mode it is
    }


@pytest.mark.parametrize("samples", [None, 33])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-10])
@pytest.mark.parametrize("name", ["oscillator-with-stop-1", "oscillator-with-stop-2", "pronking-runner", "thermostat"])
def test_models(together: Together, name: str, tolerance: float, samples: int | None) -> None:
    model = hsdsl.load(MODELS / f"{name}.yaml")
    until = {"until": 25} if name.startswith("oscillator") else {}
    together.compare(model, initial=varied(model), samples=samples, tolerance=tolerance, **until)
    assert together.stepped > 100


def test_parameters_limits_and_ends(together: Together) -> None:
    rng = np.random.default_rng(2)
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    given = {"parameters": {"c": rng.uniform(0.3, 0.95, COUNT)}, "until": 30}
    assert set(together.compare(model, **given, max_transitions=7).stop) == {"transition_limit"}
    assert set(together.compare(model, **given, threads=2).stop) == {"until"}
    assert set(together.compare(model, **given, scale={"x": 100}).stop) == {"until"}


def test_fixed_steps(together: Together) -> None:
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    together.compare(model, initial=varied(model), until=12, step=0.05)
    assert together.stepped > 1000


@pytest.mark.parametrize(("name", "share"), [("oscillator-with-stop-1", 0.9), ("pronking-runner", 0.3)])
def test_crossings_are_found_in_lanes(together: Together, name: str, share: float) -> None:
    model = hsdsl.load(MODELS / f"{name}.yaml")  # the feet of the runner touch down one by one, or both at once
    for seed in range(2):
        together.compare(model, initial=varied(model, seed), samples=7 * seed or None, tolerance=1e-10)
    assert together.located > share


@pytest.mark.parametrize(
    ("name", "call", "share"),
    [
        ("oscillator-with-stop-1", {"until": 25}, 0.9),
        ("thermostat", {}, 0.9),  # from mode to mode
        ("bouncing-ball", {"tolerance": 1e-8}, 0.5),  # to where it stays on the ground
        ("pronking-runner", {}, 0.95),  # to a final mode
    ],
)
def test_transitions_are_made_in_lanes(together: Together, name: str, call: dict[str, Any], share: float) -> None:
    model = hsdsl.load(MODELS / f"{name}.yaml")
    for samples in (None, 9):
        together.compare(model, initial=varied(model), samples=samples, **call)
    assert together.jumped > share


TIED = """
hsdsl: 1
modes:
  a:
    flow: {x: v, y: v, v: 1 - v}
    transitions:
      - {when: x >= 1, to: b, reset: {x: -1}}
      - {when: y >= 1, to: b, reset: {y: -1}, priority: 1}
  b:
    flow: {x: v, y: v, v: 1 - v}
    transitions:
      - {when: x >= 1, to: a, reset: {x: -2, v: v/2}}
      - {when: y >= 1, to: end, reset: {y: -2}}
  end: {final: true}
initial: {mode: a, x: 0, y: 0, v: 1}
experiment: {until: 20}
"""


@pytest.mark.parametrize("model", [TIED, (MODELS / "pronking-runner.yaml").read_text()])
def test_edges_that_are_crossed_together(together: Together, model: str) -> None:
    """The one goes that has the higher priority, or comes first; the other at once, alone, from where that has led."""
    name = "x" if model is TIED else "z"
    varied = {name: np.linspace(0.3, 0.6, COUNT) + (name == "z")}
    for samples in (None, 9):
        found = together.compare(
            hsdsl.loads(model), initial=varied | ({"y": varied["x"]} if name == "x" else {}), samples=samples
        )
        assert set(found.stop) == {"final"}
    assert together.located > 0.8
    assert together.jumped > 0.95


def test_four_lanes(together: Together, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "vectors", lambda: ("-mavx2", "-mfma"))
    model = hsdsl.load(MODELS / "oscillator-with-stop-1.yaml")
    together.compare(model, initial=varied(model), until=25)
    assert together.teams[0].team.stepped <= 4 * together.teams[0].team.steps


@pytest.mark.parametrize(
    "flow", ["-x", "cos(3*t) - x**3", "sqrt(1 + x*x) - 2*exp(y/4)", "(1 + x*x)**(1/3) - atan(y) - x"]
)
def test_flows(together: Together, flow: str) -> None:
    model = hsdsl.loads(TEXT.replace("FLOW", flow))
    together.compare(model, initial={"x": np.linspace(-0.9, 0.9, COUNT), "y": np.linspace(-2, 2, COUNT)}, samples=9)
    assert together.stepped > 100


def aligned(count: int) -> np.ndarray:
    """Memory for numbers, where vectors may begin."""
    memory = np.empty(count + 8)
    return memory[-(memory.ctypes.data // 8) % 8 :][:count]


TURNS = """
#include "lane.h"

HS_EXPORT int turn(const hs_wide *x, hs_wide *sines, hs_wide *cosines, int count) {
  hs_wide of = wide_all(0.0);
  int bad = 0, quick = 0;
  for (int i = 0; i < count; i++) {
    sines[i] = wide_sin(x[i], &bad), cosines[i] = wide_cos(x[i], &bad);
    quick += __builtin_popcount(bits_of(quick_sin(x[i], &of))) + __builtin_popcount(bits_of(quick_cos(x[i], &of)));
  }
  return bad ? -1 : quick;
}
"""


@pytest.mark.parametrize("flags", [("-mavx2", "-mfma"), ("-mavx512f", "-mavx512dq", "-mavx512vl")])
def test_sines_and_cosines_have_the_bits_of_the_library(flags: tuple[str, ...]) -> None:
    if len(flags) > len(vectors() or ()):
        pytest.skip("this processor has shorter vectors")
    turn = library.load(f"turns {flags}", "turn", lambda: [TURNS], flags).turn
    rng, count = np.random.default_rng(6), 80_000
    near = np.pi / 2 * rng.integers(-50, 50, count) + rng.normal(0, 1, count) * 2.0 ** rng.integers(-40, -1, count)
    wide = rng.uniform(-1, 1, count) * 2.0 ** rng.integers(-30, 60, count)
    special = [0.0, -0.0, math.nan, 2.0**20, 5e-324, 1e300, math.pi / 2, -math.pi]
    x, sines, cosines = (aligned(3 * count + 8) for _ in range(3))
    x[:] = np.concatenate((rng.uniform(-4, 4, count), near, wide, special))
    quick = turn(
        *(ctypes.c_void_p(part.ctypes.data) for part in (x, sines, cosines)), len(x) // (8 if len(flags) > 2 else 4)
    )
    assert np.array([*map(math.sin, x)]).tobytes() == sines.tobytes()
    assert np.array([*map(math.cos, x)]).tobytes() == cosines.tobytes()
    assert quick > len(x)  # of two for each


def test_lanes_without_a_value_are_left_to_single_runs(together: Together) -> None:
    model = hsdsl.loads(TEXT.replace("FLOW", "log(1/2 - x)"))
    found = together.compare(model, initial={"x": np.linspace(-0.9, 0.9, COUNT), "y": 0.1})
    assert len(set(found.stop)) > 1


def test_a_program_has_lanes_where_a_flow_is_smooth() -> None:
    assert lane_source(hsdsl.loads(TEXT.replace("FLOW", "max(x, y)")).program) is None
    assert "hs_lane_mode" in (lane_source(hsdsl.loads(TEXT.replace("FLOW", "-x")).program) or "")


@pytest.mark.campaign
@pytest.mark.parametrize("name", CASES)
def test_every_case(together: Together, name: str) -> None:
    model = of_case(name)
    together.compare(model, initial=varied(model), samples=17)
    together.compare(model, initial=varied(model, 2), tolerance=1e-6)
