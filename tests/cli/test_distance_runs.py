"""``hsdsl distance`` of runs: saved ones, and models standing for their own."""

from __future__ import annotations

import math

import pytest
from shipped import MODELS

import hsdsl
from hsdsl.analysis.store import load

THERMOSTAT, QUADRANTS = MODELS / "thermostat.yaml", MODELS / "digital-control.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two saved runs of the thermostat, a coarse and a fine one, and one of another model."""
    place = tmp_path_factory.mktemp("runs")
    model = hsdsl.load(THERMOSTAT)
    model.simulate(method="euler", step=0.1, relaxation=1e-6).save(place / "coarse.npz")
    model.simulate(relaxation=1e-6).save(place / "fine.npz")
    hsdsl.load(QUADRANTS).simulate().save(place / "other.npz")
    return place


@pytest.fixture
def ask(command, folder, monkeypatch):
    monkeypatch.chdir(folder)
    return lambda *words: command("distance", *words)


def test_one_object_on_standard_output(ask, folder):
    arguments = ask("coarse.npz", "fine.npz", "--json")
    found = arguments.json
    assert arguments.code == 0
    assert list(found) == ["metric", "lower", "upper", "status", "time", "span", "note"]
    assert found["metric"] == "rho"
    assert 0 < found["lower"] <= found["upper"] <= 1.05 * found["lower"]
    assert found["span"] == [0.0, 24.0]
    in_python = hsdsl.distance(load(folder / "coarse.npz"), load(folder / "fine.npz"))
    assert (in_python.lower, in_python.upper) == (found["lower"], found["upper"])


def test_a_sentence_for_people(ask):
    arguments = ask("coarse.npz", "fine.npz", "--metric", "rho-hat", "--coordinates", "T")
    assert arguments.code == 0
    assert arguments.out.startswith("rho-hat: 0.")
    assert "attained at t = " in arguments.out


def test_a_model_stands_for_its_own_run(ask):
    arguments = ask(THERMOSTAT, "fine.npz", "--json")
    assert arguments.json["upper"] <= 1e-6


def test_a_picture(ask, folder):
    arguments = ask("coarse.npz", "fine.npz", "--plot", "apart.svg")
    assert arguments.code == 0
    assert (folder / "apart.svg").read_text().startswith("<?xml")


WRONG = {
    "the distance 'sup' has no relaxation": ("coarse.npz", "fine.npz", "--metric", "sup", "--relaxation", "1"),
    "coordinates are for rho-hat": ("coarse.npz", "fine.npz", "--metric", "sup", "--coordinates", "T"),
    "fine.npz is a run: expected two runs": ("fine.npz", "--from", "on T=19", "--to", "on T=20"),
    "give two runs, or one model": ("coarse.npz", "fine.npz", "--from", "on T=19"),
    "positive number of seconds": ("coarse.npz", "fine.npz", "--seconds", "-1"),
    "runs are of different models": ("fine.npz", "other.npz"),
    "no distance 'skorohod' between runs": ("coarse.npz", "fine.npz", "--metric", "skorohod"),
    "no state 'S'": ("coarse.npz", "fine.npz", "--metric", "rho-hat", "--coordinates", "S"),
    "relaxation must be positive": ("coarse.npz", "fine.npz", "--relaxation", "0"),
    "cannot read gone.npz": ("gone.npz", "fine.npz"),
    "must end in .png or .svg": ("coarse.npz", "fine.npz", "--plot", "apart.pdf"),
}


@pytest.mark.parametrize("sentence", WRONG)
def test_wrong_use_is_refused_with_a_sentence(sentence, ask):
    arguments = ask(*WRONG[sentence])
    assert arguments.code == 2
    assert sentence in arguments.err


def test_variants_of_a_model_are_compared_as_runs_of_one_file(command, model, tmp_path):
    text = "hsdsl: 1\nparameters: {drag: 0}\nmodes: {m: {flow: {v: 'select(drag, -v/4, -2)'}}}\n"
    file, runs = (
        model(text + "initial: {mode: m, v: 3}\nexperiment: {until: 1}\n"),
        [tmp_path / "a.npz", tmp_path / "b.npz"],
    )
    for run, given in zip(runs, ((), ("--set", "drag=1")), strict=True):
        command("run", file, "--engine", "python", *given, "--out", run)
    found = command("distance", *runs, "--json").json
    assert found["lower"] <= 3 * math.exp(-1 / 4) - 1 <= found["upper"]
    file.write_text(file.read_text() + "# other", encoding="utf-8")
    command("run", file, "--engine", "python", "--out", runs[1])
    refused = command("distance", *runs)
    assert refused.code == 2 and "select(variant, a, b), given by --set variant=1" in refused.err
