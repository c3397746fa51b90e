"""Crates for Rust: they print every digit of a run, of every model and every case of the meaning."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from export.c_builds import USING, exported
from export.rust_crates import assert_prints, cargo, needs_cargo, needs_tools
from shipped import assert_golden

import hsdsl
from hsdsl.export import files_of, source_of, write

ROOT = Path(__file__).parents[2]
CASES = [f"tests/conformance/{name}" for name in ("cases", "events", "parts")]
EVERY = [
    pytest.param(path, marks=[*needs_cargo, *([pytest.mark.slow] if folder != "models" else [])],
                 id=f"{path.parent.name}-{path.stem}")
    for folder in ("models", "models/gallery", "models/parts", *CASES)
    for path in sorted((ROOT / folder).glob("*.yaml"))
    if ".expect" not in path.name
]  # fmt: skip
# schemes and methods on models where each of them has something to do
OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("pronking-runner", {"scheme": "relaxed", "method": "rk4", "step": 1e-3, "relaxation": 1e-3}),
    ("thermostat", {"method": "dop853", "tolerance": 1e-7}),
    ("bouncing-ball", {"scheme": "relaxed", "method": "dopri5", "tolerance": 1e-6}),
    ("digital-control", {"method": "euler", "step": 1e-2}),
    ("stiff-switch", {"method": "dopri5", "until": 0.001}),
]
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


def model_of(name: str) -> hsdsl.Model:
    return hsdsl.load(ROOT / "models" / f"{name}.yaml")


@pytest.mark.parametrize("path", EVERY)
def test_every_model_and_every_case_prints_the_transitions_of_its_run(path: Path, tmp_path: Path) -> None:
    assert_prints(tmp_path, hsdsl.load(path))


@pytest.mark.parametrize(("name", "arguments"), [pytest.param(*each, marks=needs_cargo) for each in OTHERS])
def test_other_schemes_and_methods_and_the_crates_own_test(name: str, arguments: Any, tmp_path: Path) -> None:
    assert assert_prints(tmp_path, model_of(name), **arguments)["transitions"] or name == "stiff-switch"
    assert "1 passed" in cargo(tmp_path, "test", "-q")


@needs_tools
def test_texts_of_a_model_stay_strings(tmp_path: Path) -> None:
    path = tmp_path / "core.yaml"
    path.write_text(HOSTILE, encoding="utf-8")
    assert_prints(tmp_path / "crate", hsdsl.load(path), method="rk4", step=1e-2)
    assert 'name = "core_"' in (tmp_path / "crate" / "Cargo.toml").read_text()


def test_generated_text() -> None:
    files = files_of(source_of(model_of("thermostat"), {}), "rust")
    lines = files["src/model.rs"].decode().splitlines(keepends=True)
    found = "".join(line for line in lines if not line.startswith("// "))
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.rust.txt")


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
    assert [row[2] for row in rows] == ['"many"', '"now"'] * 2


OWN = """
use hybrid::model::{follow, initial, parameters, PARAMETERS, SCALES, SETTINGS, START};
use hybrid::{simulate, Refused, Sample, Samples, Settings, Transition, Sink, MEMORY};

struct Count(usize);

impl Sink for Count {
    fn transition(&mut self, _: &Transition) {
        self.0 += 1;
    }
}

