"""What a run tells first: in text, JSON, HTML, files, tables of many runs, and what the verdict says in short."""

from __future__ import annotations

import json
import pickle
import re

import numpy as np
import pytest
from engines import ENGINES
from lint.fragments import blocks

import hsdsl
from hsdsl.analysis.lint.pages import warning_pages
from hsdsl.analysis.report import as_json, dumps
from hsdsl.analysis.report.summary import html, summary
from hsdsl.analysis.report.words import MOST_WORDS, conclusion
from hsdsl.analysis.store import load
from hsdsl.base.errors import WARNINGS
from hsdsl.engine.simulate import stops

# A foot over ground that swings through it while x < 2 a second in: z = 1 - 4 t**2, and at t = 1 it lands where it may.
FOOT = """
hsdsl: 1
parameters: {ready: 2, kick: 0}
modes:
  swing:
    flow: {x: 1, z: v, v: -8}
    transitions: [{name: touchdown, when: z <= 0, if: x >= ready, to: swing, reset: {v: -v}}]
initial: {mode: swing, x: 0, z: 1, v: 0}
experiment: {until: 3, tolerance: 1e-9}
"""
BALL = """
hsdsl: 1
assumptions: [the floor does not move]
modes:
  air: {flow: {h: v, v: -2}, transitions: [{name: hit, when: h <= 0, to: air, reset: {v: -v/2}}]}
initial: {mode: air, h: 1, v: 0}
experiment: {until: 4}
"""
SLIDER = """
hsdsl: 1
modes:
  right: {flow: {x: -1}, transitions: [{when: x <= 0, to: left}]}
  left: {flow: {x: 2}, transitions: [{when: x >= 0, to: right}]}
initial: {mode: right, x: 1}
experiment: {until: 2, completion: auto}
"""
WAVES = """
hsdsl: 1
modes:
  a:
    flow: {s: 1}
    transitions: [{name: level, when: sin(s) >= 1/2, if: s <= 0, to: b}]
  b: {flow: {s: 1}}
initial: {mode: a, s: 0}
experiment: {until: 40, tolerance: 1e-9}
"""


def codes(run):
    return [warning.code for warning in run.warnings]


def test_a_foot_that_swings_through_the_ground_says_so_before_a_verdict_that_holds(tmp_path):
    run = hsdsl.loads(FOOT).simulate()
    (warning,) = run.warnings
    assert (warning.code, warning.edge) == ("HS701", "touchdown")
    assert warning.time == pytest.approx(0.5, abs=1e-9)
    assert run.verdict.theorem == "holds" and run.final.state["z"] == pytest.approx(-35)
    lines = summary(run).splitlines()
    labels = [line[:10].strip() for line in lines]
    assert labels.index("warning") < labels.index("verdict")
    assert as_json(run)["warnings"] == [
        {"code": "HS701", "time": warning.time, "edge": "touchdown", "message": warning.message}
    ]
    assert json.loads(dumps(as_json(run)))["warnings"][0]["edge"] == "touchdown"
    assert "was passed at t = 0.5 while its `if` was false" in html(run)
    run.save(tmp_path / "foot.npz")
    again = load(tmp_path / "foot.npz")
    assert again == run and again.warnings == run.warnings
    assert summary(again) == summary(run)
    assert codes(hsdsl.loads(FOOT).simulate(parameters={"ready": 0})) == []


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("text", [FOOT, BALL, SLIDER], ids=["foot", "ball", "slider"])
def test_the_text_of_a_warning_is_written_when_it_is_read(engine, text, monkeypatch):
    written = []
    message = stops._message
    monkeypatch.setattr(stops, "_message", lambda group: written.append(group) or message(group))
    run = hsdsl.loads(text).simulate(engine=engine)
    assert run.verdict.theorem and run.verdict.reasons and run.warnings
    assert len(run.warnings) == len(codes(run)) and not written
    assert all(warning.code in warning.message for warning in run.warnings)
    assert len(written) == len(run.warnings)
    assert pickle.loads(pickle.dumps(run)).warnings == run.warnings and len(written) == len(run.warnings)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "settings",
    [{}, {"method": "dop853"}, {"method": "rk4", "step": 0.05, "tolerance": None},
     {"precision": 30, "engine": "python"}, {"scheme": "relaxed", "relaxation": 1e-6}],
)  # fmt: skip
def test_several_passes_of_one_transition_are_one_warning(engine, settings):
    run = hsdsl.loads(WAVES).simulate(**{"engine": engine} | settings)
    (warning,) = run.warnings
    assert float(warning.time) == pytest.approx(np.pi / 6, abs=1e-4)
    assert f"passed {sum(np.arange(7) * 2 * np.pi + np.pi / 6 < 40)} times, first at t = 0.52" in warning.message


