"""Models as SBML: the same run behind our own import, and in other tools; what SBML lacks is refused."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from export.test_masters import HERE, program

import hsdsl
from hsdsl.export import files_of, source_of
from hsdsl.interface.imports.sbml import DEEPEST, imported
from hsdsl.language.source.xml import read_xml

MODELS = Path(__file__).parents[2] / "models"
HEAD = "hsdsl: 1\nexperiment: {until: 4, tolerance: 1e-11}\n"
# Each with times of its run at which nothing jumps.
CASES = {
    "a guard with an if that is passed while it is false": HEAD
    + """
parameters: {p: 1/3}
modes:
  m:
    flow: {x: cos(3*t), y: 1, n: 0}
    transitions:
      - {when: x >= 1/5, if: y >= 1, to: m, reset: {n: n + 1}}
      - {when: x >= 1/5, to: m, priority: 1, reset: {n: n + 10*y}, if: y <= 5/2}
initial: {mode: m, x: 0, y: 0, n: p}
""",
    "guards at one instant go by priority, then by the file": HEAD
    + """
outputs: {double: 2*x}
modes:
  a:
    flow: {x: 1, y: -y, z: 0}
    transitions:
      - {when: x >= 1, to: b, reset: {y: y + 1}}
      - {when: 2*x >= 2, to: c, reset: {y: y + 5}}
      - {when: y <= -3, to: c, priority: 2}
  b: {flow: {x: 1, y: z, z: sign(z - 1)*z}, transitions: [{when: x >= 2, to: c, reset: {y: "max(x, 1/2)"}}]}
  c:
    flow: {x: -1, y: "select(x - 1, y, 0)", z: floor(x)}
    domain: [x >= -9]
    transitions: [{when: x <= 1, to: a, reset: {x: 1/2}}]
initial: {mode: a, x: 0, y: 1, z: 2}
""",
    "events with delays, values of their triggers, and persistence": HEAD
    + """
modes:
  m:
    flow: {x: 1, s: sin(x), a: 0, b: 0, c: 0}
    transitions:
      - {event: x >= 1 and x < 2, delay: 1/2, reset: {a: x, b: b + a}}
      - {event: x >= 1, delay: 1/2, values: execution, reset: {c: x}}
      - {event: x > 3/2 and x < 7/4, delay: 1/2, persistent: false, reset: {a: 100}}
      - {event: x < 3, initially: false, reset: {b: b + 7}}
      - {event: b >= 7, priority: x, reset: {c: c + 1/8}}
initial: {mode: m, x: 0, s: 0, a: 0, b: 0, c: 0}
""",
    "three modes whose flows are products with the mode": HEAD
    + """
parameters: {period: 0.9}
outputs: {power: i*u}
modes:
  on: {flow: {i: 3 - u, u: i - u/3, tau: 1}, transitions: [{when: tau >= 0.4, to: off}]}
  off:
    flow: {i: -u - 1, u: i - u/3, tau: 1}
    transitions: [{when: tau >= period, to: on, reset: {tau: 0}}, {when: i <= 0, to: idle, reset: {i: 0}}]
  idle: {flow: {i: 0, u: sin(t)/9 - u/period, tau: 1}, transitions: [{when: tau >= period, to: on, reset: {tau: 0}}]}
