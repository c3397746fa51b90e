"""``hsdsl plot``, and the pictures and films of ``hsdsl run``: what is written, and what is refused before a run."""

from __future__ import annotations

import json
import re

import pytest

import hsdsl

BALL = """
hsdsl: 1
title: Ball
parameters: {g: 9.81, e: 0.8}
modes:
  fall:
    flow: {h: v, v: -g, w: -w}
    transitions: [{name: bounce, when: h <= 0, to: fall, reset: {v: -e*v}}]
units: {h: m}
outputs: {energy: v**2/2 + g*h}
scene: [{point: [0, h]}]
initial: {mode: fall, h: 1, v: 0, w: 1}
experiment: {until: 1}
"""
ENGINE = ("--engine", "python", "--quiet")


def data_of(path):
    found = dict(re.findall(r'<script type="application/json" id="(\w+)">(.*?)</script>', path.read_text("utf-8")))
    return json.loads(found["model"]), json.loads(found["runs"])


def test_outputs_and_phases_choose_what_is_drawn(command, model, tmp_path):
    path = tmp_path / "run.html"
    chosen = ("--outputs", "energy,h", "--phase", "v,h", "--phase", "h,energy")
    answer = command("run", model(BALL), *ENGINE, *chosen, "--plot", path)
    assert answer.code == 0 and answer.err == f"wrote {path}\n"
    shown, (run,) = data_of(path)
    assert shown["shown"] == ["energy", "h"] and shown["phases"] == [["v", "h"], ["h", "energy"]]
    assert shown["columns"] == ["energy", "h", "v"] and len(run["columns"]) == 3  # w is not even integrated
    assert shown["units"]["h"] == "m" and [guard["label"] for guard in shown["guards"]] == ["bounce"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--phase", "h"), "expected two names with a comma between them, got 'h'"),
        (("--phase", "h,v,w"), "expected two names"),
        (("--phase", "h,u"), "no state or output 'u'"),
        (("--outputs", "hh"), "no state or output 'hh'"),
    ],
)
def test_names_are_refused_before_the_run(command, model, tmp_path, words, sentence):
    answer = command("run", model(BALL), *ENGINE, *words, "--plot", tmp_path / "run.png")
    assert answer.code == 2 and sentence in answer.err and not (tmp_path / "run.png").exists()


def test_inputs_are_drawn_as_outputs(command, model):
    text = BALL.replace("parameters:", "inputs: {u: {times: [0, 1], values: [0, 1]}}\nparameters:", 1)
    assert "write outputs: {u: u}" in command("run", model(text), *ENGINE, "--outputs", "h,u").err


def test_options_of_pictures_need_a_picture(command, model, tmp_path):
    assert "give --plot" in command("run", model(BALL), "--phase", "h,v").err
    assert "give --animate" in command("run", model(BALL), "--speed", "2").err
    streamed = command("run", model(BALL), "--every", "2", "--out", tmp_path / "a.csv", "--animate", tmp_path / "a.gif")
    assert streamed.code == 2 and "without --plot, --animate" in streamed.err


def test_saved_runs_and_models_share_a_picture(command, model, tmp_path):
    file, saved, page = model(BALL), tmp_path / "saved.npz", tmp_path / "both.html"
    command("run", file, *ENGINE, "--set", "e=0.5", "--out", saved)
    answer = command("plot", saved, file, "--outputs", "h", "--model", file, "--title", "Both", "--out", page)
    assert answer.code == 0 and answer.err == f"wrote {page}\n"
    shown, runs = data_of(page)
    assert [run["label"] for run in runs] == ["saved", "model"] and shown["shown"] == ["h"]
    assert shown["units"] == {"h": "m"} and shown["guards"] and "<title>Both</title>" in page.read_text("utf-8")
    same = command("plot", saved, saved, "--out", tmp_path / "same.svg", "--json")
    assert same.json == {"files": [str(tmp_path / "same.svg")], "runs": [str(saved)] * 2}


WAVES = """
hsdsl: 1
parameters: {a: 3, late: 0.6}
inputs: {r: {times: [0, late, 2], values: [0, 1, 1], hold: zero}}
modes:
  on:
    flow: {x: y, y: -x}
    transitions: [{name: off, when: x >= 0.9, to: off}]
  off: {flow: {x: -x}, outputs: {u: sin(20*x)}}
outputs: {u: sin(a*20*t)*y + r, z: x**2}
initial: {mode: on, x: 0, y: 1}
experiment: {until: 2}
"""


