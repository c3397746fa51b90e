"""What other importers make of our units: the table of importers in docs/how-to/export.md.

``install-tools.sh`` makes an environment for each importer, with the version of the table.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hsdsl
from hsdsl.export import files_of, source_of

IMPORTERS = Path(os.environ.get("HSDSL_IMPORTERS", "/opt/fmi-importers"))
HERE = Path(__file__).parent / "masters"
UNTIL, STEP = 6, 0.01
BALL = """
hsdsl: 1
modes:
  fly: {flow: {h: v, v: -9.81, n: 0}, transitions: [{when: h <= 0, to: fly, reset: {v: -0.8*v, n: n + 1}}]}
initial: {mode: fly, h: 10, v: 0, n: 0}
experiment: {until: 6, tolerance: 1e-10}
"""
DRIVER = """
hsdsl: 1
modes: {m: {flow: {s: 2.5*c, c: -2.5*s}}}
outputs: {force: 20*c}
initial: {mode: m, s: 0, c: 1}
experiment: {until: 6, tolerance: 1e-10}
"""
MASS = """
hsdsl: 1
inputs: {u: 20}
modes:
  free:
    flow: {x: v, v: u - 0.1*v - 6.25*x, n: 0}
    transitions: [{when: x >= 14, to: free, reset: {v: -0.9*v, n: n + 1}}]
initial: {mode: free, x: 11.36, v: 31.4, n: 0}
experiment: {until: 6, tolerance: 1e-10}
"""
# The steps by which a master's values of the force, and its results, are ahead of its clock.
MASTERS = [
    ("libcosimpy", "0.0.6", 2, 0, 0),
    ("ecospy", "0.7.2", 2, 0, 0),
    ("ecospy", "0.7.2", 3, 0, 0),
    ("cofmupy", "1.0.0", 2, 1, 0),
    ("cofmupy", "1.0.0", 3, 1, 0),
    ("pathsim-fmi", "0.1.1", 2, 1, 1),
    ("pathsim-fmi", "0.1.1", 3, 1, 1),
    ("jaxonomy", "3.4.1", 2, -1, 0),
    ("jaxonomy", "3.4.1", 3, -1, 0),
]


def program(importer: str, version: str) -> Path:
    """An executable of the environment of an importer, in this version."""
    python = IMPORTERS / importer / "bin" / "python"
    if not python.exists():
        pytest.skip(f"{importer} is not installed: tests/export/install-tools.sh")
    ask = f"from importlib.metadata import version; print(version('{importer}'))"
    assert subprocess.check_output([python, "-c", ask], text=True).strip() == version
    return python


def run(importer: str, version: str, units: Path, *options: str) -> dict[str, list[float]]:
    python = program(importer, version)
    script = HERE / f"in_{importer.removesuffix('-fmi')}.py"
    libraries = {**os.environ, "LD_LIBRARY_PATH": str(IMPORTERS / importer / "lib")}  # ecospy needs TBB
    command = [python, script, units, str(STEP), *options]
    printed = subprocess.run(command, env=libraries, check=True, capture_output=True, text=True).stdout
    return json.loads(next(line for line in printed.splitlines() if line.startswith("{")))


@pytest.fixture(params=[2, 3])
def units(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The units of one version of FMI."""
    return exported(request.param, tmp_path)


def exported(version: int, folder: Path) -> Path:
    for name, text in (("ball", BALL), ("driver", DRIVER), ("mass", MASS)):
        (content,) = files_of(source_of(hsdsl.loads(text), {}), f"fmi{version}").values()
        (folder / f"{name}.fmu").write_bytes(content)
    return folder


def ball_at(t: float) -> list[float]:
    """Height, velocity and number of bounces, from the closed form of the flights."""
    start, speed, bounces = math.sqrt(20 / 9.81), math.sqrt(20 * 9.81), 0
    while True:
        speed, bounces = 0.8 * speed, bounces + 1
        if t < start + 2 * speed / 9.81:
            since = t - start
            return [speed * since - 9.81 * since**2 / 2, speed - 9.81 * since, bounces]
        start += 2 * speed / 9.81


def mass_at(t: float, force: str) -> list[float]:
    text = MASS.replace("inputs: {u: 20}", f"inputs: {{u: {force}}}").replace("until: 6", f"until: {t}")
    return [*hsdsl.loads(text).simulate().final.state.values()]


