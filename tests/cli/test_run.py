"""``hsdsl run``: the contract of options, exit codes and the JSON object."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from shipped import MODELS
from signals import interruptible

BALL = """
hsdsl: 1
parameters: {g: 9.81, e: 0.8, twice: 2*e}
modes:
  fall:
    flow: {h: v, v: -g}
    transitions: [{name: bounce, when: h <= 0, to: fall, reset: {v: -e*v}}]
outputs: {energy: v**2/2 + g*h}
initial: {mode: fall, h: 1, v: 0}
experiment: {until: 1.5, tolerance: 1e-9}
"""
KEYS = [
    "model", "engine", "scheme", "method", "settings", "overrides", "stop", "transitions", "final", "warnings",
    "verdict", "seconds",
]  # fmt: skip
TRANSITION = ["index", "time", "resumed", "edge", "from", "to", "before", "after", "alternatives"]


def test_json_is_the_contract(command, model):
    answer = command("run", model(BALL), "--json")
    assert answer.code == 0 and answer.err == ""
    run = answer.json
    assert list(run) == KEYS
    assert [list(t) for t in run["transitions"]] == [TRANSITION] * 2
    assert run["engine"] in ("c", "python") and run["scheme"] == "located" and run["method"] == "taylor"
    assert set(run["stop"]) == {"reason", "time", "message"} and run["stop"]["reason"] == "until"
    assert set(run["final"]) == {"time", "mode", "state", "outputs"}
    assert run["verdict"]["theorem"] == "holds" and run["verdict"]["reasons"]
    assert set(run["seconds"]) == {"load", "compile", "simulate"}
    first = run["transitions"][0]
    assert (first["index"], first["edge"], first["from"], first["to"]) == (0, "bounce", "fall", "fall")
    assert first["time"] == pytest.approx((2 / 9.81) ** 0.5, abs=1e-8)
    assert first["after"]["v"] == pytest.approx(-0.8 * first["before"]["v"])
    assert first["resumed"] == first["time"]
    first = command("run", model(BALL), "--json", "--scheme", "relaxed").json["transitions"][0]
    assert 1e-6 / 4.43 <= first["resumed"] - first["time"] <= 1.001e-6


def test_the_summary_is_for_people(command, model):
    answer = command("run", model(BALL))
    assert answer.code == 0
    for word in ("bounce", "reached t = 1.5", "holds", "energy"):
        assert word in answer.out


def test_quiet_says_nothing(command, model):
    assert command("run", model(BALL), "--quiet").out == ""


SETTINGS: dict[str, tuple[list[str], object]] = {
    "--until": (["--until", "2*e - 1.35"], lambda run: run["stop"]["time"] == pytest.approx(0.25)),
    "--set parameter": (["--set", "e=1/2"], lambda run: abs(run["transitions"][0]["after"]["v"] - 2.2147) < 1e-4),
    "--set derived": (["--set", "twice=e/2", "--set", "e=0.5"], lambda run: True),
    "--set initial": (["--set", "initial.h=e"], lambda run: abs(run["transitions"][0]["time"] - 0.40386) < 1e-5),
    "--set setting": (["--set", "experiment.until=0.25"], lambda run: run["final"]["time"] == 0.25),
    "--set setting, below option": (
        ["--set", "experiment.until=0.25", "--until", "0.5"],
        lambda run: run["final"]["time"] == 0.5,
    ),
    "--step": (
        ["--step", "1e-3", "--method", "rk4"],
        lambda run: run["settings"]["step"] == 1e-3 and run["method"] == "rk4",
    ),
    "--relaxation": (["--relaxation", "1e-3"], lambda run: run["settings"]["relaxation"] == 1e-3),
    "--engine": (["--engine", "python"], lambda run: run["engine"] == "python"),
    "the last counts": (["--until", "0.1", "--until", "0.2"], lambda run: run["final"]["time"] == 0.2),
    "--precision": (["--precision", "40"], lambda run: True),
    "--outputs": (["--outputs", "h"], lambda run: run["final"]["outputs"] == {}),
}


@pytest.mark.parametrize("name", SETTINGS)
def test_settings(command, model, name):
    arguments, check = SETTINGS[name]
    answer = command("run", model(BALL), "--json", *arguments)
    assert answer.code == 0, answer.err
    assert check(answer.json)


USAGE = {
    "unknown parameter": (["--set", "f=1"], "no parameter 'f'"),
    "unknown state": (["--set", "initial.x=1"], "no state 'x'"),
    "unknown mode": (["--set", "initial.mode=fly"], "no mode 'fly'"),
    "unknown setting": (["--set", "experiment.untill=1"], "no setting 'untill'"),
    "unknown group": (["--set", "modes.x=1"], "modes.x"),
    "not a value": (["--set", "e=1 +"], "e"),
    "not finite": (["--until", "1/0"], "until"),
    "a state in a value": (["--set", "e=h"], "h"),
    "negative until": (["--until", "-1"], "until"),
    "step and tolerance": (["--step", "1", "--tolerance", "1"], "exclude"),
    "method": (["--method", "tsit6"], "no method"),
    "fixed method": (["--method", "rk4"], "cannot keep a tolerance"),
    "scheme": (["--scheme", "locate"], "no scheme 'locate'"),
    "no method": (["--scheme", "paoli-schatzman", "--step", "1e-3", "--method", "rk4"], "no method"),
    "engine": (["--engine", "fortran"], "no engine 'fortran'"),
    "engine c with digits": (["--engine", "c", "--precision", "30"], "float64 only"),
    "engine c and a scheme": (["--engine", "c", "--scheme", "paoli-schatzman", "--step", "1e-3"], "no compiled loop"),
    "precision": (["--precision", "3"], "precision"),
    "zero step": (["--step", "0"], "step"),
    "outputs": (["--outputs", "h,q"], "'q'"),
    "out suffix": (["--out", "x.xls"], ".csv"),
    "plot suffix": (["--plot", "x.gif"], ".png"),
    "out folder": (["--out", "no/such/x.csv"], "folder"),
    "option": (["--untill", "1"], "untill"),
}


@pytest.mark.parametrize("name", USAGE)
def test_wrong_usage(command, model, name):
    arguments, words = USAGE[name]
    answer = command("run", model(BALL), *arguments)
    assert answer.code == 2 and words in answer.err and answer.out == ""


HABITS = {
    ("simulate", "m.yaml"): "write run",
    ("run", "m.yaml", "--t_end", "3"): "write --until",
    ("run", "m.yaml", "--param", "c=3"): "write --set",
    ("sweep", "m.yaml", "--vary", "c=[1,2]", "--out", "x"): "--vary c=1,2",
}


@pytest.mark.parametrize("words", HABITS)
def test_habits_of_other_tools_are_answered(command, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.yaml").write_text(BALL)
    answer = command(*words)
    assert answer.code == 2 and f"hint: {HABITS[words]}" in answer.err
    assert "hint" not in command("lint", "m.yaml", "--t_end", "3").err  # it has no end of a run


def test_unreadable_file(command, tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        answer = command("run", path)
        assert answer.code == 2 and str(path) in answer.err


def test_wrong_usage_in_json(command, model):
    answer = command("run", model(BALL), "--json", "--method", "tsit6")
    assert answer.code == 2 and "tsit6" in answer.json["errors"][0]["message"]


def test_errors_of_the_model(command, model):
    path = model(BALL.replace("-g}", "-gg}").replace("to: fall,", "to: fal,"))
    answer = command("run", path)
    assert answer.code == 1 and answer.out == ""
    assert f"{path}:6:" in answer.err and f"{path}:7:" in answer.err and "^" in answer.err
    errors = command("run", path, "--json").json["errors"]
    assert [error["line"] for error in errors] == [6, 7]
    assert set(errors[0]) == {"code", "path", "line", "column", "message", "hint"}


def test_a_file_against_itself_is_wrong_usage(command, model):
    path = model(BALL.replace("tolerance: 1e-9", "tolerance: 1e-9, step: 1e-3"))
    assert command("run", path).code == 2
    assert command("validate", path).code == 1


STOPS = {
    "left_domain": BALL.replace("    transitions", "    domain: [v >= -1]\n    transitions"),
    "not_finite": BALL.replace("v: -g}", "v: -g/sqrt(h - 1/2)}"),
    "transition_limit": BALL.replace("until: 1.5,", "until: 1.5, max_transitions: 1,"),
    "zeno": BALL.replace("reset: {v: -e*v}", "reset: {h: -1}"),
}


@pytest.mark.parametrize("reason", STOPS)
def test_other_stops_are_exit_3_with_data_kept(command, model, tmp_path, reason):
    out = tmp_path / "run.csv"
    answer = command("run", model(STOPS[reason]), "--json", "--out", out)
    assert answer.code == 3
    stop = answer.json["stop"]
    assert stop["reason"] == reason and len(stop["message"]) > 20
    assert out.exists()
    if reason == "not_finite":
        assert "-g/sqrt(h - 1/2)" in stop["message"]


def test_csv(command, model, tmp_path):
    out = tmp_path / "run.csv"
    assert command("run", model(BALL), "--out", out, "--quiet").code == 0
    rows = list(csv.reader(out.open()))
    assert rows[0] == ["time", "mode", "j", "h", "v", "energy"]
    assert [float(r[0]) for r in rows[1:]] == sorted(float(r[0]) for r in rows[1:])
    assert {r[2] for r in rows[1:]} == {"0", "1", "2"}
    sidecar = json.loads((tmp_path / "run.csv.json").read_text())
    assert sidecar


def test_samples_and_columns(command, model, tmp_path):
    out = tmp_path / "run.csv"
    command("run", model(BALL), "--out", out, "--quiet", "--set", "experiment.samples=16", "--outputs", "energy")
    rows = list(csv.reader(out.open()))
    assert rows[0] == ["time", "mode", "j", "energy"]
    assert {f"{k / 10:.1f}" for k in range(16)} <= {f"{float(r[0]):.1f}" for r in rows[1:]}
    assert len(rows) < 30


@pytest.mark.parametrize("suffix", [".png", ".svg", ".html"])
def test_plot(command, model, tmp_path, suffix):
    target = tmp_path / f"run{suffix}"
    assert command("run", model(BALL), "--plot", target, "--quiet").code == 0
    assert target.stat().st_size > 5000


def test_estimate(command, model):
    turns = "hsdsl: 1\nmodes: {m: {flow: {x: y, y: -x}}}\ninitial: {mode: m, x: 0, y: 1}\nexperiment: {until: 2}\n"
    arguments = ("--method", "midpoint", "--step", "1e-2", "--json", "--estimate")
    run = command("run", model(turns), *arguments).json
    estimate = run["estimate"]
    assert estimate["same_transitions"] is True
    error = abs(run["final"]["state"]["x"] - math.sin(2))
    assert 0.2 * error < estimate["final"]["x"] <= 2 * error


def wait_until_it_computes(pid, seconds=2.0):
    """Wait until a process has had so much of the processor that it is past its imports."""
    file, deadline = Path(f"/proc/{pid}/stat"), time.monotonic() + 60
    while file.exists() and time.monotonic() < deadline:
        ticks = int(file.read_text().rpartition(")")[2].split()[11])
        if ticks / os.sysconf("SC_CLK_TCK") >= seconds:
            return
        time.sleep(0.05)
    if not file.exists():  # a system that does not say
        time.sleep(8)


def test_interrupt_keeps_what_was_computed(tmp_path):
    out = tmp_path / "run.csv"
    arguments = [MODELS / "oscillator-with-stop-1.yaml", "--step", "1e-6", "--engine", "python", "--out", out, "--json"]
    command = [sys.executable, "-m", "hsdsl", "run", *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **interruptible())
    try:
        wait_until_it_computes(process.pid)
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=60)
    finally:
        process.kill()  # else it would run for hours, and fill the memory
    assert process.returncode == 130, stderr.decode()
    assert json.loads(stdout)["stop"]["reason"] == "interrupted"
    assert out.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "times"),
    [
        (("--samples", "every=gap/2"), [0, 0.15, 0.3, 0.45, 0.6, 0.75]),
        (("--set", "experiment.samples=every=0.2"), [0, 0.2, 0.4, 0.6]),
        (("--samples", "count=3"), [0, 0.375, 0.75]),
        (("--samples", "2"), [0, 0.75]),
    ],
)
def test_tables_have_rows_at_samples(command, model, tmp_path, words, times):
    text = "hsdsl: 1\nparameters: {gap: 0.3}\nmodes: {m: {flow: {x: x}}}\ninitial: {mode: m, x: 1}\n"
    table = tmp_path / "run.csv"
    answer = command("run", model(text + "experiment: {until: 0.75}\n"), *words, "--engine", "python", "--out", table)
    assert answer.code == 0
    rows = [line.split(",") for line in table.read_text().splitlines()[1:]]
    assert [float(row[0]) for row in rows] == pytest.approx(times, rel=1e-15)
    assert [float(row[3]) for row in rows] == pytest.approx([math.exp(t) for t in times], rel=1e-8)


@pytest.mark.parametrize("text", ["every=0", "every=-gap", "every=", "every=x", "count=1", "often"])
def test_samples_that_are_none_are_refused(command, model, tmp_path, text):
    model_text = "hsdsl: 1\nparameters: {gap: 0.3}\nmodes: {m: {flow: {x: x}}}\ninitial: {mode: m, x: 1}\n"
    answer = command("run", model(model_text + "experiment: {until: 1}\n"), "--samples", text, "--engine", "python")
    assert (answer.code, answer.out) == (2, "") and "samples" in answer.err
