"""Reports of a run, in text and in JSON."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import hand_made
import numpy as np
import pytest

import hsdsl
from hsdsl.analysis import report
from hsdsl.analysis.report.summary import html, summary
from hsdsl.analysis.report.words import condensed, times
from hsdsl.base import parts
from hsdsl.base.numbers import decimals
from hsdsl.engine.execution import Verdict

FIFTY = decimals.context_of(50)


def test_json_has_the_keys_of_the_contract_in_order():
    run = report.as_json(hand_made.bouncing_ball(wait=0.125, bounces=1))
    assert json.loads(report.dumps(run)) == {
        "model": "models/hand-made.yaml",
        "engine": "python",
        "scheme": "relaxed",
        "method": "midpoint",
        "settings": {"until": 4.125, "step": 1e-3, "relaxation": 1e-6, "tolerance": None},
        "overrides": {},
        "stop": {"reason": "until", "time": 4.125, "message": "The run reached its end."},
        "transitions": [
            {
                "index": 0,
                "time": 2.0,
                "resumed": 2.125,
                "edge": "bounce",
                "from": "fly",
                "to": "fly",
                "before": {"h": 0.0, "v": -2.0},
                "after": {"h": 0.0, "v": 1.0},
                "alternatives": [],
            }
        ],
        "final": {"time": 4.125, "mode": "fly", "state": {"h": 0.0, "v": -1.0}, "outputs": {"energy": 0.5}},
        "warnings": [],
        "verdict": {"theorem": "unknown", "reasons": ["nothing checks the hypotheses yet"]},
        "seconds": {"load": 0.25, "compile": 0.01, "simulate": 0.5},
    }
    assert list(run) == [
        "model", "engine", "scheme", "method", "settings", "overrides", "stop", "transitions", "final", "warnings",
        "verdict", "seconds",
    ]  # fmt: skip
    assert list(run["transitions"][0]) == [
        "index", "time", "resumed", "edge", "from", "to", "before", "after", "alternatives",
    ]  # fmt: skip


def test_a_run_that_ends_in_a_strip_has_null_where_nothing_followed():
    (transition,) = report.as_json(hand_made.ends_in_strip())["transitions"]
    assert transition["resumed"] is None
    assert transition["after"] is None


def test_numbers_that_are_not_finite_are_null():
    run = report.as_json(hand_made.blow_up())
    assert run["final"]["state"] == {"x": None, "y": None}
    assert report.as_json(hand_made.modes_of_different_size())["final"]["outputs"] == {"double": None}


def test_json_always_names_the_three_stages():
    run = report.as_json(replace(hand_made.jumping_input(), seconds={"simulate": 1.0}))
    assert run["seconds"] == {"load": None, "compile": None, "simulate": 1.0}


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1, "0.1"),
        (1e-300, "1e-300"),
        (-0.0, "-0.0"),
        (float("nan"), "null"),
        (-math.inf, "null"),
        (FIFTY.inf, "null"),
        (FIFTY.mpf("0.1"), "0.1"),
        (FIFTY.mpf(1) / 3, "0." + "3" * 51),
        (FIFTY.mpf(10) ** 60, "1.0e+60"),
        (np.float64(0.5), "0.5"),
        (np.int64(7), "7"),
        (np.bool_(True), "true"),
        (np.array([1.0, np.nan]), "[1.0, null]"),
        (Fraction(1, 4), "0.25"),
        (Path("a/b"), '"a/b"'),
        ((1, "ü\n"), '[1, "\\u00fc\\n"]'),
        ({}, "{}"),
        ([], "[]"),
        (None, "null"),
        (True, "true"),
        (10**30, "1" + "0" * 30),
    ],
)
def test_json_text_of(value, text):
    assert report.dumps(value) == text


def test_json_numbers_of_fifty_digits_read_back():
    run = hand_made.bouncing_ball(convert=FIFTY.mpf, digits=50, restitution="0.7")
    with_text_numbers = json.loads(report.dumps(report.as_json(run)), parse_float=str)
    read = [FIFTY.mpf(t["time"]) for t in with_text_numbers["transitions"]]
    assert [abs(a - t.time) < FIFTY.mpf(10) ** -48 for a, t in zip(read, run.transitions, strict=True)] == [True] * 4


def test_json_refuses_what_it_has_no_form_for():
    with pytest.raises(TypeError, match="a complex"):
        report.dumps({"x": 1j})


def test_json_lines_are_short_and_break_only_where_they_must():
    text = report.dumps(report.as_json(hand_made.modes_of_different_size()))
    assert all(len(line) <= 100 for line in text.splitlines())
    assert '  "settings": {"until": 3.0, "step": 0.001, "relaxation": 1e-06, "tolerance": null},' in text.splitlines()
    assert '    "outputs": {"double": null}' in text.splitlines()  # a line of 101 characters would not do


ALIKE = [
    ([f"sliding between a and b from t = {k}.5 to t = {k + 1}" for k in range(9)],
     "9 times between t = 0.5 and 9: sliding between a and b"),
    ([f"up->down at t = {t} crosses at {r}, {m} times the error" for t, r, m in ((3.2, 0.5, 12), (9.7, 0.1, "1,200"))],
     "2 times between t = 3.2 and 9.7: up->down crosses at 0.1 to 0.5, 12 to 1,200 times the error"),
    ([f"at t = {t} the choice of leg[{k}].lift matters" for k, t in enumerate(("10", "9", "1e-3"), 1)],
     "3 times between t = 1e-3 and 10: the choice of leg[1, 2, 3].lift matters"),
    ([f"inside a step, at t = 2, the run is beyond leg[{k}]" for k in range(1, 7)],
     "6 times: inside a step, at t = 2, the run is beyond leg[1..6]"),
    (["Zeno at t = 1: all within 2e-07", "Zeno at t = 2: all within 2e-07"],
     "2 times between t = 1 and 2: Zeno: all within 2e-07"),
]  # fmt: skip


@pytest.mark.parametrize(("sentences", "expected"), ALIKE)
def test_reasons_that_differ_in_numbers_are_one(sentences, expected):
    assert condensed(["first", *sentences, "m-1 rests", "m-2 rests"]) == ["first", expected, "m-1 rests", "m-2 rests"]
    assert condensed(sentences[:1]) == sentences[:1]


def test_every_reason_is_in_json():
    """The guard is nearly touched at 2 k pi, where an error decides whether it is crossed."""
    text = "hsdsl: 1\nmodes: {m: {flow: {x: -sin(t)}, transitions: [{name: top, when: x >= 1, to: m}]}}"
    run = hsdsl.loads(f"{text}\ninitial: {{mode: m, x: 0.999999}}\nexperiment: {{until: 40}}\n").simulate(
        tolerance=1e-6
    )
    each = [reason for reason in report.as_json(run)["verdict"]["reasons"] if "turns back" in reason]
    assert len(each) > 4
    whole = " ".join(summary(run).split())
    assert whole.count("turns back") == 1 and f"{len(each)} times between t = 0 and " in whole


def test_summary_to_the_letter():
    assert summary(hand_made.bouncing_ball(wait=0.125, bounces=2)).splitlines() == [
        "Bouncing ball",
        "models/hand-made.yaml",
        "relaxed midpoint, until 5.25, step 0.001, relaxation 1e-06",
        "",
        "#         time     delay  edge    from -> to  state",
        "0  2.000000000  1.25e-01  bounce  fly -> fly  v: -2 -> 1",
        "1  4.125000000  1.25e-01  bounce  fly -> fly  v: -1 -> 0.5",
        "",
        "stop      until at t = 5.25: The run reached its end.",
        "final     mode fly after 2 transitions",
        "          h = 0, v = -0.5",
        "          energy = 0.125",
        "verdict   unknown: nothing checks the hypotheses yet",
        "time      load 0.25 s, compile 0.01 s, simulate 0.5 s",
    ]


def _shown(run, **options):
    return summary(run, **options).splitlines()


def test_summary_of_modes_of_different_size_says_what_appears_and_what_is_dropped():
    lines = _shown(hand_made.modes_of_different_size())
    assert "0  1.000000000  a->b    a -> b      z: 5 (new); reached too: a->c" in lines
    assert "1  1.000000000  b->c    b -> c      z: 5 -> 6, x dropped, y dropped; at once on entering the mode" in lines
    assert not any("delay" in line for line in lines)  # nothing waited
    assert not any("double" in line for line in lines)  # the final mode has no z


def test_summary_of_a_run_that_ends_in_a_strip():
    lines = _shown(hand_made.ends_in_strip())
    assert "0  1.000000000   open  go    m -> n      the run ended in the strip" in lines
    assert "final     mode m after 0 transitions, waiting in a strip" in lines


@pytest.mark.parametrize("limit", [1, 2, 7, 60, 199])
def test_a_long_list_is_cut_in_the_middle(limit):
    lines = _shown(hand_made.thermostat(200), limit=limit)
    listed = [int(line.split()[0]) for line in lines if "->" in line and line.split()[0].isdigit()]
    assert len(listed) == limit
    assert listed[0] == 0
    assert listed == sorted(listed)
    assert limit == 1 or listed[-1] == 199
    assert f"   ... {200 - limit} more ..." in lines


def test_a_short_list_is_whole():
    assert not any("more" in line for line in _shown(hand_made.thermostat(60)))
    assert "No transitions." in _shown(hand_made.thermostat(0))


MADE = [hand_made.bouncing_ball, hand_made.modes_of_different_size, hand_made.blow_up, hand_made.ends_in_strip]


@pytest.mark.parametrize("make", MADE)
@pytest.mark.parametrize("width", [None, 60, 80])
def test_summary_fits_its_width_in_ascii(make, width):
    verdict = Verdict("left", ("tangency at t = 1 " * 9, "another reason that is long " * 5))
    text = summary(replace(make(), verdict=verdict), width=width)
    assert max(len(line) for line in text.splitlines()) <= (width or 100)
    assert text.isascii()


def test_times_of_very_different_size_keep_their_digits():
    run = hand_made.bouncing_ball(height=5e-12)
    assert [line.split()[1] for line in _shown(run)[5:7]] == [f"{t.time:.10g}" for t in run.transitions[:2]]
    assert times([0.05, 0.000123456789123, 0.0023], 10) == ["0.0500000000", "0.0001234568", "0.0023000000"]
    assert times([0.000123456789123, 0.0023], 10) == ["0.00012345679", "0.00230000000"]


def test_html_escapes_and_lists():
    run = hand_made.thermostat(100, heats="<on>", cools="a&b")
    page = html(run, limit=10)
    assert "&lt;on&gt; -&gt; a&amp;b" in page
    assert "<on>" not in page
    assert page.count("<tr><td>") == 10
    assert "90 more" in page


NAMES = ["body=move leg[1]=air leg[2]=air a=on", "body=move leg[1]=down leg[2]=air a=on"]


def test_product_modes_in_tables_and_legends():
    assert parts.change(*NAMES, "leg[1].touchdown") == "leg[1]: air -> down"
    assert parts.change(NAMES[0], NAMES[0], "body.kick") == "body: move -> move"
    assert parts.change("free", "fall", "go") == "free -> fall"
    assert parts.compact(NAMES[0]) == "body=move leg[1..2]=air a=on"
    assert parts.short_names(NAMES) == dict(zip(NAMES, ["leg[1]=air", "leg[1]=down"], strict=True))
    assert parts.short_names(["free", NAMES[0]]) == {"free": "free", NAMES[0]: parts.compact(NAMES[0])}


@pytest.mark.parametrize(("tolerance", "digits"), [(1e-4, 5), (3e-7, 8), (1e-9, 10), (2e-12, 13)])
def test_numbers_have_the_digits_that_the_tolerance_means(tolerance, digits):
    text = "hsdsl: 1\nmodes: {m: {flow: {x: x}, transitions: [{when: x >= 7, to: m, reset: {x: x/3}}]}}\n"
    run = hsdsl.loads(f"{text}initial: {{mode: m, x: 1}}\nexperiment: {{until: 3}}\n").simulate(tolerance=tolerance)
    lines = summary(run).splitlines()
    (row,) = [line for line in lines if "m->m" in line]
    (end,) = [line for line in lines if line.strip().startswith("x = ")]
    assert row.split()[1] == f"{math.log(7):.{digits - 1}f}"
    assert len(end.split("= ")[1].replace(".", "").lstrip("0")) <= digits
    assert float(end.split("= ")[1]) == pytest.approx(math.exp(3) / 3, rel=10 * tolerance)