# A jump enters `air` at the height `start`, below the floor at 1; there h = start + v t - t**2.
JUMPER = """
hsdsl: 1
parameters: {start: 0.75, speed: 0.5, last: 3}
modes:
  ground: {flow: {h: 0, v: 1, n: 0}, transitions: [{name: jump, when: v >= 1, to: air, reset: {h: start, v: speed}}]}
  air:
    flow: {h: v, v: -2, n: 0}
    transitions:
      - {name: touch, when: h <= 1, if: n < last, to: ground, reset: {v: 0, n: n + 1}}
      - {name: again, when: v <= -3, to: ground, reset: {v: 0}}
initial: {mode: ground, h: 1, v: 0, n: 0}
experiment: {until: 7}
"""
MANNERS = [
    {}, {"method": "dop853"}, {"method": "rk4", "step": 0.05, "tolerance": None},
    {"precision": 30, "engine": "python"}, {"scheme": "relaxed", "relaxation": 1e-6},
]  # fmt: skip


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("settings", MANNERS)
def test_a_mode_that_is_entered_beyond_a_surface_with_an_if_says_so(engine, settings):
    model = hsdsl.loads(JUMPER)
    for last in (3, 0):  # whether `if` holds there or not
        run = model.simulate(parameters={"last": last}, **{"engine": engine} | settings)
        assert [made.edge for made in run.transitions] == ["jump", "again"] * 2 + ["jump"]
        (warning,) = run.warnings
        assert (warning.code, warning.edge) == ("HS708", "touch")
        assert float(warning.time) == pytest.approx(1, abs=1e-5)
        assert "mode air was entered beyond the surface of touch 3 times, first at t = 1" in warning.message
        assert len(warning.message.split()) <= MOST_WORDS


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("settings", MANNERS)
def test_a_mode_that_comes_back_inside_or_begins_on_a_surface_says_nothing(engine, settings):
    settings = {"engine": engine} | settings
    run = hsdsl.loads(JUMPER).simulate(parameters={"speed": 1.5}, **settings)  # up to 21/16, and down onto the floor
    assert run.transitions[1].edge == "touch" and run.warnings == ()
    on = hsdsl.loads(JUMPER).simulate(parameters={"start": 1, "speed": 1.5}, **settings)
    assert on.transitions[1].edge == "touch" and on.warnings == ()
    bounces = BALL.replace("h <= 0,", "h <= 0, if: v < 0,").replace("assumptions: [the floor does not move]\n", "")
    ball = hsdsl.loads(bounces).simulate(until=2.9, **settings)
    assert ball.transitions and "HS708" not in codes(ball)


