"""Functional mock-up units against runs: FMPy validates and simulates them, and calls their functions one by one."""

from __future__ import annotations

import ctypes
import math
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export.c_builds import COMPILERS, USING, WARNINGS
from shipped import MODELS, assert_golden

import hsdsl
from hsdsl.engine.execution.run import Execution
from hsdsl.export import files_of, fmi, source_of
from hsdsl.export.fmi.variables import nominals, unit_of
from hsdsl.interface.model import Model

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
from fmpy.fmi1 import FMICallException  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402

pytestmark = pytest.mark.exports

STANDARD = Path(fmpy.__file__).parent / "c-code"  # the headers of both versions
NAMES = [path.stem for path in sorted(MODELS.glob("*.yaml"))]
VERSIONS = (2, 3)
BALL = """
hsdsl: 1
parameters: {g: 9.81, e: 0.7}
modes:
  fly: {flow: {h: v, v: -g}, transitions: [{name: bounce, when: h <= 0, to: fly, reset: {v: -e*v}}]}
initial: {mode: fly, h: 1, v: 0}
experiment: {until: 2.4}
"""
DRIVEN = """
hsdsl: 1
title: "]]> <a b='c'> & \\"--> ü"
units: {t: s, x: m, v: m/s, k: N/m, m: kg, u: N}
parameters: {k: {value: 4, min: 0, about: "stiffness < \\"&"}, m: 2, c: k/m, start: m/2}
inputs:
  u: sin(t)
  w: {times: [0, 1, 2], values: [0, 1, 0.5], hold: linear}
  s: {times: [0, 1.5], values: [0, 1], hold: zero}
modes:
  slide:
    flow: {x: v, v: u/m - c*x + w*x*s}
    transitions: [{name: "<hit>&", when: x >= 2, to: slide, reset: {v: -v/2}}]
outputs: {force: k*x + u}
initial: {mode: slide, x: start, v: 1}
experiment: {until: 3, tolerance: 1e-10}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Units by model and version, each made once."""
    known: dict[Any, str] = {}

    def make(text: str, version: int, **initial: float) -> str:
        key = text, version, *initial.items()
        if key not in known:
            model = hsdsl.loads(text) if "\n" in text else hsdsl.load(MODELS / f"{text}.yaml")
            ((name, content),) = files_of(source_of(model, {"initial": initial}), f"fmi{version}", "output").items()
            path = tmp_path_factory.mktemp("unit") / name
            path.write_bytes(content)
            known[key] = str(path)
        return known[key]

    yield make


def loaded(text: str) -> Model:
    return hsdsl.loads(text) if "\n" in text else hsdsl.load(MODELS / f"{text}.yaml")


def jumps(result: Any, names: list[str]) -> list[float]:
    """The times at which a result has two rows that differ."""
    same = np.diff(result["time"]) == 0
    differ = np.any([np.diff(result[name]) != 0 for name in names], axis=0)
    return list(result["time"][1:][same & differ])


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("text", [*NAMES, BALL, DRIVEN], ids=[*NAMES, "ball", "driven"])
def test_descriptions_have_no_findings(text: str, version: int, tmp_path: Path) -> None:
    unit = unit_of(source_of(loaded(text), {}))
    description = getattr(fmi, f"description{version}")
    path = tmp_path / "unit.fmu"
    path.write_bytes(fmi.archived({"modelDescription.xml": description(unit).encode()}))
    assert validate_fmu(str(path)) == []


@pytest.mark.parametrize(("version", "count"), [(2, 44), (3, 75)])
def test_all_functions_of_the_standard_are_exported(version: int, count: int, made: Any) -> None:
    text = (STANDARD / f"fmi{version}Functions.h").read_text()
    names = set(re.findall(rf"FMI{version}_Export\s+\w+\s+(fmi{version}\w+);", text))
    assert len(names) == count
    folder = Path(fmpy.extract(made(BALL, version)))
    (library,) = folder.glob("binaries/*/*.so")
    loaded_library = ctypes.CDLL(str(library))
    assert all(hasattr(loaded_library, name) for name in names)


