"""Odd surroundings: full disks, closed streams, narrow encodings, no home. No traceback, and nothing lost."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from engines import needs_compiler
from shipped import MODELS

BALL = MODELS / "thermostat.yaml"
ODD = """hsdsl: 1
title: Schwingung \u00fc
modes:
  gr\u00f6\u00dfe: {flow: {\u03be: 1}, transitions: [{when: \u03be >= 1, to: gr\u00f6\u00dfe, reset: {\u03be: 0}}]}
initial: {mode: gr\u00f6\u00dfe, \u03be: 0}
experiment: {until: 2, step: 0.1, method: euler}
"""


def shell(command, folder, **environment):
    """A command line in a shell; `hsdsl` stands for this interpreter's own."""
    command = command.replace("hsdsl ", f"{sys.executable} -m hsdsl ")
    inherited = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    given = {**inherited, "HOME": str(folder), "XDG_CACHE_HOME": str(folder / "cache"), **environment}
    done = subprocess.run(["bash", "-c", command], cwd=folder, capture_output=True, env=given, timeout=120)
    errors = done.stderr.decode("utf-8", "replace")
    assert "Traceback" not in errors and "Exception ignored" not in errors, errors
    return done.returncode, done.stdout.decode("utf-8", "replace"), errors


FULL = ("run MODEL --engine python", "run MODEL --json --engine python", "validate MODEL", "schema", "explain HS101")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("words", FULL)
def test_a_full_disk_is_said(words, tmp_path):
    code, _, errors = shell(f"hsdsl {words.replace('MODEL', str(BALL))} > /dev/full", tmp_path)
    assert code == 2
    assert "hsdsl: cannot write the output: No space left on device" in errors


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_change_nothing(closed, tmp_path):
    assert shell(f"hsdsl run {BALL} --engine python --out run.csv {closed}", tmp_path)[0] == 0
    assert (tmp_path / "run.csv").stat().st_size > 0


def test_a_reader_who_leaves_early(tmp_path):
    assert shell("hsdsl schema | head -1; exit ${PIPESTATUS[0]}", tmp_path)[:2] == (0, "{\n")


def test_any_name_can_be_said_in_any_encoding(tmp_path):
    (tmp_path / "m.yaml").write_text(ODD, encoding="utf-8")
    for words in ("run m.yaml --engine python", "run m.yaml --json --engine python", "validate m.yaml", "lint m.yaml"):
        code, _, _ = shell(f"hsdsl {words}", tmp_path, LC_ALL="C", PYTHONIOENCODING="ascii", PYTHONUTF8="0")
        assert code in (0, 1), words


def test_a_file_is_kept_when_a_new_one_does_not_fit(tmp_path):
    (tmp_path / "run.csv").write_text("kept")
    code, _, errors = shell(f"ulimit -f 1; hsdsl run {BALL} --engine python --out run.csv -q", tmp_path)
    assert code == 2 and "cannot write run.csv" in errors
    assert (tmp_path / "run.csv").read_text() == "kept"
    assert [p.name for p in tmp_path.iterdir() if p.name.endswith(".part")] == []


def test_no_home_is_needed(tmp_path):
    command = f"unset HOME XDG_CACHE_HOME; hsdsl run {BALL} -q --engine python"
    assert shell(command, tmp_path)[0] == 0


def test_a_step_that_does_not_move_the_time_is_refused(tmp_path):
    code, _, errors = shell(f"hsdsl run {BALL} --step 1e-300 --engine python", tmp_path)
    assert code == 2 and "round-off" in errors


def test_an_interrupt_while_a_model_is_read_is_said(command, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hsdsl.interface.model.model.load", interrupted)
    answer = command("run", BALL)
    assert (answer.code, answer.out) == (130, "")


@needs_compiler
def test_a_full_folder_for_temporary_files_leaves_the_python_engine(tmp_path):
    """Files of at most a few kilobytes stand for a full file system."""
    code, out, errors = shell(f"ulimit -f 3; hsdsl run {BALL} --json", tmp_path, TMPDIR=str(tmp_path))
    assert code == 0 and json.loads(out)["engine"] == "python", errors
    assert errors == "" or (errors.count("\n") == 1 and "the Python engine runs this" in errors)
    code, out, errors = shell(f"ulimit -f 3; hsdsl run {BALL} --engine c", tmp_path, TMPDIR=str(tmp_path))
    assert code == 2 and out == "" and "engine 'c' cannot run this" in errors