PARTS = """
hsdsl: 1
automata:
  body:
    parameters: {start: 0.75, speed: 0.5, last: 3}
    MODES
system:
  a: {automaton: body, initial: {mode: ground, h: 1, v: 0, n: 0}}
  b: {automaton: body, initial: {mode: ground, h: 1, v: 1/4, n: 0}, parameters: {speed: 1.5}}
experiment: {until: 7}
""".replace("MODES", JUMPER[JUMPER.index("modes:") : JUMPER.index("initial:")].replace("\n", "\n    "))
# An input jumps at 1 and back at 4, or its ramps jump. The surface is that of u >= x + 1, and x moves from 0 at a rate.
DRIVEN = """
hsdsl: 1
parameters: {rate: 0, armed: 1}
inputs: {u: INPUT}
modes:
  a:
    flow: {x: rate, n: 0}
    transitions: [{name: trip, when: u >= x + 1, if: armed > 1/2, to: b}]
  b: {flow: {x: 0, n: 0}}
initial: {mode: a, x: 0, n: 0}
experiment: {until: 5}
"""
INPUTS = {
    "samples": "{times: [0, 1, 4], values: [0, LEVEL, 0], hold: zero}",
    "ramps": "{times: [0, 1, 1, 4, 4, 5], values: [0, 0, LEVEL, LEVEL, 0, 0], hold: linear}",
    "select": '"select((t - 1)*(4 - t), LEVEL, 0)"',
    "floor": '"LEVEL*min(floor(t/1), 1) - LEVEL*floor(t/4)"',
}


def driven(kind, level, **changes):
    return hsdsl.loads(DRIVEN.replace("INPUT", INPUTS[kind].replace("LEVEL", str(level)))).simulate(**changes)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("settings", MANNERS)
@pytest.mark.parametrize("kind", INPUTS)
def test_an_input_that_carries_a_state_beyond_a_surface_with_an_if_says_so(engine, settings, kind):
    settings = {"engine": engine} | settings
    for armed in (0, 1):  # whether `if` holds there or not
        for level, rate, where in ((2, 0, "beyond"), (2, 1 / 8, "beyond"), (1, 0, "onto")):
            run = driven(kind, level, parameters={"rate": rate, "armed": armed}, **settings)
            assert not run.transitions
            (warning,) = (one for one in run.warnings if one.code == "HS708" or where == "beyond")
            assert (warning.code, warning.edge) == ("HS708", "trip")
            assert float(warning.time) == pytest.approx(1, abs=1e-12)
            assert warning.message.startswith(f"an input's jump carried mode a {where} the surface of trip at t = 1")
            assert len(warning.message.split()) <= MOST_WORDS
            assert as_json(run)["warnings"][-1]["code"] == "HS708"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("settings", MANNERS)
def test_an_input_that_jumps_inside_or_comes_back_says_nothing(engine, settings):
    settings = {"engine": engine} | settings
    assert driven("samples", 0.5, **settings).warnings == ()
    back = driven(
        "samples", 2, parameters={"rate": 2 / 3}, **settings
    )  # x + 1 is 2 at t = 1.5, and the flow leads back
    assert not back.transitions and back.warnings == ()
    leaves = driven("samples", 1, parameters={"rate": 1e-3}, initial={"x": -1e-3}, **settings)
    assert not leaves.transitions and leaves.warnings == ()
    fires = driven("samples", 1, parameters={"rate": -1 / 8}, initial={"x": 1 / 8}, **settings)
    assert [made.edge for made in fires.transitions] == ["trip"] and fires.warnings == ()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("settings", [{}, {"method": "dop853"}, {"method": "rk4", "step": 0.05, "tolerance": None},
                                      {"scheme": "relaxed", "relaxation": 1e-6}])  # fmt: skip