def unit_sources(version: int, folder: Path) -> None:
    for name, content in fmi.sources_of(unit_of(source_of(loaded(DRIVEN), {})), version).items():
        (folder / name).write_bytes(content)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_sources_compile_without_warnings(compiler: str, version: int, tmp_path: Path) -> None:
    unit_sources(version, tmp_path)
    names = [name for name in fmi.compiled_names(version) if name != fmi.LOOP]  # the tests of C compile that
    command = [*COMPILERS[compiler], *WARNINGS, "-c", *names]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0 and not done.stderr, done.stderr


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_functions_agree_with_the_declarations_of_the_standard(compiler: str, version: int, tmp_path: Path) -> None:
    unit_sources(version, tmp_path)
    flags = ["-DFMI_STANDARD_HEADERS", "-isystem", str(STANDARD), "-c"]
    command = [*COMPILERS[compiler], *WARNINGS, *flags, "fmi.c", f"fmi{version}.c"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0 and not done.stderr, done.stderr


@pytest.mark.parametrize("version", VERSIONS)
def test_functions_take_the_prefix_of_a_static_link(version: int, tmp_path: Path) -> None:
    unit_sources(version, tmp_path)
    compiler = next(iter(COMPILERS.values()))
    subprocess.run([*compiler, f"-DFMI{version}_FUNCTION_PREFIX=Ball_", "-c", "fmi.c"], cwd=tmp_path, check=True)
    assert f"Ball_fmi{version}SetTime".encode() in (tmp_path / "fmi.o").read_bytes()


@pytest.mark.parametrize("version", VERSIONS)
def test_ball_in_model_exchange_and_co_simulation(version: int, made: Any) -> None:
    path, run = made(BALL, version), loaded(BALL).simulate()
    exact = [made.time for made in run.transitions]
    result = fmpy.simulate_fmu(path, fmi_type="ModelExchange", relative_tolerance=1e-10, stop_time=2.4)
    times = jumps(result, ["v"])
    assert times[0] == pytest.approx(0.4515236409857, abs=1e-6)
    assert len(times) == len(exact)
    assert times == pytest.approx(exact, abs=1e-6)
    assert result["h"].min() > -1e-8
    result = fmpy.simulate_fmu(path, fmi_type="CoSimulation", output_interval=0.1, stop_time=2.4)
    assert result["h"] == pytest.approx(run.sample(result["time"].clip(0, 2.4))["h"], abs=1e-12)


def test_ball_with_event_mode_makes_the_same_transitions(made: Any) -> None:
    run = loaded(BALL).simulate()
    result = fmpy.simulate_fmu(
        made(BALL, 3), fmi_type="CoSimulation", output_interval=0.1, stop_time=2.4, use_event_mode=True,
        early_return_allowed=True,
    )  # fmt: skip
    assert jumps(result, ["v"]) == pytest.approx([made.time for made in run.transitions], abs=1e-12)


REFERENCE = Path(os.environ.get("HSDSL_REFERENCE_FMUS", "/opt/reference-fmus"))


@pytest.mark.tools
@pytest.mark.skipif(not REFERENCE.is_dir(), reason="no Reference-FMUs here: tests/export/install-tools.sh")
@pytest.mark.parametrize("version", VERSIONS)
def test_ball_agrees_with_that_of_the_reference_units(version: int, made: Any) -> None:
    """Theirs comes to rest below 0.1 m/s, and integrates by Euler's method with 1e-3 in co-simulation."""
    paths = str(REFERENCE / f"BouncingBall{version}.fmu"), made(BALL, version)
    solver = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-10, "stop_time": 2.4, "output_interval": 0.01}
    theirs, ours = (fmpy.simulate_fmu(path, **solver) for path in paths)
    times = [jumps(result, ["v"]) for result in (theirs, ours)]
    assert len(times[0]) == len(times[1]) == 8
    assert times[1] == pytest.approx(times[0], abs=1e-6)
    theirs, ours = (theirs[np.diff(theirs["time"], append=np.inf) > 0], ours[np.diff(ours["time"], append=np.inf) > 0])
    at = np.linspace(0, 2.4, 49)
    assert np.interp(at, ours["time"], ours["h"]) == pytest.approx(np.interp(at, theirs["time"], theirs["h"]), abs=1e-4)
    steps = {"fmi_type": "CoSimulation", "stop_time": 2.4, "output_interval": 0.1}
    theirs, ours = (fmpy.simulate_fmu(path, **steps) for path in paths)
    assert np.abs(ours["h"] - theirs["h"]).max() < 0.05


