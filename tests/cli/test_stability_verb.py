"""``hsdsl stability``: files, JSON, and one clear message for what cannot be."""

from __future__ import annotations

import csv

import pytest

import hsdsl
from hsdsl.interface.chart.stability import read_axes

DECAY = """hsdsl: 1
parameters: {rate: 100}
modes:
  fast:
    flow: {x: -rate*x, y: 1}
    transitions: [{name: late, when: y >= 1, to: slow}]
  slow:
    flow: {x: -x, y: 0}
initial: {mode: fast, x: 1, y: 0}
experiment: {until: 2}
"""


def test_table_picture_and_json_agree(command, model, tmp_path):
    table, png, svg = (tmp_path / name for name in ("map.csv", "map.png", "map.svg"))
    given = [model(DECAY), "--map", "h=1e-3:0.1:3,rate=10:100:2", "--method", "euler,rk4", "--scheme", "located"]
    first = command("stability", *given, "--out", table, "--plot", png)
    assert first.code == 0
    assert first.out.splitlines()[0].startswith("located euler")
    answer = command("stability", *given, "--plot", svg, "--json").json
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(answer["runs"]) == 12
    assert {row["outcome"] for row in rows} == {run["outcome"] for run in answer["runs"]} >= {"converged", "blown up"}
    assert answer["limits"]["located euler"] == pytest.approx([0.2, 0.02])
    assert png.read_bytes().startswith(b"\x89PNG")
    assert "<svg" in svg.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--map", "h,nothing"), "there is no setting, parameter or initial value 'nothing'"),
        (("--map", "h,x"), "it is a state"),
        (("--map", "h=1:2,h"), "expected two names, got h twice"),
        (("--map", "h=2:1,rate"), "expected FROM below TO"),
        (("--map", "h,rate", "--set", "rate=3"), "it is fixed by --set"),
        (("--map", "h,rate", "--set", "experiment.step=3"), "it is fixed by --set"),
        (("--map", "h,rate", "--against", "scipy"), "peers choose their own steps"),
        (("--map", "h,rate", "--against", "nobody"), "there is no 'nobody'"),
        (("--map", "tolerance,rate", "--method", "rk4"), "keeps no tolerance"),
        (("--map", "h,rate", "--scheme", "other"), "there is no 'other'"),
        (("--map", "h,rate", "--plot", "map.pdf"), "must end in .png or .svg"),
        (("--map", "h,rate", "--out", "map.txt"), "must end in .csv"),
        (("--map", "h,rate", "--patience", "0"), "expected positive numbers"),
        (("--map", "h,rate", "--set", "nothing=1"), "nothing"),
    ],
)
def test_bad_words_get_one_message(command, model, words, message):
    answer = command("stability", model(DECAY), *words)
    assert (answer.code, answer.out) == (2, "")
    assert answer.err.startswith("hsdsl: ")
    assert message in answer.err


SLIDING = """hsdsl: 1
parameters: {push: 2}
modes:
  right: {flow: {x: 0.3 - push, y: 1}, transitions: [{when: x <= 0, to: left}]}
  left: {flow: {x: 0.3 + push, y: 1}, transitions: [{when: x >= 0, to: right}]}
initial: {mode: right, x: 1.1, y: 0}
experiment: {until: 3}
"""


def test_references_have_the_settings_of_their_runs(command, model):
    given = [model(SLIDING), "--map", "h=1e-2:1e-1:2,push=0.7:3:3", "--no-rho"]
    without = command("stability", *given)
    assert without.out.splitlines()[0].split("  ")[1] == "6 no reference"
    assert without.out.splitlines()[1].startswith("no reference, first at h = 0.01, push = 0.7: 6 times between t = ")
    assert "completion: auto" in without.out
    answer = command("stability", *given, "--set", "experiment.completion=auto", "--json").json
    assert {run["outcome"] for run in answer["runs"]} == {"converged"}


def test_scheme_and_method_of_a_map_may_come_by_set(command, model):
    given = ["--set", "experiment.scheme=relaxed", "--set", "experiment.method=heun"]
    answer = command("stability", model(DECAY), "--map", "h=1e-3:1e-2:2,rate=10:20:2", *given, "--no-rho")
    assert answer.out.startswith("relaxed heun")


def test_without_a_map_it_is_the_plane_of_step_and_relaxation(command, model):
    answer = command("stability", model(DECAY.replace("rate: 100", "rate: 1")), "--no-rho", "--json").json
    assert len(answer["runs"]) == 144
    assert {(run["scheme"], run["method"]) for run in answer["runs"]} == {("relaxed", "rk4")}
    assert (answer["x"], answer["y"]) == ("h", "relaxation")


APPEARS = """hsdsl: 1
parameters: {k: {value: 1, unit: m}}
units: {t: s}
modes:
  A: {flow: {x: k}, transitions: [{when: x >= k, to: B, reset: {q: 2}}]}
  B: {flow: {x: k, q: 1}}
initial: {mode: A, x: 0}
experiment: {until: 1.9}
"""


def test_a_state_may_appear_as_late_as_others_may_change(command, model):
    """The relaxed scheme makes the transition later by the relaxation; 0.5 % of the run are 0.0095."""
    answer = command("stability", model(APPEARS), "--map", "relaxation=6e-3:4e-2:2,k=1:2:2", "--json")
    assert [run["outcome"] for run in answer.json["runs"]] == ["converged", "inaccurate"] * 2


def test_the_axes_of_a_map_have_units():
    axes = read_axes(hsdsl.loads(APPEARS), "h,k", 1.9, {})
    assert [axis.label for axis in axes] == ["h [s]", "k [m]"]
