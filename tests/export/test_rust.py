"""Crates for Rust: their own test passes, and every digit of every transition is that of a run."""

from __future__ import annotations

from pathlib import Path
from shutil import which
from typing import Any

import pytest
from export.agreement import assert_agree, by_rust, cargo, of_run
from shipped import assert_golden

import hsdsl
from hsdsl.cli.verbs import obey
from hsdsl.export import files_of, source_of, write

ROOT = Path(__file__).parents[2]
MODELS = ROOT / "models"
needs_cargo = [pytest.mark.tools, pytest.mark.skipif(which("cargo") is None, reason="there is no cargo")]
SETTINGS: list[tuple[str, dict[str, Any]]] = [
    *((path.stem, {}) for path in sorted(MODELS.glob("*.yaml")) if path.stem != "stiff-switch"),
    ("stiff-switch", {"method": "dopri5", "until": 0.001}),
    ("pronking-runner", {"method": "rk4", "step": 1e-3}),
    ("thermostat", {"method": "dop853", "tolerance": 1e-7}),
]
GALLERY = [path.stem for path in sorted((MODELS / "gallery").glob("*.yaml"))]
HOSTILE = """
hsdsl: 1
title: "*/ \\" \\\\ } é"
parameters: {T: 1/2, b: 2*T}
inputs: {u: {times: [0, T, 2], values: [0, 1, b], hold: zero}}
modes:
  fn: {flow: {x: 1 + u}, transitions: [{name: "a\\" \\\\ {}", when: x >= b, to: fn, reset: {x: 0}}]}
initial: {mode: fn, x: b/8}
experiment: {until: 4}
"""


def hostile(path: Path) -> Path:
    path.write_text(HOSTILE, encoding="utf-8")
    return path


def assert_same(model: Any, crate: Path, **settings: Any) -> None:
    run = model.simulate(**{**settings, **chosen(model, settings), "scheme": "relaxed"})
    assert_agree(of_run(run), by_rust(model, crate, **settings), 0.0)


def chosen(model: Any, settings: Any) -> dict[str, str]:
    """The method in the place of Taylor's, which `auto` may be."""
    method = source_of(model, settings).problem.settings.method
    assert method is not None
    return {"method": "dopri5"} if method.kind == "taylor" else {}


@pytest.mark.parametrize(
    ("name", "settings"), [pytest.param(*s, marks=needs_cargo, id=f"{s[0]}-{i}") for i, s in enumerate(SETTINGS)]
)
def test_the_crates_own_test(name: str, settings: Any, tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / f"{name}.yaml")
    assert_same(model, tmp_path, **settings)
    assert "1 passed" in cargo(tmp_path, "test", "-q")


@pytest.mark.slow
@pytest.mark.parametrize("name", [pytest.param(name, marks=needs_cargo) for name in GALLERY])
def test_every_scene_of_the_gallery(name: str, tmp_path: Path) -> None:
    assert_same(hsdsl.load(MODELS / "gallery" / f"{name}.yaml"), tmp_path, method="dopri5")


@pytest.mark.tools
@pytest.mark.skipif(which("cargo") is None, reason="there is no cargo")
def test_texts_of_a_model_stay_strings(tmp_path: Path) -> None:
    crate = tmp_path / "crate"
    assert_same(hsdsl.load(hostile(tmp_path / "core.yaml")), crate, method="rk4", step=1e-2)
    assert 'name = "core_"' in (crate / "Cargo.toml").read_text()


def test_generated_text() -> None:
    files = files_of(source_of(hsdsl.load(MODELS / "thermostat.yaml"), {}), "rust")
    lines = files["src/model.rs"].decode().splitlines(keepends=True)
    found = "".join(line for line in lines if not line.startswith("// "))
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.rust.txt")


def test_what_it_cannot_keep_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert obey(["export", str(MODELS / "stiff-switch.yaml"), "--to", "rust", "--out", str(out)]) == 2
    assert "--method dopri5" in capsys.readouterr().err
    assert not out.exists()


TWO_EDGES = """
hsdsl: 1
modes:
  a:
    flow: {x: 1, n: 0, y: 1}
    transitions:
      - {name: many, event: x >= 1, reset: {n: n + 3, x: -1}}
      - {name: now, event: n >= 3, reset: {n: 0}, priority: y*10}
initial: {mode: a, x: 0, n: 0, y: 1}
experiment: {until: 4}
"""


def test_the_test_of_a_crate_compares_names_of_edges() -> None:
    text = files_of(source_of(hsdsl.loads(TWO_EDGES), {}), "rust")["tests/expected/mod.rs"].decode()
    rows = [line.split(", ") for line in text.splitlines() if line.startswith("    (")]
    assert [row[3] for row in rows] == ['"many"', '"now"'] * 2


@pytest.mark.tools
@pytest.mark.skipif(which("cargo") is None, reason="there is no cargo")
def test_an_event_of_several_edges_passes_the_crates_own_test(tmp_path: Path) -> None:
    write(files_of(source_of(hsdsl.loads(TWO_EDGES), {}), "rust"), tmp_path)
    assert "1 passed" in cargo(tmp_path, "test", "-q")
