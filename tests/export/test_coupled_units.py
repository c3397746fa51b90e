"""A plant and its controller exported apart and stepped by FMPy: how late they switch (docs/how-to/export.md)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest

import hsdsl
from hsdsl.export import files_of, source_of

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
from fmpy.fmi2 import FMU2Slave  # noqa: E402

pytestmark = pytest.mark.exports

UNTIL, HOT, COLD, LOW, HIGH, START, RATE = 20, 26, 10, 18, 20, 19, 8
ROOM = """
hsdsl: 1
inputs: {u: 0}
modes: {m: {flow: {T: '-(T - 10)/8 + 2*u'}}}
outputs: {y: T}
initial: {mode: m, T: 19}
experiment: {until: 20, tolerance: 1e-10}
"""
CONTROLLER = """
hsdsl: 1
inputs: {y: 19}
modes:
  heating: {flow: {n: 0}, outputs: {u: 1}, transitions: [{when: y >= 20, to: idle, reset: {n: n + 1}}]}
  idle: {flow: {n: 0}, outputs: {u: 0}, transitions: [{when: y <= 18, to: heating, reset: {n: n + 1}}]}
initial: {mode: heating, n: 0}
experiment: {until: 20}
"""
COMPOSED = """
hsdsl: 1
modes:
  heating: {flow: {T: '-(T - 10)/8 + 2'}, transitions: [{when: T >= 20, to: idle}]}
  idle: {flow: {T: '-(T - 10)/8'}, transitions: [{when: T <= 18, to: heating}]}
initial: {mode: heating, T: 19}
experiment: {until: 20, tolerance: 1e-10}
"""


def exact() -> list[float]:
    """When the composed model switches: exponentials between the thresholds."""
    t, T, heats, found = 0.0, float(START), True, list[float]()
    while True:
        target, threshold = (HOT, HIGH) if heats else (COLD, LOW)
        t += RATE * math.log((target - T) / (target - threshold))
        if t > UNTIL:
            return found
        T, heats = threshold, not heats
        found.append(t)


class Unit:
    """A unit of FMI 2 for co-simulation, ready to step."""

    def __init__(self, text: str, folder: Path) -> None:
        model = hsdsl.loads(text)
        (name, content), = files_of(source_of(model, {}), "fmi2").items()  # fmt: skip
        path = folder / name
        path.write_bytes(content)
        about = fmpy.read_model_description(str(path))
        self._places = {v.name: v.valueReference for v in about.modelVariables}
        where = fmpy.extract(str(path))
        self._slave: Any = FMU2Slave(
            guid=about.guid, unzipDirectory=where, modelIdentifier=about.coSimulation.modelIdentifier, instanceName=name
        )
        self._slave.instantiate()
        self._slave.setupExperiment(startTime=0)
        self._slave.enterInitializationMode()
        self._slave.exitInitializationMode()

    def get(self, name: str) -> float:
        return self._slave.getReal([self._places[name]])[0]

    def put(self, name: str, value: float) -> None:
        self._slave.setReal([self._places[name]], [value])

    def step(self, t: float, h: float) -> None:
        self._slave.doStep(t, h)


def switches(folder: Path, per_unit: int, plant_first: bool) -> list[float]:
    """When the controller is seen to have switched, with so many steps per unit of time."""
    room, controller, found, made, h = Unit(ROOM, folder), Unit(CONTROLLER, folder), list[float](), 0.0, 1 / per_unit
    for k in range(UNTIL * per_unit):
        y, u = room.get("y"), controller.get("u")
        room.put("u", u)
        room.step(k * h, h)
        controller.put("y", room.get("y") if plant_first else y)
        controller.step(k * h, h)
        if controller.get("n") != made:
            made = controller.get("n")
            found.append((k + 1) * h)
    return found


def test_the_composed_model_has_no_such_errors() -> None:
    run = hsdsl.loads(COMPOSED).simulate()
    assert [made.time for made in run.transitions] == pytest.approx(exact(), rel=0, abs=1e-9)
    assert len(exact()) == 10


@pytest.mark.parametrize("plant_first", [False, True])
def test_coupled_units_switch_late_in_proportion_to_the_step(plant_first: bool, tmp_path: Path) -> None:
    errors: list[float] = []
    for per_unit in (100, 1000):
        found = switches(tmp_path, per_unit, plant_first)
        late = [a - b for a, b in zip(found, exact(), strict=True)]
        assert min(late) > 0
        errors.append(max(late))
    print(f"plant first: {plant_first}, largest errors at steps of 0.01 and 0.001: {errors}")
    assert 5 < errors[0] / errors[1] < 20  # of first order


@pytest.mark.parametrize("plant_first", [False, True])
def test_a_coarse_step_loses_a_switch(plant_first: bool, tmp_path: Path) -> None:
    found = switches(tmp_path, 10, plant_first)
    print(f"plant first: {plant_first}, {len(found)} switches")
    assert len(found) < len(exact())
