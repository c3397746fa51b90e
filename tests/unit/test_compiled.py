"""The compiled engine around its loop: structures, memory that grows, Ctrl-C, progress, a choice of engines."""

from __future__ import annotations

import ctypes
import math
import os
import signal
import subprocess
import threading
import time

import pytest
from engines import assert_engines_agree, needs_compiler
from shipped import MODELS

import hsdsl
from hsdsl.base.errors import UsageError
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.compiler import FLAGS, find_compiler
from hsdsl.engine.runtime.library import print_scheme
from hsdsl.engine.simulate import output_buffers
from hsdsl.interface.model import Model
from hsdsl.language.elaborate import elaborate

OSCILLATOR = MODELS / "oscillator-with-stop-1.yaml"


def model(text: str) -> Model:
    return Model(elaborate("model.yaml", text=text.encode()))


@needs_compiler
def test_the_compiler_lays_out_structures_and_numbers_names_as_they_were_read(tmp_path):
    ours: list[int] = []
    lines: list[str] = []
    for name, structure in structures.STRUCTURES.items():
        fields = [field for field, _ in structure._fields_]
        ours += [ctypes.sizeof(structure), *(getattr(structure, field).offset for field in fields)]
        lines += [f"sizeof({name})", *(f"offsetof({name}, {field})" for field in fields)]
    for words in structures.ENUMERATIONS.values():
        ours += range(len(words))
        lines += [f"HS_{word.upper().replace(' ', '_')}" for word in words]
    source, library = tmp_path / "layout.c", tmp_path / "layout.so"
    numbers = ", ".join(f"(long long)({line})" for line in lines)
    headers = "".join(f"#include {name}\n" for name in ("<stddef.h>", '"hs_screen.h"', '"hs_lanes.h"'))
    source.write_text(f"{headers}HS_EXPORT long long layout[] = {{{numbers}}};\n")
    find_compiler().build([source], [structures.FOLDER], library, "-O1", FLAGS)
    theirs = (ctypes.c_longlong * len(ours)).in_dll(ctypes.CDLL(str(library)), "layout")
    assert list(theirs) == ours
    assert len(ours) > 200


@needs_compiler
@pytest.mark.parametrize(
    "name", ["functions.h", "hs_math.h", "hs_series.h", "hs_screen.h", "run.h", "hs.c", "library.c", "lane.h"]
)
def test_what_is_compiled_or_included_alone_includes_what_it_uses(name, tmp_path):
    flags = ["-std=c99", "-fsyntax-only", "-Werror=implicit-function-declaration", f"-I{print_scheme(tmp_path)}"]
    command = [*find_compiler().command, *flags]
    done = subprocess.run([*command, str(structures.FOLDER / name)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@needs_compiler
def test_rows_in_many_chunks_are_the_same_rows(monkeypatch):
    monkeypatch.setattr(output_buffers, "LEAST_ROWS", 16)
    monkeypatch.setattr(output_buffers, "MOST_ROWS", 64)
    oscillator = hsdsl.load(OSCILLATOR)
    for settings in (
        {"method": "dopri5", "tolerance": 1e-6},
        {"method": "rk4", "step": 0.02},
        {"method": "midpoint", "step": 0.02},
    ):
        run = assert_engines_agree(oscillator, until=40, **settings)
        assert len(run.times) > 500


COUNTDOWN = """
hsdsl: 1
modes:
  a:
    flow: {x: 0, y: 1}
    transitions:
      - {name: down, when: x >= 0, to: b, reset: {x: x - 1}}
  b:
    flow: {x: 0, y: 1}
    transitions:
      - {name: on, when: x >= 0, to: a}
initial: {mode: a, x: 700, y: 0}
experiment: {until: 1}
"""


@needs_compiler
def test_a_long_chain_at_one_instant_needs_more_room():
    run = assert_engines_agree(model(COUNTDOWN), method="euler", step=0.25)
    assert len(run.transitions) > 1000 and run.stop.reason == "until"
    circle = model(COUNTDOWN.replace("x: x - 1", "x: 'x + 1 - 500*max(0, sign(x - 1100))'"))
    run = assert_engines_agree(circle, method="euler", step=0.25)
    assert run.stop.reason == "zeno" and len(run.transitions) == 1000


def press_when_under_way(run):
    """Press Ctrl-C once a run has got somewhere."""

    def press():
        while run.now < 1:
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()


BEYOND = """
hsdsl: 1
modes:
  a:
    flow: {x: 1}
    transitions: [{name: up, when: x >= 1, to: b}]
  b:
    flow: {x: 1}
    transitions: [{name: on, when: x >= 0.5, to: a, reset: {x: -9}}]
initial: {mode: a, x: 0}
experiment: {until: 2, scheme: located, tolerance: 1e-6}
"""


@needs_compiler
def test_a_run_remembers_its_entries_when_its_workspace_is_used_again():
    beyond = model(BEYOND)
    first = beyond.simulate(engine="c")
    assert beyond.simulate(0.5, engine="c").made == 0
    assert first.enters_beyond == any(t.entry for t in first.transitions) is True


@needs_compiler
def test_control_c_keeps_what_was_computed():
    endless = {"until": 1e9, "method": "dop853", "step": 1e-4, "relaxation": 1e-9, "max_transitions": 10**9}
    run = hsdsl.load(OSCILLATOR).simulate(**endless, engine="c", watch=press_when_under_way)
    assert run.stop.reason == "interrupted" and run.stop.time == run.times[-1] >= 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@needs_compiler
def test_a_run_can_be_watched():
    seen = []
    run = hsdsl.load(OSCILLATOR).simulate(watch=seen.append, engine="c")
    assert (seen[0].now, seen[0].made, seen[0].until) == (run.stop.time, len(run.transitions), run.stop.time)


def test_without_a_compiler_python_runs_and_one_line_says_so(monkeypatch, capsys):
    monkeypatch.setenv("CC", "/no/such/compiler")
    oscillator = hsdsl.load(OSCILLATOR)
    assert [oscillator.simulate(until=0.1).engine for _ in range(2)] == ["python"] * 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1 and "/no/such/compiler" in printed
    with pytest.raises(UsageError, match="engine 'c' cannot run this"):
        oscillator.simulate(until=0.1, engine="c")


def test_an_output_without_a_value_between_rows_has_none_in_any_engine():
    text = (
        "hsdsl: 1\n"
        "inputs: {u: {times: [0, 1], values: [1, 0], hold: zero}}\n"
        "modes: {m: {flow: {x: 1}}}\n"
        "outputs: {q: 1/u, r: x}\n"
        "initial: {mode: m, x: 0}\n"
        "experiment: {until: 2, method: dopri5, scheme: relaxed}\n"
    )
    model = hsdsl.loads(text)
    for engine in ("python", "c"):
        found = model.simulate(engine=engine).sample([0.3, 1.3])["q"]
        assert found[0] == 1 and math.isnan(found[1]), engine