initial: {mode: on, i: 0, u: 0, tau: 0}
""",
}
FILES = {name: (MODELS / f"{name}.yaml").read_text("utf-8") for name in ("thermostat", "constrained-pendulum")}
FILES["bouncing-ball"] = (MODELS / "bouncing-ball.yaml").read_text("utf-8").replace("until: 12", "until: 5")
ALL = pytest.mark.parametrize("text", [*CASES.values(), *FILES.values()], ids=[*CASES, *FILES])
EXACT = 1e-6


def exported(model: hsdsl.Model, folder: Path) -> Path:
    ((name, content),) = files_of(source_of(model, {}), "sbml").items()
    (folder / name).write_bytes(content)
    return folder / name


def compared(model: hsdsl.Model) -> tuple[list[float], dict[str, np.ndarray]]:
    """Times of a run away from its jumps, and its states and outputs there where its modes have them."""
    run = model.simulate(tolerance=1e-11, engine="python")
    assert len(run.transitions) > 1
    start, end = map(float, run.time_span)
    times = np.linspace(start, end, 41)[1:-1] + 0.00123
    jumps = np.array([float(made.time) for made in run.transitions])
    times = times[(np.abs(times[:, None] - jumps).min(axis=1) > 1e-3) & (times < end)]
    samples = run.sample(times)
    return times.tolist(), {name: np.asarray(samples[name], float) for name in run.shown}


def same(own: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    for name, values in own.items():
        here = ~np.isnan(values)  # where the mode has the state
        assert np.all(np.abs(values - other[name])[here] <= EXACT * max(1.0, np.nanmax(np.abs(values)))), name


@ALL
def test_the_import_of_an_export_runs_alike(text: str, tmp_path: Path) -> None:
    model = hsdsl.loads(text)
    times, own = compared(model)
    path = exported(model, tmp_path)
    root = read_xml(str(path), path.read_bytes(), DEEPEST)
    back = hsdsl.loads(imported(root, repr(times[-1]), dict.fromkeys(own, "value")))
    again = back.simulate(tolerance=1e-11, engine="python").sample(times)
    same(own, {name: np.asarray(again[f"out_{name}"], float) for name in own})


@pytest.mark.tools
@pytest.mark.parametrize(("tool", "version"), [("libroadrunner", "2.10.0"), ("copasi-basico", "0.92")])
@ALL
def test_other_tools_run_an_export_alike(text: str, tool: str, version: str, tmp_path: Path) -> None:
    python = program(tool, version)
    model = hsdsl.loads(text)
    times, own = compared(model)
    script = HERE / f"in_{tool.removesuffix('-basico')}.py"
    command = [python, script, exported(model, tmp_path), json.dumps([0.0, *times])]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    got = json.loads(done.stdout.splitlines()[-1])
    assert not got["found"]
    same(own, {name: np.array(got["columns"][name][1:]) for name in own})


def test_a_file_of_sbml_has_the_words_of_the_model() -> None:
    source = source_of(hsdsl.load(MODELS / "thermostat.yaml"), {"parameters": {"low": 19}})
    ((name, content),) = files_of(source, "sbml").items()
    root = ElementTree.fromstring(content)
    assert name == "thermostat.xml"
    values = {each.get("id"): each.get("value") for each in root.iter() if each.tag.endswith("}parameter")}
    assert values["low"] == "19.0"
    assert values["mode"] == "0.0"
    assert len([each for each in root.iter() if each.tag.endswith("}event")]) == 2


REFUSED = {
    "an event beside several modes": (
        "modes: {a: {flow: {x: 1}, transitions: [{event: x > 1, to: b}]}, b: {flow: {x: 1}}}",
        "several modes and an `event`",
    ),
    "samples": ("inputs: {u: {times: [0, 1], values: [0, 2]}}\nmodes: {a: {flow: {x: u}}}", "`u` is one"),
    "a function": ("modes: {a: {flow: {x: 'atan2(x, t - 2)'}}}", "atan2"),
    "an output that a mode lacks": (
        "modes: {a: {flow: {x: 1}, outputs: {y: x}, transitions: [{when: x >= 1, to: b}]}, b: {flow: {x: 1}}}",
        "output `y`",
    ),
}


@pytest.mark.parametrize(("text", "expected"), REFUSED.values(), ids=list(REFUSED))
def test_what_sbml_lacks_is_refused(text: str, expected: str) -> None:
    model = hsdsl.loads(f"{HEAD}{text}\ninitial: {{mode: a, x: 0}}\n")
    with pytest.raises(hsdsl.UsageError, match=expected):
        files_of(source_of(model, {}), "sbml")
