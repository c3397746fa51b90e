"""Texts of models, saved runs and file names where they are shown: terminals, annotations, HTML and pictures."""

from __future__ import annotations

import re
import sys
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import hand_made
import numpy as np
import pytest

from hsdsl.analysis import plot, store
from hsdsl.analysis.report.summary import html, summary
from hsdsl.base.errors import Diagnostic, Span
from hsdsl.base.names import shown, visible, visible_lines
from hsdsl.engine.execution import Stop, Transition, Verdict
from hsdsl.interface.cli import main
from hsdsl.language.diagnose import as_annotation, render

HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b\u200e\u200f\u2028-\u202e\u2060-\u2069\ufeff\ud800-\udfff]")
HOSTILE = [
    "\x1b[31mred\x1b[0m", "\x1b]0;title\x07", "\x9b31m", "back\x08\x08", "over\rwritten", "two\n::error::lines",
    "\u202egnp.exe", "zero\u200bwidth", "\udc9bbyte", "nul\x00", "<script>alert(1)</script>", '" onload="x', "a & b;",
    "']]>-->", "$\\frac{", "%0A::error::x", "{0.__class__}",
]  # fmt: skip
ALL = " ".join(HOSTILE)
MODEL = """hsdsl: 1
modes: {m: {flow: {x: 1}}}
initial: {mode: m, x: 0}
experiment: {until: 1}
"""


def hostile_run(text: str):
    """A saved run each of whose texts is this one."""
    draft = hand_made.Draft((f"o{text}",))
    draft.arc(f"m{text}", (f"x{text}", "y"), 0, [(0.0, [1.0, 2.0], [3.0], 0.0, []), (1.0, [2.0, 2.0], [3.0], 0.0, [])])
    draft.arc(f"n{text}", (f"x{text}", "y"), 1, [(1.0, [1.0, 2.0], [3.0], 0.0, []), (2.0, [2.0, 2.0], [3.0], 0.0, [])])
    run = draft.make(title=text)
    edge = dict(edge=text, source=f"m{text}", target=f"n{text}", alternatives=(text,))
    changed = {
        "model": text, "engine": text, "scheme": text, "method": text, "stop": Stop("zeno", 2.0, text),
        "transitions": (Transition(0, 1.0, 1.0, before={f"x{text}": 2.0}, after={f"x{text}": 1.0}, **edge),),
        "settings": {text: text, "left_out": {"states": (text,), "reason": text}}, "seconds": {text: 1.0},
        "verdict": Verdict("unknown", (text,)),
    }  # fmt: skip
    return replace(run, **changed)


class Tags(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.seen: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag, attributes):
        self.seen |= {tag, *(name for name, _ in attributes)}

    def handle_data(self, data):
        self.text += data


@pytest.mark.parametrize("text", [*HOSTILE, ALL], ids=ascii)
def test_a_saved_run_steers_nothing(text, tmp_path):
    hostile_run(text).save(tmp_path / "run.npz")
    run = store.load(tmp_path / "run.npz")
    assert run == hostile_run(text)  # as data it is what it was
    assert not HIDDEN.search(summary(run)) and not HIDDEN.search(repr(run)) and "\n" not in repr(run)
    for page in (html(run), html(run, limit=12)):
        tags = Tags()
        tags.feed(page)
        assert tags.seen == {"div", "class", "p", "strong", "br", "table", "tr", "th", "td", "thead", "tbody"}
        assert not HIDDEN.search(page) and visible_lines(text) in tags.text


def test_a_notebook_shows_a_run_as_text():
    tags = Tags()
    tags.feed(shown := hostile_run(ALL)._repr_html_())
    table = {"div", "class", "p", "strong", "br", "table", "tr", "th", "td", "thead", "tbody"}
    assert tags.seen == table | {"img", "alt", "src", "style"} and not HIDDEN.search(shown)


