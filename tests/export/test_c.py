"""Programs in C against runs: every digit of every transition."""

from __future__ import annotations

import platform
import re
import subprocess
import sys
from pathlib import Path
from shutil import which
from typing import Any

import pytest
from export.c_builds import COMPILERS, OF_PACKAGES, USING, built, exported, objects, output, runtime_object
from shipped import MODELS, assert_golden

import hsdsl
from hsdsl.analysis.report import as_json
from hsdsl.engine.runtime.library import RUNTIME
from hsdsl.export import files_of, source_of
from hsdsl.export.c import COMPILED, MEASURED, SMALL, SMALL_MEASURED, c_sources
from hsdsl.interface.cli.verbs import obey

EVENTS = Path(__file__).parents[1] / "conformance" / "events"
FAST = {"bouncing-ball", "thermostat", "digital-control"}
# the fast ones by every compiler, of the others one in turn; all in a campaign
EACH = [
    pytest.param(
        path.stem, compiler,
        marks=[pytest.mark.exports] * (compiler in OF_PACKAGES) if path.stem in FAST
        else pytest.mark.campaign if (k + i) % len(COMPILERS) else pytest.mark.slow,
    )
    for k, path in enumerate(sorted(MODELS.glob("*.yaml")))
    for i, compiler in enumerate(COMPILERS)
]  # fmt: skip
# schemes and methods on models where each of them has something to do
OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("bouncing-ball", {"scheme": "relaxed", "method": "rk4", "step": 1e-2, "relaxation": 1e-4}),
    ("bouncing-ball", {"method": "dopri5", "tolerance": 1e-6, "until": 14}),
    ("thermostat", {"method": "dop853"}),
    ("digital-control", {"scheme": "relaxed", "method": "euler", "step": 1e-2, "relaxation": 1e-3}),
    ("stiff-switch", {"method": "radau", "tolerance": 1e-5}),
]
INPUTS = """
hsdsl: 1
title: "*/ int main; /* ??/ \\\\ \\" %s"
parameters: {k: 2, half: k/2}
inputs:
  u: {times: [0, 1, 2.5], values: [1, -1, half], hold: zero}
  w: {times: [0, 3], values: [0, 1], hold: linear}
modes:
  on:
    flow: {x: u + w + sign(sin(k*t)), y: -y}
    transitions:
      - {name: "a \\"b\\" \\\\ %d ??/ ü", when: x >= 1, to: on, reset: {x: -half}}
      - {when: y <= 1/20, to: off, reset: {z: y}}
  off: {flow: {z: 1}, transitions: [{when: z >= 2, to: end}]}
  end: {final: true}
outputs: {sum: x + y}
initial: {mode: on, x: 0, y: k}
experiment: {until: 12, method: dopri5}
"""


def same(folder: Path, model: Any, compiler: list[str], **arguments: Any) -> Any:
    """A run and the exported program's output, which must be equal."""
    run = as_json(model.simulate(**arguments, engine="c"))
    found = output(built(exported(model, folder, **arguments), compiler))
    for key in ("transitions", "final"):
        assert found[key] == run[key], key
    assert found["stop"] == {key: run["stop"][key] for key in ("reason", "time")}
    return found


@pytest.mark.parametrize(("name", "compiler"), EACH)
def test_every_model_prints_the_transitions_of_its_run(name: str, compiler: str, tmp_path: Path) -> None:
    found = same(tmp_path, hsdsl.load(MODELS / f"{name}.yaml"), COMPILERS[compiler])
    assert found["transitions"]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "arguments"), OTHERS)
def test_other_schemes_and_methods(name: str, arguments: dict[str, Any], tmp_path: Path) -> None:
    same(tmp_path, hsdsl.load(MODELS / f"{name}.yaml"), next(iter(COMPILERS.values())), **arguments)


def test_inputs_switches_final_modes_and_hostile_texts(tmp_path: Path) -> None:
    found = same(tmp_path, hsdsl.loads(INPUTS), next(iter(COMPILERS.values())))
    assert {made["edge"] for made in found["transitions"]} == {'a "b" \\ %d ??/ ü', "on->off", "off->end"}


CHECK = """
#include <stdio.h>
#include "instance.h"
int main(void) {
  long space = (long)hs_workspace(&hs_the_model, &problem_method, (hs_scheme)problem_settings.scheme);
  printf("[%ld, %ld]\\n", space, (long)PROBLEM_WORKSPACE);
  return 0;
}
"""
SPACES = [("bouncing-ball", {}), ("stiff-switch", {"method": "radau"}), ("pronking-runner", {"method": "dop853"}),
          ("constrained-pendulum", {"scheme": "relaxed", "method": "euler", "step": 0.1})]  # fmt: skip


@pytest.mark.parametrize(("name", "arguments"), SPACES)
def test_static_memory_is_what_the_runtime_takes(name: str, arguments: dict[str, Any], tmp_path: Path) -> None:
    folder = exported(hsdsl.load(MODELS / f"{name}.yaml"), tmp_path, **arguments)
    (folder / "check.c").write_text(CHECK)
    taken, given = output(built(folder, next(iter(COMPILERS.values())), main="check.c"))
    assert taken == given > 0