@pytest.mark.parametrize("version", VERSIONS)
def test_ball_comes_to_rest_and_stays(version: int, made: Any) -> None:
    result = fmpy.simulate_fmu(made(BALL, version), fmi_type="ModelExchange", relative_tolerance=1e-10, stop_time=4)
    late = result[result["time"] > 2.6]
    assert np.all(late["v"] == 0)
    assert np.all(np.abs(late["h"]) < 1e-8)
    result = fmpy.simulate_fmu(made(BALL, version), fmi_type="CoSimulation", output_interval=0.1, stop_time=4)
    assert np.all(result[result["time"] > 2.6]["v"] == 0)


ROLLING = BALL.replace("v: -g}", "v: -g, x: w, w: -w}").replace("v: 0}", "v: 0, x: 0, w: 1}").replace("2.4", "5")
RIDGE = """
hsdsl: 1
modes:
  on:
    flow: {x: v, v: 1 - t}
    transitions: [{name: stop, when: x >= 0, to: on, reset: {v: -v/2}}]
initial: {mode: on, x: 0, v: 0}
experiment: {until: 3}
"""


CASES = Path(__file__).parents[1] / "conformance/cases"
LIFTED = (CASES / "m11-lifted-by-a-jump.yaml").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("text", [ROLLING, RIDGE, LIFTED], ids=["rolling", "released", "lifted"])
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_what_a_guard_holds_moves_along_it_until_it_is_released(text: str, kind: str, made: Any) -> None:
    run = loaded(text).simulate()
    until = run.final.time
    solver = {"relative_tolerance": 1e-10} if kind == "ModelExchange" else {"output_interval": 0.1}
    result = fmpy.simulate_fmu(made(text, 3), fmi_type=kind, stop_time=until, **solver)
    for state, value in run.final.state.items():
        assert result[state][-1] == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize("start", [(1e-9, 1e-4), (0.0, 0.0), (0.0, 3.0)])
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_nothing_falls_through_a_guard(start: tuple[float, float], kind: str, made: Any) -> None:
    values = dict(zip(("h", "v"), start, strict=True))
    result = fmpy.simulate_fmu(made(BALL, 3), fmi_type=kind, start_values=values, stop_time=2, output_interval=0.05)
    assert result["h"].min() > -1e-6


def test_time_may_begin_anywhere(made: Any) -> None:
    for kind in ("ModelExchange", "CoSimulation"):
        result = fmpy.simulate_fmu(
            made(BALL, 3), fmi_type=kind, start_time=5, stop_time=7.4, output_interval=0.1, relative_tolerance=1e-10
        )
        assert result["h"][-1] == pytest.approx(loaded(BALL).simulate().final.state["h"], abs=1e-6)


@pytest.mark.parametrize("version", VERSIONS)
def test_descriptions_are_as_they_were(version: int) -> None:
    unit = unit_of(source_of(hsdsl.load(MODELS / "thermostat.yaml"), {}))
    description = getattr(fmi, f"description{version}")
    text = re.sub(r' (?:guid|instantiationToken|description|generationTool)="[^"]*"', "", description(unit), count=3)
    assert_golden(text, Path(__file__).parent / "golden" / f"thermostat.fmi{version}.xml")


# how far times may be off in model exchange, where the solver's error decides them; of a stiff model more
TOLERANCE = {"stiff-switch": 1e-6, "thermostat": 1e-6}
CHATTERING = {"oscillator-with-stop-2"}  # how often it hits while it is stuck is a matter of tolerances


