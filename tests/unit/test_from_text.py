"""Models from text, the message for a text in place of a path, and what tab completion lists."""

from __future__ import annotations

import sys

import pytest

import hsdsl
from hsdsl.base.errors import ModelError, UsageError

TEXT = """hsdsl: 1
inputs: {u: {file: u.csv, hold: zero}}
modes: {m: {flow: {x: u}}}
initial: {mode: m, x: 0}
experiment: {until: 1}
"""


def test_a_model_from_its_text(tmp_path):
    (tmp_path / "u.csv").write_text("time,u\n0,3\n")
    (tmp_path / "model.yaml").write_text(TEXT)
    loaded, read = hsdsl.loads(TEXT, tmp_path), hsdsl.load(tmp_path / "model.yaml")
    assert loaded.system.digest == read.system.digest
    run = loaded.simulate(parameters={}, initial={"x": "1+1"})
    assert run.final.state["x"] == pytest.approx(5)
    assert run.model == str(tmp_path / "<text>")
    assert float(hsdsl.distance(run, loaded.simulate(), model=loaded).upper) == pytest.approx(2)


def test_faults_of_a_text_have_places():
    with pytest.raises(ModelError) as raised:
        hsdsl.loads(TEXT.replace("x: u}", "x: w}").replace("{file: u.csv, hold: zero}", "t"))
    span = raised.value.diagnostics[0].span
    assert span is not None and (span.path, span.line) == ("<text>", 3)


@pytest.mark.parametrize("text", [TEXT, "hsdsl: 1", "a\nb"])
def test_a_text_for_a_path(text):
    with pytest.raises(UsageError, match="text of a model") as raised:
        hsdsl.load(text)
    assert raised.value.hint is not None and "hsdsl.loads(text)" in raised.value.hint
    assert any("hsdsl.loads" in note for note in raised.value.__notes__)  # a traceback shows it


def test_dir_lists_what_is_public():
    run = hsdsl.loads(TEXT.replace("{file: u.csv, hold: zero}", "t")).simulate()
    names = dir(run)
    assert {"transitions", "final", "verdict", "settings", "times", "save", "to_pandas"} <= set(names)
    assert not any(name.startswith("_") for name in names)
    assert all(hasattr(run, name) for name in names)
    assert "loads" in dir(hsdsl)


def test_a_missing_library_is_said_before_the_run(tmp_path, monkeypatch, capsys):
    from hsdsl.interface.cli import main

    (tmp_path / "model.yaml").write_text(TEXT.replace("{file: u.csv, hold: zero}", "1/0"))  # not even read
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr(
        sys, "argv", ["hsdsl", "run", str(tmp_path / "model.yaml"), "--out", str(tmp_path / "r.parquet")]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "pip install 'hsdsl[table]'" in capsys.readouterr().err
