"""Exports of systems of parts: the runs of their product modes, by the same names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export.c_builds import COMPILERS, exported
from export.test_c import same
from export.test_latex import check
from export.web_pages import browser, complaints, in_browser, numbers, opened

import hsdsl
from hsdsl.export import files_of, source_of

MODELS = Path(__file__).parents[2] / "models" / "parts"
ENDING = """
hsdsl: 1
parameters: {fast: 3}
inputs:
  u: {times: [0, 0.2], values: [1, 2], hold: zero}
automata:
  leg:
    parameters: {speed: 1}
    modes:
      air: {flow: {s: speed*u}, transitions: [{name: down, when: s >= 0.4, to: ground, reset: {f: s/2}}]}
      ground:
        flow: {f: u}
        transitions: [{name: down, when: f >= 0.5, to: air, reset: {s: 0}}, {name: ends, when: t >= 0.9, to: end}]
      end: {final: true}
  body: {modes: {move: {flow: {x: 1 + count(leg.air)}}}}
system:
  body: {automaton: body, initial: {x: 0}}
  leg: {automaton: leg, count: 3, initial: {mode: air, s: index/20}, parameters: {speed: fast + index}}
experiment: {until: 2}
"""
# the run ends in the strip of a transition that is not made
STRIP = {"scheme": "relaxed", "method": "rk4", "step": 1e-2, "relaxation": 0.1}
RUNS = [
    pytest.param("centipede", {"until": 0.5}, marks=pytest.mark.slow),
    pytest.param(
        "runner",
        {"until": 1, "scheme": "relaxed", "method": "rk4", "step": 1e-3, "relaxation": 1e-3},
        marks=pytest.mark.slow,
    ),
    ("ENDING", {}),
    ("ENDING", {"until": 0.2, **STRIP}),
]


def model_of(name: str) -> hsdsl.Model:
    return hsdsl.loads(ENDING) if name == "ENDING" else hsdsl.load(MODELS / f"{name}.yaml")


@pytest.mark.skipif("gcc" not in COMPILERS, reason="without gcc")
@pytest.mark.parametrize(("name", "arguments"), RUNS)
def test_a_program_in_c_prints_product_modes(name, arguments, tmp_path):
    found = same(tmp_path, model_of(name), COMPILERS["gcc"], **arguments)
    assert len(found["transitions"]) > 1


@in_browser
def test_a_page_shows_product_modes(tmp_path):
    model = hsdsl.loads(ENDING)
    arguments = {"until": 1.0, "method": "dopri5"}
    with browser() as driver:
        found = numbers(opened(driver, next(exported(model, tmp_path, "web", **arguments).glob("*.html"))))
        assert not complaints(driver)
    run = model.simulate(**arguments)
    assert found["modes"] == [arc.mode for arc in run.arcs]
    assert [made["edge"] for made in found["transitions"]] == [made.edge for made in run.transitions]
    for one, other in zip(found["transitions"], run.transitions, strict=True):
        assert one["before"] == pytest.approx(other.before, rel=1e-9, abs=1e-9)
        assert one["after"] == pytest.approx(other.after, rel=1e-9, abs=1e-9)
    final = {state: value for state, value in found["final"].items() if value is not None}
    assert final.keys() == run.final.state.keys()


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
def test_a_unit_has_a_mode_for_each_part(version, tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install 'hsdsl[export]'")
    from fmpy.validation import validate_fmu

    model = hsdsl.loads(ENDING)
    changed = {"initial": {"leg[2].mode": "ground", "leg[2].f": 0.1}}
    run = model.simulate(**changed)
    path = str(next(exported(model, tmp_path, f"fmi{version}", **changed).glob("*.fmu")))
    assert validate_fmu(path) == []
    kinds = {v.name: (v.variability, v.causality) for v in fmpy.read_model_description(path).modelVariables}
    modes = [f"leg[{k}].mode" for k in (1, 2, 3)]
    assert [name for name, kind in kinds.items() if name.endswith(".mode") and kind == ("discrete", "local")] == modes
    assert not kinds.keys() & {"leg[1]", "der(leg[1])"}
    for way, exactly in (("ModelExchange", 1e-5), ("CoSimulation", 1e-9)):
        found = fmpy.simulate_fmu(path, fmi_type=way, stop_time=0.85, output_interval=0.05, relative_tolerance=1e-10,
                                  output=["body.x", *modes])  # fmt: skip
        _, last = np.unique(found["time"][::-1], return_index=True)
        rows = found[::-1][last]
        table = run.sample(rows["time"])
        assert rows["body.x"] == pytest.approx(table["body.x"], abs=exactly)
        settled = [k for k, t in enumerate(rows["time"]) if min(abs(t - made.time) for made in run.transitions) > 1e-4]
        for k in settled:
            numbers = {name: ("air", "ground", "end").index(mode) + 1
                       for name, mode in (item.split("=") for item in table.mode[k].split()[1:])}  # fmt: skip
            assert [rows[name][k] for name in modes] == list(numbers.values())


@pytest.mark.parametrize("name", ["rooms", "runner", "ENDING"])
def test_documents_show_automata_and_connections(name):
    source = source_of(model_of(name), {})
    (text,) = (content.decode() for content in files_of(source, "latex").values())
    check(text)
    (diagram,) = (content.decode() for content in files_of(source, "mermaid").values())
    arrows = [line.split(" : ", 1)[1] for line in diagram.splitlines() if line.startswith("    i") and "-->" in line]
    expected = {
        "rooms": ["left #61; room#91;index - 1#93;.T", "right #61; room#91;index + 1#93;.T"],
        "ENDING": ["leg.air"],
    }
    assert name not in expected or arrows == expected[name]
    for part in source.system.parts:
        for mode in part.modes:
            assert mode in text and f": {mode}" in diagram


def test_modules_for_jax_refuse_parts():
    with pytest.raises(hsdsl.UsageError, match="parts"):
        files_of(source_of(model_of("rooms"), {}), "jax")