@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param(name, version, marks=pytest.mark.slow if k % 2 == i else pytest.mark.campaign)
        for k, name in enumerate(NAMES)
        for i, version in enumerate(VERSIONS)  # one version of each in turn
    ],
)
def test_every_model_agrees_with_its_run(name: str, version: int, made: Any) -> None:
    model, path = loaded(name), made(name, version)
    source = source_of(model, {})
    until = source.problem.settings.until
    states = list(source.problem.program.all_states)
    located = model.simulate(scheme="located", method="auto", tolerance=1e-10)
    result = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", relative_tolerance=1e-9, output_interval=until / 50, stop_time=until
    )
    final = located.stop.reason == "final"  # FMPy ends before the last event then
    allowed = TOLERANCE.get(name, 1e-7) * until
    found = [t for t in jumps(result, [*states, "mode"]) if t < until - allowed]
    exact = [t.time for t in located.transitions if t.time < until - allowed]
    exact = exact[:-1] if final else exact
    if name not in CHATTERING:
        assert found == pytest.approx(exact, abs=allowed)
    run = model.simulate()
    steps = {"output_interval": until / 50, "stop_time": until, "fmi_type": "CoSimulation"}
    result = fmpy.simulate_fmu(path, **steps)
    close = 1e-3 if run.settings.get("step") else 1e-5  # communication points change the steps, and so their errors
    scale = max(1.0, *np.abs(run.values[np.isfinite(run.values)]))
    for state, value in run.final.state.items():
        assert result[state][-1] == pytest.approx(value, abs=close * scale)
    assert final or result["time"][-1] == pytest.approx(until)


# where a run ends in a transition, stops, or passes over something that shorter steps see
OTHERWISE = {"event-at-end", "blow-up", "narrow-pulse"}
# further ones that a solver steps over, that have no one answer, or that enlarge each error
SOLVER = {"grazing-hit", "two-ways", "lorenz-section"}
GALLERY = [path.stem for path in sorted((MODELS / "gallery").glob("*.yaml")) if path.stem not in OTHERWISE]


@pytest.mark.slow
@pytest.mark.parametrize("name", GALLERY)
def test_scenes_of_the_gallery_end_where_their_runs_do(name: str, made: Any) -> None:
    run = loaded(f"gallery/{name}").simulate()
    until, path = run.final.time, made(f"gallery/{name}", 3)  # made once for both kinds
    for kind in ("ModelExchange", "CoSimulation")[name in SOLVER :]:
        result = fmpy.simulate_fmu(
            path, fmi_type=kind, stop_time=until, output_interval=until / 50, relative_tolerance=1e-9
        )
        for state, value in run.final.state.items():
            size = np.nanmax(np.abs(run.sample(np.linspace(0, until, 201))[state])) or 1.0
            assert result[state][-1] == pytest.approx(value, abs=1e-3 * size), kind


class Stepped:
    """A unit of FMI 3 in co-simulation, function by function."""

    def __init__(self, path: str, initialise: bool = True, **start: float) -> None:
        self.description = fmpy.read_model_description(path)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.unit: Any = fmpy.instantiate_fmu(fmpy.extract(path), self.description, "CoSimulation")
        self.set(**start)
        self.time = 0.0
        if initialise:
            self.unit.enterInitializationMode(startTime=0)
            self.unit.exitInitializationMode()

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.unit.setFloat64([self.references[name]], [value])

    def get(self, *names: str) -> list[float]:
        return list(self.unit.getFloat64([self.references[name] for name in names]))

    def go_to(self, time: float, step: float = 0.1) -> None:
        while self.time < time - 1e-9:
            size = min(step, time - self.time)
            self.unit.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
            self.time += size


def test_states_are_copied_and_serialized(made: Any) -> None:
    path = made(DRIVEN, 3)
    first, other = Stepped(path), Stepped(path)
    first.go_to(1.3)
    first.set(k=3.0, u=0.25)
    state = first.unit.getFMUState()
    stored = first.unit.serializeFMUState(state)
    first.go_to(3)
    known = first.get("x", "v", "force")
    first.unit.setFMUState(state)
    first.time = 1.3
    first.go_to(3)
    assert first.get("x", "v", "force") == known
    other.unit.setFMUState(other.unit.deserializeFMUState(stored))
    other.time = 1.3
    other.go_to(3)
    assert other.get("x", "v", "force") == known


