"""A model lowered in other processes is the one lowered here, and its errors are the same."""

from __future__ import annotations

import os
import select
import signal
import sys
from pathlib import Path

import pytest
from shipped import MODELS

import hsdsl
from hsdsl.base.cache import making
from hsdsl.base.errors import ModelError
from hsdsl.engine import ahead
from hsdsl.engine.preparation.pipeline import pipeline_of
from hsdsl.engine.runtime import kernel, library
from hsdsl.engine.runtime.compiler import NoCompiler, find_compiler
from hsdsl.language.elaborate import elaborate_files
from hsdsl.language.files import ModelFiles
from hsdsl.mathematics.lower import lower

ROBERTSON = """\
hsdsl: 1
modes: {m: {flow: {a: -0.04*a + 1e4*b*c, b: 0.04*a - 1e4*b*c - 3e7*b**2, c: 3e7*b**2}}}
initial: {mode: m, a: 1, b: 0, c: 0}
experiment: {until: 400, tolerance: 1e-6}
"""
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there is no other process elsewhere")


@pytest.fixture(autouse=True)
def loaded(monkeypatch, tmp_path):
    """Begin although much is loaded in this process, with nothing in the cache."""
    monkeypatch.setattr(ahead, "_saves_time", lambda: True)
    monkeypatch.setattr(ahead, "_seen", [])
    monkeypatch.setattr(ahead, "_going_on", [])
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


@pytest.mark.parametrize("large", [0.0, float("inf")])
@pytest.mark.parametrize("name", ["digital-control", "oscillator-with-stop-2", "parts/balls"])
def test_the_program_and_its_files_are_those_made_here(name, large, monkeypatch):
    monkeypatch.setattr(ahead, "LARGE", large)
    files = ModelFiles.read(MODELS / f"{name}.yaml")
    ahead.begin(files, compiled=False)
    program, sliding, complete = ahead.taken(files) or pytest.fail("no answer")
    system = elaborate_files(files).system
    assert program == lower(system) and sliding is None
    assert complete == files.with_data(system.files)
    assert ahead.taken(files) is None


def test_a_half_without_an_answer_is_done_here():
    here, place = os.getpid(), []
    assert ahead._both(lambda: 1, lambda: place.append(0) or (2 if os.getpid() == here else os._exit(1))) == (1, 2)
    assert place == [0]