fn main() {
    let mut p = parameters();
    let mut memory = vec![7; MEMORY];
    p[PARAMETERS.iter().position(|name| *name == "k").unwrap()] = 3.0;
    follow(&mut p);
    let x = initial(&p);
    let (until, largest, step) = (2.0 * SETTINGS.until, 2.0 * SETTINGS.largest, 2.0 * SETTINGS.step);
    let longer = Settings { until, largest, step, ..SETTINGS };
    let times: Vec<f64> = (0..=32).map(|i| 0.125 * i as f64).collect();
    let mut samples = vec![Sample::NONE; times.len()];
    let mut sinks = (Count(0), Samples::new(&times, &mut samples));
    simulate(&p, &longer, START, &x, &SCALES, &mut memory, &mut sinks).unwrap();
    let count = (sinks.0).0;
    let rows: Vec<_> = samples.iter().map(|sample| format!("{:?}", sample.state)).collect();
    println!("[{}, [{}], [", count, rows.join(", "));
    let mut tried = |settings: Settings, p: &_, room: usize| {
        simulate(p, &settings, START, &x, &SCALES, &mut memory[..room], &mut ()).unwrap_err()
    };
    let mut refused: Vec<Refused> = Vec::new();
    refused.push(tried(Settings { step: 0.0, ..SETTINGS }, &p, MEMORY));
    refused.push(tried(Settings { tolerance: 0.0, ..SETTINGS }, &p, MEMORY));
    refused.push(tried(Settings { until: f64::INFINITY, ..SETTINGS }, &p, MEMORY));
    refused.push(tried(SETTINGS, &[f64::NAN; hybrid::model::P], MEMORY));
    refused.push(tried(SETTINGS, &p, MEMORY - 1));
    let words: Vec<_> = refused.iter().map(|each| format!("\\"{}\\"", each)).collect();
    println!("{}]]", words.join(", "));
}
"""
USING_ROOM = USING.replace("parameters: {k: 2}", "parameters: {k: 2, twice: 2*k}").replace("z: k}", "z: twice/2}")


@pytest.mark.parametrize("scheme", [pytest.param(name, marks=needs_cargo) for name in ("located", "relaxed")])
def test_parameters_settings_and_states_at_times(scheme: str, tmp_path: Path) -> None:
    text = USING_ROOM.replace("x >= 99", "x >= 4").replace("{x: z - y}", "{x: 0}")
    model = hsdsl.loads(text)
    method = {"scheme": scheme} | ({} if scheme == "located" else {"method": "dopri5", "relaxation": 0.01})
    crate = exported(model, tmp_path, "rust", **method)
    (crate / "examples" / "own.rs").write_text(OWN)
    count, rows, refused = json.loads(cargo(crate, "run", "-q", "--example", "own"))
    run = model.simulate(parameters={"k": 3}, until=4, **method)
    assert count == len(run.transitions) > 0
    samples = run.sample([k / 8 for k in range(33)])
    assert [list(row) for row in zip(*(samples[name].tolist() for name in ("x", "y", "z")), strict=True)] == rows
    assert refused == [
        "the setting step has a value that it cannot have",
        "the setting tolerance has a value that it cannot have",
        "the setting until has a value that it cannot have",
        "expected a number for the parameter k",
        refused[-1],
    ]
    assert refused[-1].startswith("expected ") and " words of memory, got " in refused[-1]


BOTH = """
use one::model as a;
use two::model as b;

fn main() {
    let (p, q) = (a::parameters(), b::parameters());
    let mut memory = vec![0; one::MEMORY.max(two::MEMORY)];
    let first = one::simulate(&p, &a::SETTINGS, a::START, &a::initial(&p), &a::SCALES, &mut memory, &mut ()).unwrap();
    let second = two::simulate(&q, &b::SETTINGS, b::START, &b::initial(&q), &b::SCALES, &mut memory, &mut ()).unwrap();
    println!("[{:?}, {:?}]", first.state, second.state);
}
"""


@pytest.mark.slow
@pytest.mark.parametrize("features", [pytest.param(name, marks=needs_cargo) for name in ("std", "")])
def test_one_program_has_several_models(features: str, tmp_path: Path) -> None:
    models = {"one": model_of("bouncing-ball"), "two": model_of("thermostat")}
    lines = ['[package]\nname = "both"\nversion = "0.1.0"\nedition = "2018"\n[dependencies]']
    for name, model in models.items():
        exported(model, tmp_path / name, "rust")
        package = source_of(model, {}).name
        default = "" if features else ", default-features = false"
        lines.append(f'{name} = {{ path = "{name}", package = "{package}"{default} }}')
    write({"Cargo.toml": "\n".join(lines).encode(), "src/main.rs": BOTH.encode()}, tmp_path, force=True)
    found = json.loads(cargo(tmp_path, "run", "-q"))
    assert found == [list(map(float, model.simulate().final.state.values())) for model in models.values()]


@pytest.mark.parametrize("features", [pytest.param(name, marks=needs_cargo) for name in ("std", "")])
def test_only_with_std_a_chain_has_more_modes_than_memory_was_given_for(features: str, tmp_path: Path) -> None:
    path = ROOT / "tests" / "conformance" / "cases" / "m10-chain-without-end.yaml"
    crate = exported(hsdsl.load(path), tmp_path, "rust", max_transitions=3000)
    words = [] if features else ["--no-default-features"]
    found = json.loads(cargo(crate, "run", "-q", "--example", "transitions", *words))
    assert found["stop"]["reason"] == ("transition_limit" if features else "interrupted")
    if not features:
        objects = list((crate / "target").rglob("libm10_*.a"))
        assert objects and not any(word in path.read_bytes() for path in objects for word in (b"malloc", b"calloc"))