def test_parameters_and_what_depends_on_them_can_be_tuned(made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3), m=1.0)
    assert unit.get("c", "start", "x") == [4.0, 0.5, 0.5]
    unit.go_to(3)
    run = loaded(DRIVEN).simulate(parameters={"m": 1})
    assert unit.get("x", "v") == pytest.approx(list(run.final.state.values()), abs=1e-8)


@pytest.mark.parametrize(
    ("version", "exported"),
    [
        (3, {"y": 5.0}),
        pytest.param(2, {}, marks=pytest.mark.slow),
        pytest.param(2, {"x": 1.5}, marks=pytest.mark.campaign),
    ],
)
@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
@pytest.mark.parametrize("given", [{}, {"y": 4.5}, {"k": 1.25, "y": 6.0}, {"k": 0.5}, {"x": -2.0}])
def test_initial_values_follow_those_that_they_use(
    version: int, kind: str, exported: dict[str, float], given: dict[str, float], made: Any
) -> None:
    result = fmpy.simulate_fmu(
        made(USING, version, **exported),
        fmi_type=kind,
        start_values=given,
        stop_time=2,
        output_interval=0.5,
        relative_tolerance=1e-9,
        output=["x", "y", "z"],
    )
    initial = exported | {name: value for name, value in given.items() if name != "k"}
    run = loaded(USING).simulate(initial=initial, parameters={k: v for k, v in given.items() if k == "k"})
    names = ("x", "y", "z")
    assert [result[name][0] for name in names] == [float(run.sample([0])[name][0]) for name in names]
    assert [result[name][-1] for name in names] == pytest.approx([run.final.state[n] for n in names], abs=1e-5)


def test_initial_values_follow_before_a_unit_is_initialised(made: Any) -> None:
    unit = Stepped(made(USING, 3, y=5.0), initialise=False)
    seen: list[list[float]] = []
    for given in ({"y": 4.0}, {"k": 3.0}, {"x": 1.0}, {"k": 2.0}):
        unit.set(**given)
        seen.append(unit.get("x", "y", "z"))
    assert seen == [[8, 4, 4], [12, 4, 8], [1, 4, -3], [1, 4, -3]]


EVENTS = """
hsdsl: 1
modes:
  a:
    flow: {x: 1 - t, y: 3*cos(9*t), z: -z/2, n: 0, m: 0}
    transitions:
      - {name: one, event: "x <= 0.25 and z <= 2", reset: {n: n + 1}}
      - {name: two, event: "x <= 0.25 or y >= 1.2", reset: {m: m + 1}}
initial: {mode: a, x: 0, y: 1, z: 1, n: 0, m: 0}
experiment: {until: 3}
"""


def test_events_of_several_comparisons_fire_where_a_run_has_them(made: Any) -> None:
    model = loaded(EVENTS)
    exact = [made.time for made in model.simulate(scheme="located").transitions if "re-arms" not in made.edge]
    result = fmpy.simulate_fmu(
        made(EVENTS, 3), fmi_type="ModelExchange", relative_tolerance=1e-9, stop_time=3, output_interval=0.5
    )
    assert len(result) < 200
    assert (result["n"][-1], result["m"][-1]) == (1, 3)
    assert jumps(result, ["n", "m"]) == pytest.approx(exact, abs=1e-6)


DRIVEN_OTHERWISE = DRIVEN.replace("u: sin(t)", "u: {times: [0, 1, 2], values: [0.5, -1, 2], hold: zero}")


def test_inputs_follow_the_file_until_they_are_set(made: Any) -> None:
    given, run = Stepped(made(DRIVEN, 3)), loaded(DRIVEN).simulate()
    given.go_to(3)
    assert given.get("x", "v", "force") == pytest.approx(
        [*run.final.state.values(), run.final.outputs["force"]], abs=1e-8
    )
    held, run = Stepped(made(DRIVEN, 3), u=0.5), loaded(DRIVEN_OTHERWISE).simulate()
    for until, value in ((1.0, 0.5), (2.0, -1.0), (3.0, 2.0)):
        held.set(u=value)
        held.go_to(until)
    assert held.get("x", "v") == pytest.approx(list(run.final.state.values()), abs=1e-8)