@pytest.mark.parametrize("text", ["\x1b[31m\udc9b\x00<b>&\n--> $\\frac{", ALL], ids=["short", "all"])
def test_pictures_are_well_formed(text, tmp_path):
    run = hostile_run(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for suffix in (".svg", ".png", ".html"):
            plot.plot(run, tmp_path / f"run{suffix}", title=text, units={f"x{text}": text, "t": text})
    written = (tmp_path / "run.svg").read_text(encoding="utf-8")
    ElementTree.fromstring(written)
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    tags = Tags()
    tags.feed(page)
    assert not HIDDEN.search(written) and not HIDDEN.search(page)
    assert not {"onload", "b"} & tags.seen
    assert page.count("<script") == 3  # the page's own


@pytest.mark.parametrize("text", HOSTILE, ids=ascii)
def test_a_diagnostic_is_said_on_its_own_lines(text):
    diagnostic = Diagnostic("HS111", text, Span(text, 1, 1), text, f"x: {text}", "error")
    lines = render(diagnostic).split("\n")
    assert len(lines) == 4 and not HIDDEN.search("".join(lines))
    annotation = as_annotation(diagnostic)
    command, properties, message = re.fullmatch(r"::(\w+) (\S.*?)::(.*)", annotation).groups()
    assert not HIDDEN.search(annotation) and "\n" not in annotation and command == "error"
    entries = dict(entry.split("=", 1) for entry in properties.split(","))
    assert list(entries) == ["file", "line", "endLine", "col", "endColumn", "title"] and ":" not in properties
    assert unquote(entries["file"], errors="surrogatepass") == text
    assert unquote(message, errors="surrogatepass") == f"{text}\nhint: {text}"


NAMES = [name for name in HOSTILE if "/" not in name and "\x00" not in name]


@pytest.mark.skipif(sys.platform != "linux", reason="file names of any bytes")
@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_a_file_name_steers_nothing(name, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.yaml").write_text(MODEL)
    Path(f"{name}2.yaml").write_text(MODEL.replace("x: 1", "x: q"))
    commands = [
        ["validate", f"{name}.yaml", f"{name}2.yaml", f"{name}3.yaml"], ["lint", f"{name}.yaml", f"{name}2.yaml"],
        ["lint", "--format", "github", f"{name}2.yaml"], ["lint", "--format", "sarif", f"{name}2.yaml"],
        ["validate", "--json", f"{name}2.yaml"], ["run", f"{name}.yaml", "--json", "--plot", f"{name}.html"],
        ["run", f"{name}.yaml", "--out", "r.npz"],
        ["run", f"{name}3.yaml"], ["run", f"{name}.yaml", f"--{name}"], ["lint", "--format", name, "x"], [name],
        ["run", f"{name}.yaml", "--engine", name], ["run", f"{name}.yaml", "--out", f"{name}/x.csv"], ["explain", name],
        ["run", f"{name}.yaml", "--set", f"{name}=1"], ["distance", f"{name}.npz", f"{name}.npz"],
    ]  # fmt: skip
    for words in commands:
        monkeypatch.setattr(sys, "argv", ["hsdsl", *words])
        with pytest.raises(SystemExit):
            main()
        printed = capfd.readouterr()
        for stream in printed:
            assert not HIDDEN.search(stream), words
            assert words[:3] == ["lint", "--format", "github"] or not re.search("^::", stream, re.M), words
        assert len(printed.out.splitlines()) == 1 or words[:3] != ["lint", "--format", "github"]
        assert printed.out or printed.err


def test_what_is_visible_stays(capfd):
    assert visible("a\tb\u00e9\u6f22\U0001f600 z") == "a\tb\u00e9\u6f22\U0001f600 z"
    assert len(visible(ALL)) == len(ALL) and visible_lines("a\nb\r") == "a\nb\ufffd"
    assert (
        shown(" a\n b\x1b ") == "a b\ufffd" and shown("x" * 99) == "x" * 57 + "..." and len(shown("x" * 99, None)) == 99
    )
    assert np.array_equal(hostile_run("x").times, [0.0, 1.0, 1.0, 2.0])