def test_what_events_remember_is_no_state(tmp_path: Path) -> None:
    run = as_json((model := hsdsl.load(EVENTS / "m13-priority.yaml")).simulate(engine="c"))
    found = output(built(exported(model, tmp_path), next(iter(COMPILERS.values()))))
    assert found["transitions"] == run["transitions"]
    assert found["final"]["state"] == run["final"]["state"]


SINGLE_TOLERANCE = 32 * 2.0**-24  # of a step in 32-bit floats, relative to sizes; the same of time, over a run
STUCK = {"oscillator-with-stop-2"}  # how often a relaxed run hits while a mass is stuck is a matter of rounding


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((MODELS / "gallery").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_scene_of_the_gallery_prints_the_transitions_of_its_run(path: Path, tmp_path: Path) -> None:
    same(tmp_path, hsdsl.load(path), next(iter(COMPILERS.values())))


@pytest.mark.parametrize(("name", "compiler"), EACH)
def test_every_model_in_single_precision(name: str, compiler: str, tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / f"{name}.yaml")
    run = model.simulate(engine="c")
    found = output(built(exported(model, tmp_path), COMPILERS[compiler], "-DHS_FLOAT32"))
    allowed = SINGLE_TOLERANCE * run.stop.time
    if name in STUCK:
        assert list(found["final"]["state"].values()) == pytest.approx(list(run.final.state.values()), abs=1e-5)
        return
    both = [
        [(edge, time) for edge, time in made if time < run.stop.time - allowed]
        for made in (
            [(made["edge"], made["time"]) for made in found["transitions"]],
            [(made.edge, made.time) for made in run.transitions],
        )
    ]
    assert [edge for edge, _ in both[0]] == [edge for edge, _ in both[1]]
    assert max(abs(a - b) for (_, a), (_, b) in zip(*both, strict=True)) <= allowed


def test_numbers_of_a_program_are_as_they_were() -> None:
    files = files_of(source_of(hsdsl.load(MODELS / "thermostat.yaml"), {}), "c")
    names = ("problem.h", "model.c", "problem.c")
    found = "".join(f"/* {name} */\n" + files[name].decode().partition("*/\n")[2] for name in names)
    assert_golden(found, Path(__file__).parent / "golden" / "thermostat.c.txt")


def test_nothing_is_allocated(tmp_path: Path) -> None:
    folder = exported(hsdsl.load(MODELS / "thermostat.yaml"), tmp_path)
    for made in objects(folder, next(iter(COMPILERS.values()))):
        assert not any(word in made.read_bytes() for word in (b"malloc", b"calloc", b"alloca", b"free\0"))


@pytest.mark.slow
def test_cmake_builds_it(tmp_path: Path) -> None:
    if not (cmake := which("cmake")):
        pytest.skip("no cmake here")
    model = hsdsl.load(MODELS / "thermostat.yaml")
    folder = exported(model, tmp_path / "export")
    for step in (["-S", str(folder), "-B", str(tmp_path / "build")], ["--build", str(tmp_path / "build")]):
        done = subprocess.run([cmake, *step], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert output(tmp_path / "build" / "model")["transitions"] == as_json(model.simulate(engine="c"))["transitions"]


def test_a_scheme_without_a_c_loop_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    ball = str(MODELS / "oscillator-with-stop-1.yaml")
    assert obey(["export", ball, "--to", "c", "--scheme", "paoli-schatzman", "--out", str(out)]) == 2
    assert "paoli-schatzman" in capsys.readouterr().err
    assert not out.exists()


def test_exports_that_call_c_have_the_words_of_its_stop_reasons() -> None:
    export = Path(hsdsl.__file__).parent / "export"
    header = (RUNTIME / "hs_simulate.h").read_text()
    expected = {*re.findall(r"^  reason\(\w+, (\w+)\)", header, re.MULTILINE)} - {"stuck"}
    expected |= {"step_underflow"}  # one of the words that a stuck run has
    lists = {
        "c/parts/given.h": r"words\[\] = \{(.*?)\}",
        "rust/crate/src/lib.rs": r"const ALL.*?\[(\n.*?)\];",
        "matlab/parts/hsdsl_simulate.m": r"words = \{(.*?)\}",
    }
    found = [re.findall(r"[\"'](\w+)[\"']", re.search(pattern, (export / path).read_text(), re.DOTALL)[1])
             for path, pattern in lists.items()]  # fmt: skip
    assert [*found[0], "interrupted"] == found[1] == found[2]
    assert {*found[1]} == expected


STACK = """
#define _XOPEN_SOURCE 700
#include <stdio.h>
#include <string.h>
#include <ucontext.h>
#include "instance.h"
static hs_instance instance;
static unsigned char stack[1 << 20];
static ucontext_t back, there;
static void go(void) {
  hs_open(&instance);
  hs_run_instance(&instance);
}
int main(void) {
  size_t i = 0;
  memset(stack, 0xA5, sizeof stack);
  getcontext(&there);
  there.uc_stack.ss_sp = stack;
  there.uc_stack.ss_size = sizeof stack;
  there.uc_link = &back;
  makecontext(&there, go, 0);
  swapcontext(&back, &there);
  while (stack[i] == 0xA5) i++;
  printf("[%lu, %lu]\\n", (unsigned long)(sizeof stack - i), (unsigned long)sizeof instance);
  return 0;
}
"""
RELAXED = {"scheme": "relaxed", "method": "rk4", "step": 1e-3, "relaxation": 1e-5}
BUILDS = [
    (scheme, single, small) for scheme in ("relaxed", "located") for single in (False, True) for small in (False, True)
]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux" or platform.machine() != "x86_64" or "gcc" not in COMPILERS, reason="gcc")
@pytest.mark.parametrize(("scheme", "single", "small"), BUILDS)
def test_sizes_are_at_most_those_of_the_readme(scheme: str, single: bool, small: bool, tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    folder = exported(model, tmp_path, **(RELAXED if scheme == "relaxed" else {}))
    options = [*(("-DHS_FLOAT32",) if single else ()), *(SMALL if small else ()), "-Os"]
    command = ["gcc", "-std=c99", *options, "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"]
    runtime, own = runtime_object(tuple(command)), [name for name in COMPILED if name != "runtime/hs.c"]
    (folder / "stack.c").write_text(STACK)
    subprocess.run([*command, "-I.", "-Iruntime", "-c", "main.c", "stack.c", *own], cwd=folder, check=True)
    shared = [runtime, *(f"{Path(name).stem}.o" for name in own)]
    for main in ("main", "stack"):
        link = [*command, "-Wl,--gc-sections", f"{main}.o", *shared, "-lm", "-o", main]
        subprocess.run(link, cwd=folder, check=True)
    stated = (SMALL_MEASURED if small else MEASURED)[scheme][single]
    sizes = subprocess.run(["size", str(folder / "main")], capture_output=True, text=True, check=True).stdout
    code, data, _ = map(int, sizes.splitlines()[1].split()[:3])
    stack, static = output(folder / "stack")
    measured = {"code": code + data, "static": static, "stack": stack}
    print(measured)
    assert all(0.6 * getattr(stated, name) < value <= getattr(stated, name) for name, value in measured.items()), (
        measured
    )


@pytest.mark.slow
def test_a_run_in_stretches_makes_the_same_transitions(tmp_path: Path) -> None:
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    folder = exported(model, tmp_path)
    text = (folder / "main.c").read_text()
    stretches = """
  hs_begin_instance(&instance, 0.0);
  for (int i = 1; i <= 120; i++) hs_advance(&instance, 0.1 * i, 0, 0);
"""
    assert "  hs_run_instance(&instance);\n" in text
    (folder / "stretches.c").write_text(text.replace("  hs_run_instance(&instance);\n", stretches))
    found = output(built(folder, next(iter(COMPILERS.values())), main="stretches.c"))
    run = model.simulate()
    assert [t["time"] for t in found["transitions"]] == pytest.approx([t.time for t in run.transitions], abs=1e-9)


SET_START = """
#include <stdio.h>
#include "instance.h"

static hs_instance run;

int main(void) {
  const double tried[][4] = {{0, 0, 0, 0}, {0, 4, 0, 0}, {1, 4, 0, 0}, {1, 4, 7, 0}, {0, 0, 0, 3}};
  printf("[");
  for (int k = 0; k < 5; k++) {
    hs_open(&run);
    for (int s = 0; s < 3; s++)
      if (tried[k][s] != 0) run.x[s] = tried[k][s], run.given[s] = 1;
    if (tried[k][3] != 0) run.parameters[0] = tried[k][3];
    if (hs_tune(&run) || hs_start(&run)) return 2;
    printf("%s[%.17g, %.17g, %.17g]", k ? ", " : "", run.x[0], run.x[1], run.x[2]);
  }
  printf("]\\n");
  return 0;
}
"""


@pytest.mark.parametrize("initial", [{}, {"y": 5}, {"x": 1, "y": 0.5}])
def test_initial_values_follow_those_that_they_use(initial: dict[str, float], tmp_path: Path) -> None:
    model = hsdsl.loads(USING)
    files = c_sources(source_of(model, {"initial": initial}), tunable=True)
    for name, content in (files | {"start.c": SET_START.encode()}).items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    found = output(built(tmp_path, next(iter(COMPILERS.values())), main="start.c"))
    columns = next(iter(model.simulate().arcs)).states
    assert columns == ("x", "y", "z")
    for (x, y, z, k), row in zip(
        [(0, 0, 0, 0), (0, 4, 0, 0), (1, 4, 0, 0), (1, 4, 7, 0), (0, 0, 0, 3)], found, strict=True
    ):
        given = initial | {name: value for name, value in zip(columns, (x, y, z), strict=True) if value}
        run = model.simulate(initial=given, parameters={"k": k or 2})
        assert row == [float(run.sample([0])[name][0]) for name in columns]