def test_errors_of_a_half_are_raised_here():
    with pytest.raises(ZeroDivisionError):
        ahead._both(lambda: 1, lambda: 1 // 0)


def test_errors_are_those_found_here():
    text = b"hsdsl: 1\nmodes: {a: {flow: {x: y + (}}}\ninitial: {mode: b, x: 0}\nexperiment: {until: 1}\n"
    files = ModelFiles.read("bad.yaml", None, text)
    ahead.begin(files)
    with pytest.raises(ModelError) as there:
        ahead.taken(files)
    with pytest.raises(ModelError) as here:
        elaborate_files(files)
    assert there.value.diagnostics == here.value.diagnostics
    assert len(here.value.diagnostics) > 1


def test_a_method_that_does_not_exist_is_refused_with_its_place():
    system = "modes: {a: {flow: {x: 1}}}\ninitial: {mode: a, x: 0}\n"
    files = ModelFiles.read("bad.yaml", None, f"hsdsl: 1\n{system}experiment: {{until: 1, method: ode45}}\n".encode())
    ahead.begin(files)
    with pytest.raises(ModelError) as error:
        pipeline_of(files.path, None, files.text).resolve()
    assert [(each.code, each.span.line, each.span.column) for each in error.value.diagnostics] == [("HS204", 4, 32)]


def test_without_an_answer_there_is_none():
    files = ModelFiles.read(MODELS / "thermostat.yaml")
    ahead.begin(files)
    ((_, other),) = ahead._begun
    os.kill(other.process, signal.SIGKILL)
    assert ahead.taken(files) is None


def test_a_large_answer_that_nobody_reads_keeps_no_process(monkeypatch):
    monkeypatch.setattr(ahead, "_lowered", lambda files: bytes(1 << 22))  # more than any pipe holds
    ahead.begin(ModelFiles.read(MODELS / "thermostat.yaml"))
    _, other = ahead._begun.pop()
    os.close(other.answer)
    assert ends(other.process)


def test_another_model_is_not_taken_for_it_and_nothing_is_left():
    files = ModelFiles.read(MODELS / "thermostat.yaml")
    ahead.begin(files)
    ((_, other),) = ahead._begun
    assert ahead.taken(ModelFiles.read(MODELS / "bouncing-ball.yaml")) is None
    ahead._end_all()
    assert not ahead._begun
    with pytest.raises(ProcessLookupError):
        os.kill(other.process, 0)


@pytest.mark.parametrize("options", [[], ["--json"], ["-q", "--json"]])
def test_a_plain_run_begins_before_its_words_are_read(options, monkeypatch):
    monkeypatch.setattr(library, "loop", lambda: None)  # which takes seconds to compile
    model = str(MODELS / "thermostat.yaml")
    ahead.begin_run(["run", model, *options])
    ahead.begin(ModelFiles.read(Path(model)))  # as the command does
    ((_, other),) = ahead._begun
    assert ahead.taken(ModelFiles.read(Path(model))) and not ahead._begun
    os.waitpid(other.process, 0)
    assert not ahead.compiling()
    assert len([*Path(os.environ["XDG_CACHE_HOME"]).glob("hsdsl/compiled/*/*.so")]) == 1


def compiling_for(looks, monkeypatch):
    """Have compiled code not be there the first times that it is looked for."""
    left = iter(range(looks))
    monkeypatch.setattr(ahead, "compiling", lambda: next(left, None) is not None)


@pytest.mark.parametrize(("looks", "engine"), [(10**9, "python"), (7, "c")])
@pytest.mark.parametrize("name", ["bouncing-ball", "thermostat", "robertson"])
def test_a_run_does_not_wait_for_the_compiler(name, looks, engine, tmp_path, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    path = MODELS / f"{name}.yaml"
    if name == "robertson":  # the method is chosen anew under way
        path = tmp_path / "robertson.yaml"
        path.write_text(ROBERTSON)
    expected = hsdsl.load(path).simulate(engine="c")
    compiling_for(looks, monkeypatch)
    run = hsdsl.load(path).simulate()
    assert (run.engine, run.method, expected.engine) == (engine, expected.method, "c")
    assert run.times.tobytes() == expected.times.tobytes() and run.values.tobytes() == expected.values.tobytes()
    assert (run.stop, run.transitions, run.verdict) == (expected.stop, expected.transitions, expected.verdict)


@pytest.mark.parametrize("words", [[], ["run"], ["lint", "m.yaml"], ["run", "m.yaml", "--until", "1"], ["run", "none"]])
def test_other_commands_begin_themselves(words, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text("hsdsl: 1")
    ahead.begin_run(words)
    assert not ahead._begun


def test_what_makes_many_runs_waits_for_the_compiler(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    monkeypatch.setattr(ahead, "compiling", lambda: True)
    first = model.simulate()
    assert (first.engine, first.sensitivity("e").execution.engine) == ("python", "c")
    assert (model.ensemble(parameters={"e": [0.5, 0.6]}).engine, model.simulate().engine) == ("c", "c")


def test_a_finer_run_takes_the_code_that_is_there_by_then(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    compiling_for(10**9, monkeypatch)
    first = model.simulate()
    compiling_for(0, monkeypatch)
    assert (first.engine, first.repetition(first).engine) == ("python", "c")


def test_a_compiler_that_fails_meanwhile_costs_the_run_nothing(monkeypatch, capfd):
    model, begun, tried = hsdsl.load(MODELS / "bouncing-ball.yaml"), [], []

    def fails(program):
        tried.append(program)
        raise NoCompiler(f"it failed in {os.environ['XDG_CACHE_HOME']}")

    monkeypatch.setattr(kernel, "compiled", fails)
    compiling_for(7, monkeypatch)
    run = model.simulate(watch=begun.append)
    assert (run.engine, len(begun), len(tried)) == ("python", 1, 1)
    assert capfd.readouterr().err.count("it failed in") == 1


def ends(process):
    """Whether a process ends by itself; it does not last longer."""
    ended, _, _ = select.select([os.pidfd_open(process)], [], [], 60)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return bool(ended)


def test_what_goes_on_holds_nothing_open(monkeypatch):
    monkeypatch.setattr(ahead, "_compile", lambda lowered: signal.pause())
    end, other_end = os.pipe()
    ahead.begin(files := ModelFiles.read(MODELS / "thermostat.yaml"))
    ((_, other),) = ahead._begun
    assert ahead.taken(files)
    os.close(other_end)
    closed, _, _ = select.select([end], [], [], 60)
    goes_on = ahead.compiling()
    os.kill(other.process, signal.SIGKILL)
    os.waitpid(other.process, 0)
    assert closed and os.read(end, 1) == b"" and goes_on and not ahead.compiling()


@pytest.mark.parametrize("closed", [False, True])
def test_nobody_compiles_what_others_do_or_what_is_not_kept(closed, monkeypatch, tmp_path):
    files = ModelFiles.read(MODELS / "thermostat.yaml")
    compiler, program = find_compiler(), lower(elaborate_files(files).system)
    keys = [library._key(each, compiler) for each in (library._content(program), library.LOOP[0])]
    if closed:
        monkeypatch.setenv("XDG_CACHE_HOME", __file__)
    monkeypatch.setattr(library, "_made", lambda *_: (tmp_path / "made").touch())
    with making(library.KIND, keys[0]), making(library.KIND, keys[1]):
        ahead.begin(files)
        ((_, other),) = ahead._begun
        assert ahead.taken(files)
        assert ends(other.process) and not (tmp_path / "made").exists()


def test_a_run_does_not_wait_for_what_another_process_compiles():
    model = hsdsl.load(MODELS / "bouncing-ball.yaml")
    key = library._key(library._content(model.program), find_compiler())
    with making(library.KIND, key):
        assert library.made_elsewhere(library._content(model.program))()
        first = model.simulate()
    second = hsdsl.load(MODELS / "bouncing-ball.yaml").simulate()
    assert (first.engine, second.engine) == ("python", "c")
    assert first.values.tobytes() == second.values.tobytes() and first.transitions == second.transitions