@pytest.mark.parametrize("version", VERSIONS)
def test_inputs_drive_model_exchange(version: int, made: Any) -> None:
    times = np.array([0, 1, 1, 2, 2, 3.0])
    values = np.array([0.5, 0.5, -1, -1, 2, 2.0])
    signals = np.array(list(zip(times, values, strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        made(DRIVEN, version), fmi_type="ModelExchange", relative_tolerance=1e-10, stop_time=3, input=signals
    )
    run = loaded(DRIVEN_OTHERWISE).simulate()
    assert [result["x"][-1], result["v"][-1]] == pytest.approx(list(run.final.state.values()), abs=1e-5)


# Surfaces with `if` that a state begins beyond; inputs and switches of time that jump. Most of a model, and its end.
CROSSINGS = {
    "entry beyond": (
        """
modes:
  up: {flow: {y: v, v: -9.81}, transitions: [{name: land, when: y <= 1, if: v < 0, to: down}]}
  down: {flow: {y: 0, v: 0}}
initial: {mode: up, y: 0.9, v: 2}
""",
        1.0,
    ),
    "floor": (
        """
modes:
  wait: {flow: {x: 0}, transitions: [{name: go, when: t - floor(t) <= 0, to: run}]}
  run: {flow: {x: 1}, transitions: [{name: back, when: since >= 0.25, to: wait}]}
initial: {mode: wait, x: 0}
""",
        3.6,
    ),
    "sample": (
        """
inputs: {u: {times: [0, 0.3, 0.7, 1.1], values: [0, 1, 0.25, 2], hold: zero}}
modes:
  off: {flow: {x: 1}, transitions: [{name: on, when: u >= 1, to: on}]}
  on: {flow: {x: -2}, transitions: [{name: off, when: u <= 0.25, to: off}]}
initial: {mode: off, x: 0}
""",
        1.5,
    ),
    "onto a state": (
        """
inputs: {u: {times: [0, 0.4, 0.9], values: [0, 3, 0], hold: zero}}
modes:
  low: {flow: {x: 0, n: 1}, transitions: [{name: lift, when: u >= x, to: low, reset: {x: x + 2*n}}]}
initial: {mode: low, x: 3, n: 0}
""",
        1.5,
    ),
    "transparent": (
        """
inputs: {u: {times: [0, 0.3, 0.6], values: [0, 2, 0], hold: zero}}
modes:
  a: {flow: {x: 1, y: 0}, transitions: [{name: up, when: x + u >= 1, if: x > -9, to: a, reset: {x: 0, y: y + 1}}]}
initial: {mode: a, x: 0, y: 0}
""",
        1.5,
    ),
    "two guards": (
        """
inputs: {u: {times: [0, 0.5], values: [0, 1], hold: zero}}
modes:
  a:
    flow: {x: 1}
    transitions:
      - {name: first, when: u >= 1, to: b}
      - {name: second, when: 2*u >= 1, to: c, priority: 1}
  b: {flow: {x: 2}}
  c: {flow: {x: 3}, transitions: [{name: home, when: x >= 1, to: b}]}
initial: {mode: a, x: 0}
""",
        1.5,
    ),
    "second time": (
        """
modes:
  a:
    flow: {x: v, v: -4*x}
    transitions:
      - {name: in, when: x <= 0.25, if: v < 0 and t > 2, to: a, reset: {x: 1, v: 0}}
      - {name: out, when: x >= 0.5, if: v > 0 and t > 3, to: b}
  b: {flow: {x: 0, v: 0}}
initial: {mode: a, x: 1, v: 0}
""",
        5.0,
    ),
    "reset beyond": (
        """
modes:
  up:
    flow: {y: v, v: -9.81}
    transitions: [{name: land, when: y <= 1, if: v < 0, to: down, reset: {v: 3, y: 0.5}}]
  down:
    flow: {y: v, v: -9.81}
    transitions: [{name: back, when: y >= 0.8, to: up, reset: {y: 0.75}}]
initial: {mode: up, y: 0.9, v: 2}
""",
        3.0,
    ),
    "switches": (
        """
modes:
  off: {flow: {x: 1}, transitions: [{name: on, when: sign(sin(5*t)) >= 1, to: on}]}
  on: {flow: {x: -x}, transitions: [{name: off, when: floor(3*t) - 2*floor(3*t/2) <= 0, to: off}]}
initial: {mode: off, x: 0}
""",
        4.0,
    ),
}
DOWN = "to: down, reset: {w: 0}}"
# the same input from the importing tool as in the file
FOLLOWED = CROSSINGS["sample"][0].replace("{times: [0, 0.3, 0.7, 1.1], values: [0, 1, 0.25, 2], hold: zero}", "0.5 - t")


def crossing(text: str, until: float) -> str:
    return f"hsdsl: 1\n{text}experiment: {{until: {until}}}\n"


def assert_follows(result: Any, text: str) -> None:
    """The transitions and the end of a run, within 1e-6."""
    run = loaded(text).simulate()
    states = run.final.state
    assert jumps(result, [*states, "mode"]) == pytest.approx([made.time for made in run.transitions], abs=1e-6)
    assert {state: result[state][-1] for state in states} == pytest.approx(states, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "version"),
    [
        pytest.param(name, version, marks=[pytest.mark.slow] if k > 3 or k % 2 == i else [])
        for k, name in enumerate(CROSSINGS)
        for i, version in enumerate(VERSIONS)  # one version of each in turn
    ],
)
def test_surfaces_are_crossed_and_jumped_over_as_in_a_run(name: str, version: int, made: Any) -> None:
    text, until = crossing(*CROSSINGS[name]), CROSSINGS[name][1]
    result = fmpy.simulate_fmu(
        made(text, version),
        fmi_type="ModelExchange",
        relative_tolerance=1e-11,
        stop_time=until,
        output_interval=until / 100,
    )
    assert_follows(result, text)


def test_states_that_a_finer_run_ends_before_have_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    model = loaded(crossing(*CROSSINGS["entry beyond"]).replace("v: 0}}", "v: 0, w: 4}}").replace("to: down}", DOWN))
    short = model.simulate(until=0.1)
    monkeypatch.setattr(Execution, "finer", property(lambda run: short))
    assert nominals(source_of(model, {})) == [2, 2, 4]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_surface_that_a_state_begins_beyond_fires_when_it_is_crossed_again(version: int, made: Any) -> None:
    """From many speeds, as searches for roots of indicators end at zero or on either side of it."""
    path = made(crossing(*CROSSINGS["entry beyond"]), version)
    for speed in (1 + k / 4 for k in range(13)):
        result = fmpy.simulate_fmu(
            path, fmi_type="ModelExchange", relative_tolerance=1e-10, stop_time=1, start_values={"v": speed}
        )
        rise = speed**2 - 2 * 9.81 * 0.1  # whether the height of 1 is reached
        exact: list[float] = [(speed + math.sqrt(rise)) / 9.81] if rise > 0 else []
        assert jumps(result, ["mode"]) == pytest.approx(exact, abs=1e-6)


def test_an_input_of_the_importing_tool_jumps_onto_a_guard(made: Any) -> None:
    times = [0, 0.3, 0.3, 0.7, 0.7, 1.1, 1.1, 1.5]
    values = [0, 0, 1, 1, 0.25, 0.25, 2, 2]
    signals = np.array(list(zip(times, values, strict=True)), dtype=[("time", float), ("u", float)])
    path = made(crossing(FOLLOWED, 1.5), 3)
    result = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", relative_tolerance=1e-11, stop_time=1.5, output_interval=0.03, input=signals
    )
    assert_follows(result, crossing(*CROSSINGS["sample"]))


