"""What descriptions of functional mock-up units say of modes, and of what unknowns depend on."""

from __future__ import annotations

import ctypes
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl.export import Modes, files_of, fmi, source_of
from hsdsl.export.fmi.description import token_of
from hsdsl.export.fmi.variables import unit_of
from hsdsl.interface.cli.verbs import obey

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
from fmpy.validation import validate_fmu  # noqa: E402

pytestmark = pytest.mark.exports

# y and the second guard depend on other things in either mode; w decides when a switch changes, so it cannot be driven
TEXT = """
hsdsl: 1
parameters: {k: 2, m: 3*k, q: 1}
inputs: {u: 0.1*sin(t), s: {times: [0, 1], values: [0.5, 1], hold: zero}, w: {times: [0], values: [2]}}
modes:
  a:
    flow: {x: y, y: u - k*x, z: -q*z}
    transitions: [{when: x >= 5, to: b}, {when: z + s <= -5, to: b}]
  b:
    flow: {x: floor(w*t) - x, y: m*z, z: 1 - s}
    transitions: [{when: y >= 100 + u, to: a}]
outputs: {sum: x + u, product: x*z, constant: k}
initial: {mode: a, x: 1, y: 0.5, z: 1}
experiment: {until: 2}
"""
LISTED = {
    "x": "x", "y": "y", "z": "z",
    "der(x)": "x y", "der(y)": "time u x z", "der(z)": "s z",
    "sum": "time u x", "product": "x z", "constant": "",
    "indicator[0]": "time u x y z", "indicator[1]": "s z",
}  # fmt: skip
INITIAL = {
    "m": "k", "der(x)": "y", "der(y)": "k time u x", "der(z)": "q z",
    "sum": "time u x", "product": "x z", "constant": "k",
}  # fmt: skip


def described(text: str, version: int, folder: Path, modes: Modes = "local") -> Any:
    """FMPy's description, which has no findings."""
    unit = unit_of(source_of(hsdsl.loads(text), {}), modes)
    description = getattr(fmi, f"description{version}")
    path = folder / "unit.fmu"
    path.write_bytes(fmi.archived({"modelDescription.xml": description(unit).encode()}))
    assert validate_fmu(str(path)) == []
    return fmpy.read_model_description(str(path))


def listed(unknowns: Any) -> dict[str, str]:
    return {each.variable.name: " ".join(sorted(known.name for known in each.dependencies)) for each in unknowns}


@pytest.mark.parametrize("version", [2, 3])
def test_unknowns_list_what_they_depend_on(version: int, tmp_path: Path) -> None:
    description = described(TEXT, version, tmp_path)
    unknowns = [*description.outputs, *description.derivatives, *(description.eventIndicators or ())]
    expected = LISTED if version == 3 else {k: v for k, v in LISTED.items() if not k.startswith("indicator")}
    assert listed(unknowns) == expected
    assert listed(description.initialUnknowns) == INITIAL


def test_nothing_depends_on_what_is_not_listed(tmp_path: Path) -> None:
    """By changes of each known at random states, in the unit itself."""
    ((name, content),) = files_of(source_of(hsdsl.loads(TEXT), {}), "fmi3").items()
    (path := tmp_path / name).write_bytes(content)
    description: Any = fmpy.read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    unit: Any = fmpy.instantiate_fmu(fmpy.extract(str(path)), description, "ModelExchange")
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    unit.updateDiscreteStates()
    unit.enterContinuousTimeMode()
    draw, unknowns, seen = random.Random(1), list(LISTED)[3:], {name: set[str]() for name in LISTED}

    def values(known: dict[str, float]) -> np.ndarray[Any, Any]:
        unit.setTime(known["time"])
        unit.setFloat64([reference["u"], reference["s"]], [known["u"], known["s"]])
        unit.setContinuousStates((ctypes.c_double * 3)(known["x"], known["y"], known["z"]), 3)
        return np.array(unit.getFloat64([reference[name] for name in unknowns]))

    for _ in range(50):
        known = {name: draw.uniform(-2, 2) for name in ("u", "s", "x", "y", "z")} | {"time": draw.uniform(0, 2)}
        at = values(known)
        for name in known:
            changed = values(known | {name: draw.uniform(0, 2)})
            for unknown in np.array(unknowns)[changed != at]:
                seen[unknown].add(name)
    for unknown in unknowns:
        assert seen[unknown] <= set(LISTED[unknown].split())


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("modes", "causality"), [("local", "local"), ("output", "output"), ("none", None)])
def test_the_mode_is_what_is_asked_for(modes: Modes, causality: str | None, version: int, tmp_path: Path) -> None:
    description = described(TEXT, version, tmp_path, modes)
    found = {v.name: v.causality for v in description.modelVariables}
    assert found.get("mode") == causality
    outputs = {each.variable.name for each in description.outputs}
    assert ("mode" in outputs) == (modes == "output")
    assert {v.type for v in description.modelVariables if v.causality == "output" and v.name != "mode"} <= {
        "Real",
        "Float64",
    }


def test_modes_tell_units_apart() -> None:
    sources = source_of(hsdsl.loads(TEXT), {})
    choices: tuple[Modes, ...] = ("local", "output", "none")
    assert len({token_of(unit_of(sources, modes), 3) for modes in choices}) == 3


def test_the_mode_is_asked_for_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (model := tmp_path / "model.yaml").write_text(TEXT)
    command = ["export", str(model), "--mode", "none", "--out", str(tmp_path / "unit"), "--to"]
    obey([*command, "fmi3"])
    description: Any = fmpy.read_model_description(str(tmp_path / "unit/model.fmu"))
    assert "mode" not in {v.name for v in description.modelVariables}
    assert obey([*command, "c", "--force"]) == 2
    assert "--mode belongs to --to fmi2 and --to fmi3" in capsys.readouterr().err