@pytest.mark.tools
@pytest.mark.parametrize(("importer", "version", "fmi", "force_ahead", "ahead"), MASTERS)
def test_masters_hold_the_force_during_each_step(
    importer: str, version: str, fmi: int, force_ahead: int, ahead: int, tmp_path: Path
) -> None:
    program(importer, version)
    found = run(importer, version, exported(fmi, tmp_path))
    end = UNTIL + ahead * STEP
    assert found["ball"] == pytest.approx(ball_at(end), abs=1e-9)
    steps = range(round(end / STEP))
    values = [20 * math.cos(2.5 * max(0, k + force_ahead) * STEP) for k in steps]
    held = f"{{times: {[k * STEP for k in steps]}, values: {values}, hold: zero}}"
    assert found["mass"] == pytest.approx(mass_at(end, held), abs=1e-7)


@pytest.mark.tools
@pytest.mark.parametrize(("importer", "version"), [("pathsim-fmi", "0.1.1"), ("jaxonomy", "3.4.1")])
def test_importers_locate_impacts_of_model_exchange(importer: str, version: str, units: Path) -> None:
    found = run(importer, version, units, "exchange")
    assert found["ball"] == pytest.approx(ball_at(UNTIL), abs=1e-7)
    assert found["mass"] == pytest.approx(mass_at(UNTIL, "20*cos(2.5*t)"), abs=1e-6)


@pytest.mark.tools
def test_casadi_ignores_events(units: Path) -> None:
    found = run("casadi", "3.8.2", units)
    assert found["ball"] == pytest.approx([10 - 9.81 * 18, -9.81 * 6, 0], abs=1e-6)


@pytest.mark.tools
def test_fmutool_lists_states_and_indicators(units: Path) -> None:
    tool = program("fmu-manipulation-toolbox", "2.0").with_name("fmutool")
    told = subprocess.run([tool, "-input", units / "mass.fmu", "-summary"], check=True, capture_output=True, text=True)
    lines = [line.partition("|")[2].strip(" |") for line in (told.stdout + told.stderr).splitlines()]
    assert {"input : 1", "output : 3", "continuous states : 3", "event indicators : 1"} <= {*lines}


def fmpy_run(units: Path, name: str, **options: Any) -> Any:
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
    times = np.linspace(0, UNTIL, 6001)
    force = np.array([(t, 20 * math.cos(2.5 * t)) for t in times], dtype=[("time", float), ("u", float)])
    return fmpy.simulate_fmu(
        str(units / f"{name}.fmu"), stop_time=UNTIL, input=force if name == "mass" else None, **options
    )


@pytest.mark.exports
def test_cvode_of_fmpy_locates_impacts_unless_an_input_drives_them(units: Path) -> None:
    exchange = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-9, "output_interval": STEP}
    found = fmpy_run(units, "ball", **exchange)
    assert [found[name][-1] for name in "hvn"] == pytest.approx(ball_at(UNTIL), abs=1e-6)
    found = fmpy_run(units, "mass", **exchange)
    errors = [abs(found[name][-1] - exact) for name, exact in zip("xvn", mass_at(UNTIL, "20*cos(2.5*t)"), strict=True)]
    assert 1e-3 < max(errors) < 0.1


@pytest.mark.exports
def test_euler_of_fmpy_makes_one_step_for_each_output(units: Path) -> None:
    euler = {"fmi_type": "ModelExchange", "solver": "Euler", "output_interval": STEP}
    ends = {size: fmpy_run(units, "ball", step_size=size, **euler)["h"][-1] for size in (1e-4, 1e-2)}
    assert ends[1e-4] == ends[1e-2]
    assert abs(ends[1e-4] - ball_at(UNTIL)[0]) > 0.1


@pytest.mark.exports
def test_fmpy_sees_impacts_inside_a_step_in_event_mode_with_early_return(tmp_path: Path) -> None:
    units, exact = exported(3, tmp_path), [1.427843122927064, 3.712392119610368, 5.54003131695701]
    for event_mode in (False, True):
        for early in (False, True):
            options = {"use_event_mode": event_mode, "early_return_allowed": early}
            found = fmpy_run(units, "ball", fmi_type="CoSimulation", output_interval=STEP, **options)
            assert [found[name][-1] for name in "hvn"] == pytest.approx(ball_at(UNTIL), abs=1e-9)
            late = found["time"][1:][np.diff(found["n"]) != 0] - exact
            assert max(abs(late)) < 1e-9 if event_mode and early else 1e-4 < max(late) <= STEP