def test_directional_derivatives_are_those_of_differences(made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3))
    unit.go_to(0.7)
    unit.set(u=0.3)
    knowns, unknowns = ["x", "v", "u"], ["der(x)", "der(v)", "force"]
    step = 1e-6
    for known in knowns:
        (at,) = unit.get(known)
        rows: list[list[float]] = []
        for side in (step, -step):
            unit.set(**{known: at + side})
            rows.append(unit.get(*unknowns))
        unit.set(**{known: at})
        slopes = unit.unit.getDirectionalDerivative(
            [unit.references[name] for name in unknowns], [unit.references[known]], [1.0]
        )
        assert list(slopes) == pytest.approx([(a - b) / (2 * step) for a, b in zip(*rows, strict=True)], abs=1e-7)


@pytest.mark.parametrize(
    ("point", "size"), [(0.5, 0.0), (0.5, -0.1), (0.1, 0.1), (0.3, 0.4), (0.9, 0.1), (0.5, math.inf), (0.5, math.nan)]
)
def test_steps_begin_where_the_last_one_ended_and_lead_on(point: float, size: float, made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3))
    unit.go_to(0.5, step=0.5)
    known = unit.get("time", "x", "v")
    with pytest.raises(FMICallException):
        unit.unit.doStep(currentCommunicationPoint=point, communicationStepSize=size)
    assert unit.get("time", "x", "v") == known
    unit.go_to(1, step=0.5)