@pytest.mark.parametrize("samples", [None, 7])
def test_ensembles_tell_without_a_verdict_what_came_beyond_a_surface_with_an_if(engine, settings, samples):
    settings = {"engine": engine, "samples": samples} | settings
    many = 70 if engine == "c" else 1  # so many follow in lanes, where they can
    jumper = hsdsl.loads(JUMPER).ensemble(parameters={"speed": np.tile([0.5, 1.5], many)}, **settings)
    assert jumper.warnings.tolist() == ["HS708", ""] * many
    for kind in INPUTS:
        for level, expected in ((2, ["HS708", "HS708", ""]), (1, ["HS708", "", ""]), (1 / 2, ["", "", ""])):
            model = hsdsl.loads(DRIVEN.replace("INPUT", INPUTS[kind].replace("LEVEL", str(level))))
            rates = np.tile([0, 1 / 8, 2 / 3], many)  # the last comes back
            ensemble = model.ensemble(parameters={"rate": rates, "armed": 0}, initial={"x": 0 * rates}, **settings)
            assert ensemble.warnings.tolist() == expected * many, (kind, level)
    parts = hsdsl.loads(PARTS).ensemble(parameters={"a.start": np.tile([0.75, 2], many)}, **settings)
    assert parts.warnings.tolist() == ["HS708", ""] * many


def test_an_entry_at_a_jump_of_an_input_does_not_hide_that_another_surface_is_passed_by_it():
    ticks = DRIVEN.replace("transitions: [", "transitions: [{name: tick, when: u - n >= 1, to: a, reset: {n: 3}}, ")
    run = hsdsl.loads(ticks.replace("INPUT", INPUTS["samples"].replace("LEVEL", "2"))).simulate()
    assert [made.edge for made in run.transitions] == ["tick"]
    (warning,) = run.warnings
    assert (warning.code, warning.edge, warning.time) == ("HS708", "trip", 1)


def test_an_event_that_leaves_a_state_beyond_a_surface_does_not_enter_its_mode_anew():
    ticks = JUMPER.replace("    transitions:\n", "    transitions:\n      - {name: tick, event: v <= 0}\n")
    (warning,) = hsdsl.loads(ticks).simulate(until=2).warnings
    assert "touch at t = 1:" in warning.message
    back = ticks.replace("event: v <= 0", "event: v <= 1.4")  # it ticks below the floor, before the way up
    run = hsdsl.loads(back).simulate(parameters={"speed": 1.5}, until=3)
    assert [made.edge for made in run.transitions] == ["jump", "tick", "touch"] and run.warnings == ()


def test_a_part_that_enters_beyond_a_surface_says_so_and_others_do_not():
    run = hsdsl.loads(PARTS).simulate()
    assert {made.edge for made in run.transitions} == {"a.jump", "a.again", "b.jump", "b.touch"}
    (warning,) = run.warnings
    assert (warning.code, warning.edge) == ("HS708", "a.touch") and warning.message.startswith(
        "part a entered beyond the surface of a.touch 3 times, first at t = 1:"
    )


def test_a_run_without_anything_to_tell_has_an_empty_list():
    run = hsdsl.loads(FOOT).simulate(until=0.4)
    assert run.warnings == () and as_json(run)["warnings"] == []
    assert "warning" not in summary(run) and "warning" not in html(run)


def test_an_assumption_of_the_file_is_told_by_every_run():
    model = hsdsl.loads(BALL)
    for until, settings in ((0.5, {}), (0.5, {"method": "euler", "step": 0.01}), (4, {})):
        last = model.simulate(until=until, **settings).warnings[-1]
        assert (last.code, last.time, last.edge) == ("HS707", None, None)
        assert last.message == "the floor does not move (hsdsl explain HS707)"


@pytest.mark.parametrize("engine", ENGINES)
def test_ensembles_have_the_codes_that_single_runs_note_without_a_verdict(engine):
    ball = hsdsl.loads(BALL).ensemble(initial={"h": np.array([[1.0, 4.0], [0.0, 0.25]])}, engine=engine)
    assert ball.warnings.tolist() == [["HS703 HS704", ""], ["HS703", "HS703 HS704"]]
    assert ball.warning_counts == {"HS703": 3, "HS704": 2}
    for place in np.ndindex(ball.shape):
        assert ball.warnings[place].split() == codes(ball.run(*place))[:-1]  # but for the assumption
    assert ball.to_pandas().warnings.tolist() == ["HS703 HS704", "", "HS703", "HS703 HS704"]
    assert "2 HS704: transitions that accumulate" in ball._repr_html_()
    slider = hsdsl.loads(SLIDER).ensemble(initial={"x": np.array([1.0, 3.0])}, engine=engine)
    assert slider.warnings.tolist() == ["HS705", ""]


