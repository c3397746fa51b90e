"""The gallery: its exact executions, and no run of ours that is wrong without a word."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from exact.arithmetic import evaluate
from gallery.scenes import GALLERY, OLDER, Entry, entries
from gallery.settings import Setting, own_settings, run
from references.gallery import GALLERY as SOLVED
from references.gallery import two_ways

import hsdsl
from hsdsl.engine.execution import Verdict
from hsdsl.interface.chart.outcome import WITHIN, Tolerance, outcome
from hsdsl.interface.chart.scene import Result

SCENES = entries()
BY_SERIES = {"lorenz-section", "stick-slip"}
NOT_AS_WRITTEN = {
    "dry-friction": "sliding",
    "relay": "sliding",
    "stick-slip": "sliding",
    "rolling-ball": "motion along the floor",
    "draining-tank": "a tangency",
    "kinked-input": "an input with kinks",
}
"""Scenes whose exact execution is beyond what `hsdsl.exact.reference` can check against the model."""
FAST = [
    Setting("hsdsl c", "located", "taylor", tolerance=1e-9),
    Setting("hsdsl c", "located", "dopri5", tolerance=1e-9),
    Setting("hsdsl c", "located", "radau", tolerance=1e-6),
    Setting("hsdsl c", "located", "rk4", step=1e-3),
    Setting("hsdsl c", "relaxed", "dopri5", tolerance=1e-6),
]
STIFF = "stiff-switch"  # explicit methods take half a minute


@pytest.fixture(scope="module", params=sorted(SCENES))
def entry(request: Any) -> Entry:
    return SCENES[request.param]


def test_every_scene_has_a_solution_and_words(entry: Entry) -> None:
    assert set(SOLVED) | set(OLDER) == set(SCENES)
    assert all(words.endswith(".") and "#" not in words for words in entry.words)
    if entry.name in SOLVED:
        assert (GALLERY / "references" / f"{entry.name}.npz").is_file()


@pytest.mark.parametrize("name", sorted(set(SOLVED) - BY_SERIES))
def test_stored_executions_are_the_solutions(name: str) -> None:
    stored, solved = SCENES[name].exact, SOLVED[name]()
    assert np.array_equal(stored.times, solved.times)
    assert np.array_equal(stored.values, solved.values, equal_nan=True)
    assert float(stored.settings["error"]) <= 2e-12 * max(1.0, float(np.nanmax(np.abs(stored.values))))


@pytest.mark.parametrize("name", sorted(set(SOLVED) - set(NOT_AS_WRITTEN)))
def test_exact_executions_solve_the_models(name: str) -> None:
    assert np.array_equal(hsdsl.exact.reference(SCENES[name].model).times, SCENES[name].exact.times)


@pytest.mark.parametrize("name", sorted(SOLVED))
def test_references_of_the_files_are_the_solutions(name: str) -> None:
    """The formulas in the file, evaluated to forty digits, against the stored execution."""
    entry = SCENES[name]
    system = entry.model.system
    names: dict[str, Any] = {}
    for parameter, text in yaml.load(entry.path.read_text(), Loader=yaml.BaseLoader).get("parameters", {}).items():
        names[parameter] = evaluate(text, names)
    error = float(entry.exact.settings["error"]) + 1e-12
    for block in system.reference:
        for known, made in zip(block.transitions, entry.exact.transitions, strict=False):
            assert float(evaluate(known.time, names)) == pytest.approx(float(made.time), rel=1e-15, abs=1e-25)
            assert known.edge in (None, made.edge)
            for side in ("before", "after"):
                for state, text in getattr(known, side).items():
                    assert abs(float(evaluate(text, names)) - getattr(made, side)[state]) <= error
        for point in block.states:
            t = min(float(evaluate(point.time, names)), float(entry.exact.final.time))
            found = entry.exact(t)
            assert point.mode in (None, found.mode)
            for state, text in point.values.items():
                assert abs(float(evaluate(text, names)) - found.state[state]) <= 3 * error


@pytest.mark.parametrize("setting", FAST, ids=lambda setting: setting.label)
def test_no_run_is_silently_wrong(entry: Entry, setting: Setting) -> None:
    if entry.name == STIFF and setting.method in ("taylor", "dopri5"):
        pytest.skip("explicit methods take half a minute")
    found = run(entry, setting)
    assert found.word in ("right", "warns", "stops", "refuses"), found
    if found.word == "stops":
        assert found.verdict in ("left", "unknown"), found


@pytest.mark.campaign
@pytest.mark.parametrize("setting", [*own_settings(("c",))], ids=lambda setting: f"{setting.label} {setting.size}")
def test_no_method_is_silently_wrong(entry: Entry, setting: Setting) -> None:
    found = run(entry, setting)
    assert found.word != "wrong", found


SURE = {
    "zeno-ball", "grazing-hit", "two-crossings", "narrow-hole", "equal-balls", "three-spheres", "event-at-start",
    "event-before-end", "restart-on-guard", "moving-guard", "fast-clock", "kinked-input", "lorenz-section",
    "nanoseconds", "stiff-contact", "grazing-miss", "oscillator-with-stop-1", "stiff-switch",
}  # fmt: skip
"""Scenes with one answer that a careful run gets right and knows to be right."""


@pytest.mark.parametrize("name", sorted(SURE))
def test_located_runs_are_right_and_hold(name: str) -> None:
    method = "radau" if name == STIFF else "taylor"
    found = run(SCENES[name], Setting("hsdsl c", "located", method, tolerance=1e-9))
    assert (found.word, found.verdict) == ("right", "holds"), found
    assert found.error <= 1e-4


def test_impacts_at_one_instant_hold_behind_strips() -> None:
    """The third lands on the surface of another one, which the order of the first two decides as well."""
    found = run(SCENES["three-spheres"], Setting("hsdsl c", "relaxed", "taylor", tolerance=1e-9))
    assert (found.word, found.verdict) == ("right", "holds"), found


def as_result(entry: Entry, **changed: Any) -> Result:
    scene = entry.scene
    values, modes = changed.get("values", scene.exact_values), changed.get("modes", scene.exact_modes)
    count = changed.get("count", len(scene.exact.transitions))
    return Result(values.copy(), lambda: modes, lambda: count, changed.get("problem"))


def test_the_exact_execution_is_right(entry: Entry) -> None:
    ends = entry.scene.exact.final.time < entry.until * (1 - 1e-9)
    found = outcome(entry.scene, as_result(entry), WITHIN)
    assert found.word == ("wrong" if ends else "right"), found
    assert found.error <= 1e-12


def test_outcomes_of_results_that_differ() -> None:
    entry = SCENES["two-crossings"]
    holds, left = Verdict("holds", ()), Verdict("left", ())
    off = entry.scene.exact_values.copy()
    off[1000:, 0] += 0.3
    fewer = as_result(entry, count=18)
    other = as_result(entry, modes=np.full(len(off), "above", dtype=object))
    for result in (as_result(entry, values=off), fewer, other):
        assert outcome(entry.scene, result, WITHIN).word == "wrong"
        assert outcome(entry.scene, result, WITHIN, holds).word == "wrong"
        assert outcome(entry.scene, result, WITHIN, left).word == "warns"
    assert outcome(entry.scene, replace(fewer, problem="no more"), WITHIN).word == "stops"
    assert "18 transitions instead of 20" in outcome(entry.scene, fewer, WITHIN).why


def test_a_result_that_is_late_by_the_slack_is_right() -> None:
    entry = SCENES["oscillator-with-stop-1"]
    scene = entry.scene
    late = scene.exact.sample(np.maximum(scene.grid - 0.002 * entry.until, 0))
    result = as_result(entry, values=late.state_columns, modes=late.mode)
    assert outcome(scene, result, Tolerance(1e-3, 0.003)).word == "right"
    assert outcome(scene, result, Tolerance(1e-3, 0.001)).word == "wrong"


def test_a_miss_just_before_the_end_shows_without_a_count() -> None:
    entry = SCENES["event-before-end"]
    missed = entry.scene.exact_values.copy()
    missed[-1] = missed[-2]
    result = as_result(entry, values=missed, count=None)
    assert outcome(entry.scene, result, WITHIN).word == "wrong"


def test_a_run_past_the_end_of_the_exact_execution_is_wrong() -> None:
    entry = SCENES["blow-up"]
    assert outcome(entry.scene, as_result(entry), WITHIN).word == "wrong"
    assert outcome(entry.scene, as_result(entry, problem="no number"), WITHIN).word == "right"


def test_either_of_two_executions_needs_a_word() -> None:
    entry = SCENES["two-ways"]
    assert run(entry, FAST[0]).verdict == "left"
    other = two_ways("top")
    assert other.final.mode == "b" and entry.exact.final.mode == "a"
