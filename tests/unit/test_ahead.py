"""A model lowered in other processes is the one lowered here, and its errors are the same."""

from __future__ import annotations

import os
import select
import signal
import sys
from pathlib import Path

import pytest
from shipped import MODELS

from hsdsl.base.errors import ModelError
from hsdsl.engine import ahead
from hsdsl.engine.preparation.pipeline import pipeline_of
from hsdsl.language.elaborate import elaborate_files
from hsdsl.language.files import ModelFiles
from hsdsl.mathematics.lower import lower

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="there is no other process elsewhere")


@pytest.fixture(autouse=True)
def loaded(monkeypatch, tmp_path):
    """Begin although much is loaded in this process, with nothing in the cache."""
    monkeypatch.setattr(ahead, "_saves_time", lambda: True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


@pytest.mark.parametrize("large", [0.0, float("inf")])
@pytest.mark.parametrize("name", ["digital-control", "oscillator-with-stop-2", "parts/balls"])
def test_the_program_and_its_files_are_those_made_here(name, large, monkeypatch):
    monkeypatch.setattr(ahead, "LARGE", large)
    files = ModelFiles.read(MODELS / f"{name}.yaml")
    ahead.begin(files)
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
    ((_, other, _),) = ahead._begun
    os.kill(other, signal.SIGKILL)
    assert ahead.taken(files) is None


def test_a_large_answer_that_nobody_reads_keeps_no_process(monkeypatch):
    monkeypatch.setattr(ahead, "_lowered", lambda files: bytes(1 << 22))  # more than any pipe holds
    ahead.begin(ModelFiles.read(MODELS / "thermostat.yaml"))
    _, other, answer = ahead._begun.pop()
    os.close(answer)
    assert ends(other)


def test_another_model_is_not_taken_for_it_and_nothing_is_left():
    files = ModelFiles.read(MODELS / "thermostat.yaml")
    ahead.begin(files)
    ((_, other, _),) = ahead._begun
    assert ahead.taken(ModelFiles.read(MODELS / "bouncing-ball.yaml")) is None
    ahead._end_all()
    assert not ahead._begun
    with pytest.raises(ProcessLookupError):
        os.kill(other, 0)


@pytest.mark.parametrize("options", [[], ["--json"], ["-q", "--json"]])
def test_a_plain_run_begins_before_its_words_are_read(options, monkeypatch):
    model = str(MODELS / "thermostat.yaml")
    ahead.begin_run(["run", model, *options])
    assert len(ahead._begun) == 1
    assert ahead.taken(ModelFiles.read(Path(model))) and not ahead._begun


@pytest.mark.parametrize("words", [[], ["run"], ["lint", "m.yaml"], ["run", "m.yaml", "--until", "1"], ["run", "none"]])
def test_other_commands_begin_themselves(words, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text("hsdsl: 1")
    ahead.begin_run(words)
    assert not ahead._begun


def ends(process):
    """Whether a process ends by itself; it does not last longer."""
    ended, _, _ = select.select([os.pidfd_open(process)], [], [], 60)
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return bool(ended)