def test_units_of_fmi_2_refuse_a_step_back(made: Any) -> None:
    path = made(BALL, 2)
    unit = fmpy.instantiate_fmu(fmpy.extract(path), fmpy.read_model_description(path), "CoSimulation")
    unit.setupExperiment(startTime=0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    with pytest.raises(FMICallException):
        unit.doStep(currentCommunicationPoint=0, communicationStepSize=-0.1)
    unit.doStep(currentCommunicationPoint=0, communicationStepSize=0.1)


@pytest.mark.parametrize(
    ("unknown", "known"),
    [("der(v)", "k"), ("force", "k"), ("der(v)", "time"), ("force", "der(x)"), ("mode", "x"), ("force", "mode")],
)
def test_derivatives_by_other_than_states_and_inputs_are_refused(unknown: str, known: str, made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3))
    with pytest.raises(FMICallException):
        unit.unit.getDirectionalDerivative([unit.references[unknown]], [unit.references[known]], [1.0])


def test_parameters_beyond_their_bounds_are_refused(made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3))
    with pytest.raises(FMICallException):
        unit.set(k=-1.0)
    assert unit.get("k") == [4.0]
    unit.set(k=0.0)
    early = Stepped(made(DRIVEN, 3), initialise=False, k=-1.0)
    early.unit.enterInitializationMode(startTime=0)
    with pytest.raises(FMICallException):
        early.unit.exitInitializationMode()


def test_a_damaged_state_is_refused(made: Any) -> None:
    unit = Stepped(made(DRIVEN, 3))
    stored = bytearray(unit.unit.serializeFMUState(unit.unit.getFMUState()))
    stored[len(stored) // 2] ^= 1
    with pytest.raises(FMICallException):
        unit.unit.deserializeFMUState(bytes(stored))


def test_units_report_a_cascade_that_they_have_no_room_for(made: Any) -> None:
    text = BALL.replace("when: h <= 0, to: fly, reset: {v: -e*v}", "when: h <= 0, to: fly, reset: {h: h - 1}")
    messages: list[str] = []

    def keep(*given: object) -> None:
        messages.append(str(given[-1]))

    fmpy.simulate_fmu(made(text, 3), fmi_type="CoSimulation", stop_time=2.4, logger=keep)
    assert any("more than 64 transitions at one instant" in message for message in messages)


def test_texts_of_a_model_stay_texts_and_bytes_stay_the_same(made: Any) -> None:
    description = fmpy.read_model_description(made(DRIVEN, 3))
    assert "]]> <a b='c'> & \"--> ü" in description.description
    units = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    assert (units["N/m"].kg, units["N/m"].s, units["N/m"].m) == (1, -2, 0)
    names = {variable.name: variable for variable in description.modelVariables}
    assert names["der(x)"].unit == "(m)/(s)"
    assert names["k"].description == 'stiffness < "&'
    again = files_of(source_of(loaded(DRIVEN), {}), "fmi3", "output")
    assert list(again.values()) == [Path(made(DRIVEN, 3)).read_bytes()]