def test_outputs_of_saved_runs_are_drawn_as_those_of_runs(command, model, tmp_path):
    file, saved = model(WAVES), tmp_path / "saved.npz"
    given = ("--set", "a=2", "--set", "initial.y=1.1", "--set", "experiment.until=1.7", *ENGINE)
    command("run", file, *given, "--out", saved, "--plot", tmp_path / "live.html")
    assert command("plot", saved, "--out", tmp_path / "saved.html", "--label", "model").code == 0
    (_, (live,)), (_, (read,)) = (data_of(tmp_path / f"{name}.html") for name in ("live", "saved"))
    assert read["columns"] == live["columns"] and len(live["columns"][-1]) > 300
    file.write_text(file.read_text() + "# edited", encoding="utf-8")
    straight = command("plot", saved, "--out", tmp_path / "straight.html")
    assert straight.code == 0 and "outputs are straight lines between rows" in straight.err
    assert "straight" not in command("plot", saved, "--outputs", "x", "--out", tmp_path / "x.html").err


@pytest.mark.parametrize("digits", [None, 25])
def test_a_model_gives_a_saved_run_its_outputs_again(model, tmp_path, digits):
    loaded = hsdsl.load(model(WAVES))
    run = loaded.simulate(engine="python", parameters={"a": "7/3"}, until="late + 1", precision=digits)
    run.save(tmp_path / "run.npz")
    read = hsdsl.store.load(tmp_path / "run.npz")
    times = [k / 97 for k in range(155)]
    assert max(abs(read.sample(times)["u"] - run.sample(times)["u"])) > 0.1
    again = loaded.with_outputs(read)
    assert again == run
    assert again.sample(times)["u"].tolist() == run.sample(times)["u"].tolist()


def test_guards_that_differ_are_not_drawn(command, model, tmp_path):
    text = BALL.replace("h <= 0", "h <= 0.1*e")
    file, page = model(text), tmp_path / "both.html"
    for e in ("0.5", "0.6"):
        command("run", file, *ENGINE, "--set", f"e={e}", "--out", tmp_path / f"{e}.npz")
    for runs, guards in ((("0.5", "0.6"), 0), (("0.5", "0.5"), 1)):
        command("plot", *(tmp_path / f"{e}.npz" for e in runs), "--model", file, "--out", page)
        assert len(data_of(page)[0]["guards"]) == guards


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("--label", "one", "--out", "a.png"), "--label: expected 2, one for each run, got 1"),
        (("--out", "a.pdf"), "the name must end in .png, .svg or .html"),
        (("--phase", "h", "--out", "a.png"), "expected two names"),
        (("--outputs", "u", "--out", "a.png"), "no state or output is called u"),
        (("--out", "missing/a.png"), "there is no folder"),
    ],
)
def test_plots_that_cannot_be_are_refused(command, model, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    file = model(BALL)
    answer = command("plot", file, file, *words)
    assert answer.code == 2 and sentence in answer.err
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_a_file_that_is_no_run_is_refused(command, tmp_path):
    (tmp_path / "run.npz").write_bytes(b"no archive")
    answer = command("plot", tmp_path / "run.npz", "--out", tmp_path / "a.png")
    assert answer.code == 2 and str(tmp_path / "run.npz") in answer.err


def test_a_table_is_refused_as_a_run(command, tmp_path):
    (tmp_path / "run.csv").write_text("time,x\n0,1\n")
    answer = command("plot", tmp_path / "run.csv", "--out", tmp_path / "a.png")
    assert answer.code == 2 and "is a table: expected a run" in answer.err and "--out RUN.npz" in answer.err


def test_a_film_is_written(command, model, tmp_path):
    answer = command("run", model(BALL), *ENGINE, "--animate", tmp_path / "ball.gif", "--speed", "10")
    assert answer.code == 0 and (tmp_path / "ball.gif").read_bytes().startswith(b"GIF89a")
    none = command("run", model(BALL.replace("scene:", "# scene:")), *ENGINE, "--animate", tmp_path / "none.gif")
    assert none.code == 2 and "no scene to animate" in none.err and not (tmp_path / "none.gif").exists()


def test_a_suffix_of_another_option_is_named(command, model, tmp_path):
    answer = command("run", model(BALL), "--plot", tmp_path / "ball.gif")
    assert answer.code == 2 and f"--animate {tmp_path / 'ball.gif'} writes that" in answer.err
