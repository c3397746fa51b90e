"""``hsdsl sweep``: datasets, pictures, JSON, and one clear message for what cannot be."""

from __future__ import annotations

import pytest

from hsdsl.interface.cli.sweep import Pace, duration

DECAY = """hsdsl: 1
title: Decay
parameters: {rate: 1, low: 0.5}
modes:
  high:
    flow: {x: -rate*x}
    transitions: [{when: x <= low, to: low_mode}]
  low_mode:
    flow: {x: -rate*x}
initial: {mode: high, x: 1}
experiment: {until: 2}
"""


def test_a_dataset_is_made_continued_and_shown(command, model, tmp_path):
    pytest.importorskip("pyarrow")
    out, words = tmp_path / "s", ["--vary", "rate=0.1:1:4", "--vary", "low=0.4,0.8", "--processes", 1]
    first = command("sweep", model(DECAY), *words, "--out", out, "--chunk", 3)
    assert first.code == 0 and "8 of 8 rows in 3 of 3 files" in first.out and "8 until" in first.out
    (out / "chunk-000001.parquet").unlink()
    shown = command("sweep", "--show", out, "--json", "--of", "mode")
    assert (shown.json["done"], shown.json["complete"], shown.json["stops"]) == (5, False, {"until": 5})
    assert (out / "_picture.png").read_bytes().startswith(b"\x89PNG") and f"wrote {out}" in shown.err
    again = command("sweep", model(DECAY), *words, "--out", out, "--json", "--plot", tmp_path / "p.svg")
    assert again.json["complete"] and [item["name"] for item in again.json["vary"]] == ["rate", "low"]
    assert "final.x" not in (tmp_path / "p.svg").read_text()
    assert command("sweep", model(DECAY), *words, "--out", out, "--until", 3).code == 2


def test_a_sweep_that_has_no_picture_is_summarised(command, model, tmp_path):
    pytest.importorskip("pyarrow")
    words = ["--vary", "rate=1,2", "--vary", "low=0.4,0.8", "--vary", "initial.x=1,2", "--processes", 1]
    assert command("sweep", model(DECAY), *words, "--out", tmp_path / "s", "-q").code == 0
    shown = command("sweep", "--show", tmp_path / "s")
    assert shown.code == 0 and "8 of 8 rows" in shown.out and "no picture: a map shows two" in shown.err
    assert command("sweep", "--show", tmp_path / "s", "--of", "final.x").code == 2


PLOTTED = ["MODEL", "--vary", "rate=1,2", "--out", "OUT", "--plot", "p.svg"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "expected a model, or --show DIR"),
        (["MODEL"], "expected --out DIR"),
        (["MODEL", "--out", "OUT"], "a sweep needs something that varies"),
        (["MODEL", "--vary", "rate=1"], "expected --out DIR"),
        (["MODEL", "--vary", "rat=1", "--out", "OUT"], "initial value 'rat'\n  hint: did you mean 'rate'"),
        (["MODEL", "--vary", "rate=1:x:3", "--out", "OUT"], "--vary rate"),
        (["MODEL", "--vary", "rate=1", "--out", "OUT", "--record", "all"], "--record"),
        (["MODEL", "--vary", "rate=1", "--out", "OUT", "--plot", "p.pdf"], "the name must end in .png or .svg"),
        (["MODEL", "--show", "OUT"], "does not take MODEL"),
        (["--show", "OUT", "--until", "3", "--set", "rate=2"], "does not take --set, --until"),
        (["MODEL", "--vary", "rate=1,2", "--out", "OUT", "--of", "final.x"], "--of applies to a picture"),
        (["MODEL", "--vary", "rate=1,2", "--out", "OUT", "--cluster", "a", "--processes", "2"], "leave one out"),
        (["MODEL", "--vary", "rate=1,2", "--out", "OUT", "--seed", "2"], "--seed: nothing is drawn"),
        ([*PLOTTED, "--of", "final.y"], "no column 'final.y' to draw"),
        ([*PLOTTED, "--of", "sample.x"], "record it: --record outputs"),
        ([*PLOTTED, "--vary", "low=1,2", "--vary", "initial.x=1,2"], "hint: draw a slice: --slice initial.x=1"),
        ([*PLOTTED, "--slice", "rate"], "--slice: expected NAME=NUMBER, got 'rate'"),
        ([*PLOTTED, "--slice", "rate=1"], "nothing varies in this slice"),
        ([*PLOTTED, "--worst", "mode"], "'mode' has no numbers"),
        ([*PLOTTED, "--best", "final.z"], "'final.z' is no column of the sweep"),
        (["--show", "OUT"], "is not a sweep"),
    ],
)
def test_what_cannot_be_served_is_refused(command, model, tmp_path, words, message):
    pytest.importorskip("pyarrow")
    names = {"MODEL": model(DECAY), "OUT": tmp_path / "out"}
    answer = command("sweep", *(names.get(word, word) for word in words))
    assert answer.code == 2 and message in answer.err
    assert not (tmp_path / "out").exists()


def test_the_worst_rows_are_listed_with_the_command_of_the_first(command, model, tmp_path):
    pytest.importorskip("pyarrow")
    words = ["--vary", "rate=0.1,3,0.5", "--processes", 1, "--out", tmp_path / "s"]
    answer = command("sweep", model(DECAY), *words, "--worst", "final.x", "--best", "time")
    table = answer.out.partition("rows with the largest final.x\n")[2].splitlines()
    assert [line.split()[:2] for line in table[:4]] == [["row", "rate"], ["0", "0.1"], ["2", "0.5"], ["1", "3"]]
    again = table[4].partition("again: hsdsl ")[2].split()
    assert "0.818730753" in table[1] and "x = 0.8187307531" in command(*again).out
    shown = command("sweep", "--show", tmp_path / "s", "--best", "final.x", "--json")
    assert [row["rate"] for row in shown.json["best"]] == [3, 0.5, 0.1]
    listed = command("sweep", "--show", tmp_path / "s", "--worst", "final.x", "--quiet").out
    assert listed.startswith("rows with the largest final.x\n") and len(listed.splitlines()) == 6


def test_without_pyarrow_there_is_a_hint(command, model, tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    answer = command("sweep", model(DECAY), "--vary", "rate=1", "--out", tmp_path / "s")
    assert answer.code == 2 and "pip install 'hsdsl[sweep]'" in answer.err


def test_ctrl_c_says_how_far_it_is_and_how_to_go_on(command, model, tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    note = Pace.note

    def interrupted(self, done, rows):
        note(self, done, rows)
        if done == 4:
            raise KeyboardInterrupt

    monkeypatch.setattr(Pace, "note", interrupted)
    words = ["--vary", "rate=0.1:1:8", "--out", tmp_path / "s", "--processes", 1, "--chunk", 2]
    answer = command("sweep", model(DECAY), *words)
    assert answer.code == 130 and "4 of 8 rows are in" in answer.err and "the same command continues" in answer.err
    monkeypatch.setattr(Pace, "note", note)
    assert command("sweep", model(DECAY), *words).code == 0


def test_progress_shows_rate_and_time_left(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("hsdsl.interface.cli.sweep.time.monotonic", lambda: clock[0])
    pace = Pace()
    pace.note(100, 1100)  # a sweep that goes on
    assert pace.text(10) == "[=         ] 100 of 1,100 rows"
    clock[0] = 110.0
    pace.note(600, 1100)
    assert pace.text(10) == "[=====     ] 600 of 1,100 rows, 50 rows/s, 10 s left"
    assert [duration(s) for s in (59.4, 61, 7260)] == ["59 s", "1 min 01 s", "2 h 01 min"]