def test_long_ensembles_keep_what_was_noted_in_full_chunks():
    model = hsdsl.loads(SLIDER)
    ensemble = model.ensemble(initial={"x": np.array([1.0])}, until=400, method="rk4", step=0.01)
    assert ensemble.warnings.tolist() == ["HS705"]


def test_sweeps_have_a_column_of_codes_and_count_them(tmp_path):
    foot = hsdsl.loads(FOOT)
    judged = foot.sweep({"ready": [0, 2]}, tmp_path / "judged", record="final,verdict")
    assert judged["warnings"].tolist() == ["", "HS701"]
    jumper = hsdsl.loads(JUMPER).sweep({"speed": [0.5, 1.5]}, tmp_path / "jumper", record="final,verdict")
    assert jumper["warnings"].tolist() == ["HS708", ""]
    plain = hsdsl.loads(BALL).sweep({"initial.h": [1, 4]}, tmp_path / "plain")
    assert plain["warnings"].tolist() == ["HS703 HS704", ""]
    assert plain.warning_counts == {"HS703": 1, "HS704": 1}
    assert "HS703 in 1 row: motion along a guard" in plain.summary and plain.as_json()["warnings"]["HS704"] == 1


def test_a_dataset_of_an_earlier_version_has_no_such_column(tmp_path):
    hsdsl.loads(BALL).sweep({"initial.h": [1, 4]}, tmp_path / "old")
    manifest = tmp_path / "old" / "_sweep.json"
    content = json.loads(manifest.read_text())
    del content["record"]["warnings"]
    manifest.write_text(json.dumps(content))
    old = hsdsl.sweep.load(tmp_path / "old")
    assert "warnings" not in old.columns and old.warning_counts == {} and "in 1 row" not in old.summary


def test_streamed_runs_tell_what_takes_no_verdict(tmp_path):
    run = hsdsl.loads(BALL).stream(tmp_path / "rows.csv", every=10)
    assert [one.code for one in run.warnings] == ["HS703", "HS704", "HS707"]


@pytest.mark.parametrize("code", WARNINGS)
def test_the_run_of_a_pages_first_example_has_the_warning_and_that_of_the_second_has_not(code):
    page = warning_pages()[code]
    bad, good = (
        [text for language, text in blocks(page, heading) if language == "yaml"]
        for heading in ("Example", "Use instead")
    )
    assert code in codes(hsdsl.loads(bad[0]).simulate())
    assert code not in codes(hsdsl.loads(good[0]).simulate())


@pytest.mark.parametrize("text", [FOOT, BALL, SLIDER, WAVES])
def test_what_is_told_is_short_and_says_where_to_read_more(text):
    run = hsdsl.loads(text).simulate()
    for warning in run.warnings:
        assert len(warning.message.split()) <= MOST_WORDS, warning.message
        assert warning.message.endswith(f"(hsdsl explain {warning.code})")
    assert len(conclusion(run).split()) <= MOST_WORDS


def test_the_summary_concludes_and_gives_all_reasons_on_request():
    run = hsdsl.loads(BALL).simulate()
    short, long = summary(run), summary(run, explain=True)
    assert re.search(r"^verdict   left: Zeno at t = 3", short, re.MULTILINE) and "(--explain)" in short
    assert long.count("\nreason    ") == len(run.verdict.reasons) > 1
    assert "\nreason" not in short and "--explain" not in long
    assert all(reason in html(run) for reason in run.verdict.reasons)
    holds = hsdsl.loads(BALL).simulate(until=0.5)
    assert "verdict   holds: no transition\n" in summary(holds)
