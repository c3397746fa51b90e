"""`hsdsl distance` between states."""

from __future__ import annotations

import pytest
from shipped import MODELS

import hsdsl

MODEL = MODELS / "oscillator-with-stop-1.yaml"


def test_json_has_both_ends_and_the_path(command):
    answer = command("distance", MODEL, "--from", "free x=x_max v=10", "--to", "free x=14 v=2*10", "--json")
    assert answer.code == 0
    found = answer.json
    assert found["lower"] <= 9 <= found["upper"]
    assert found["upper"] - found["lower"] < 1e-8
    assert (found["metric"], found["certified"], found["status"]) == ("quotient", "certified", "certified")
    assert [piece["edge"] for piece in found["path"]] == ["impact", "impact", None]
    assert [piece["forward"] for piece in found["path"]] == [True, False, None]


def test_relaxed_metric_and_overridden_parameter(command):
    states = ("--from", "free x=14 v=10", "--to", "free x=14 v=-5")
    answer = command(
        "distance", MODEL, *states, "--metric", "relaxed", "--relaxation", "1/1000", "--set", "c=1/2", "--json"
    )
    assert answer.json["lower"] <= 1e-3 <= answer.json["upper"]
    assert answer.json["upper"] < 1.001e-3


def test_a_cap_on_hops_is_an_option_and_said(command):
    states = ("--from", "free x=14 v=10", "--to", "free x=14 v=20")
    answer = command("distance", MODEL, *states, "--hops", "1", "--json")
    assert answer.json["status"] == "up to 1 hops"
    assert answer.json["lower"] <= 9 <= 10 <= answer.json["upper"]
    assert "(certified up to 1 hops)" in command("distance", MODEL, *states, "--hops", "1").out


def test_sentence(command):
    answer = command("distance", MODEL, "--from", "free x=13 v=5", "--to", "free x=13 v=-4")
    assert answer.code == 0
    assert answer.out.startswith("2.067895205, in [")
    assert "then impact" in answer.out


def test_no_path_is_null_in_json(command, model):
    path = model(
        "hsdsl: 1\nmodes:\n  a: {flow: {x: 1}}\n  b: {flow: {x: 1}}\ninitial: {mode: a, x: 0}\nexperiment: {until: 1}\n"
    )
    answer = command("distance", path, "--from", "a x=0", "--to", "b x=0", "--json")
    assert answer.code == 0
    assert (answer.json["lower"], answer.json["upper"], answer.json["path"]) == (None, None, [])


WRONG = [
    (("--from", "fre x=1 v=2", "--to", "free x=1 v=1"), "did you mean 'free'?"),
    (("--from", "free x=1 y=2", "--to", "free x=1 v=1"), "no state 'y'"),
    (("--from", "free x=1", "--to", "free x=1 v=1"), "no value is given for v"),
    (("--from", "free x=1 x=2 v=0", "--to", "free x=1 v=1"), "given twice"),
    (("--from", "free 1 2", "--to", "free x=1 v=1"), "NAME=VALUE"),
    (("--from", "free x=15 v=0", "--to", "free x=1 v=1"), "not in the domain of mode free"),
    (("--from", "free x=1 v=0 t=1", "--to", "free x=1 v=1"), "leave out t"),
    (("--from", "free x=1 v=0"), "expected two states"),
    ((), '--from "free x=0 v=0" --to "free x=1 v=1"'),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--metric", "relax"), "did you mean 'relaxed'?"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--metric", "quotient", "--relaxation", "1"), "relaxed"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--relaxation", "0"), "must be positive"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--set", "initial.x=2"), "parameters alone"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--set", "cc=2"), "no parameter 'cc'"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--metric", "rho"), "'rho' is a distance between runs"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--metric", "skorokhod"), "is a distance between runs"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--coordinates", "x"), "--coordinates is for two runs"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--plot", "way.pdf"), "must end in .png or .svg"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=0", "--plot", "way.png"), "no path to draw"),
    (("--from", "free x=1 v=0", "--to", "free x=1 v=1", "--seconds", "0"), "positive number of seconds"),
    (("--from", "", "--to", "free x=1 v=1"), "no mode ''"),
    (("--from", "free x=1 v=1/0", "--to", "free x=1 v=1"), "v"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_wrong_use_is_refused_with_a_sentence(command, arguments, message):
    answer = command("distance", MODEL, *arguments)
    assert answer.code == 2
    assert message in answer.err
    assert answer.out == ""


def test_picture_of_the_path(command, tmp_path):
    answer = command(
        "distance", MODEL, "--from", "free x=13 v=5", "--to", "free x=13 v=-4", "--plot", tmp_path / "way.svg"
    )
    assert answer.code == 0
    picture = (tmp_path / "way.svg").read_text()
    assert picture.startswith("<?xml")
    for text in ("guard of impact", "image of impact", "from", "to", "free"):
        assert f"<!-- {text} -->" in picture
    assert picture.count("<!-- 1 -->") == 2  # where the passage begins and where it ends


def test_path_in_more_than_two_coordinates_is_not_drawn(command, tmp_path):
    states = "aerial x=0 z=1 th=0 vx=0 vz=-1 w=0", "aerial x=0 z=1.1 th=0 vx=0 vz=-1 w=0"
    target = tmp_path / "way.png"
    runner = MODELS / "pronking-runner.yaml"
    answer = command("distance", runner, "--from", states[0], "--to", states[1], "--plot", target)
    assert answer.code == 2
    assert "mode aerial has 6: x, z, th, vx, vz, w" in answer.err
    assert not target.exists()


def test_model_with_errors(command, model):
    answer = command("distance", model("hsdsl: 1\nmodes: {}\n"), "--from", "a x=1", "--to", "a x=2", "--json")
    assert answer.code == 1
    assert answer.json["errors"]


def test_python_call_returns_the_interval():
    found = hsdsl.distance(hsdsl.load(MODEL), "free x=14 v=10", "free x=14 v=20")
    assert 9.0 in found and found.width < 1e-8
    assert hsdsl.distance(MODEL, "free x=14 v=10", "free x=14 v=20") == found
    with pytest.raises(hsdsl.UsageError, match="two runs, or a model"):
        hsdsl.distance(MODEL, "free x=14 v=10")
