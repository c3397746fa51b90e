"""`hsdsl lint`: formats, selection, configuration, ignores and `--fix`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest
import yaml

SARIF = json.loads((Path(__file__).parents[1] / "lint" / "sarif-2.1.0-rtm.5.json").read_text())
BAD = """hsdsl: 1
parameters: {g: 9.81, drag: 0.1}  # hsdsl: ignore[HS401] for later
modes:
  fall:
    flow: {h: v, v: -9.81}
    transitions:
      - {when: h <= 0, to: fall, reset: {h: h, v: -v}}  # the floor
initial: {mode: fall, h: 1, v: 0}
experiment: {until: 1}
"""
BROKEN = BAD.replace("to: fall", "to: fal")
ONLY = ["--select", "HS401,HS421"]


@pytest.fixture
def bad(model):
    return model(BAD)


def test_text(command, bad):
    answer = command("lint", bad, *ONLY)
    assert answer.code == 1
    assert answer.out == (
        f"{bad}: 1 finding, 2 ignored\n"
        f"{bad}:7:42: warning HS421: the state 'h' keeps its value anyway\n"
        "        - {when: h <= 0, to: fall, reset: {h: h, v: -v}}  # the floor\n"
        "                                           ^\n"
        "  hint: leave it out\n\n1 finding\n"
    )


def test_notes_are_counted_unless_selected(command, model):
    path = model(BAD.replace("reset: {h: h, v: -v}", "reset: {v: -v}").replace(", drag: 0.1", ""))
    hidden = command("lint", path)
    assert hidden.code == 0
    assert hidden.out == f"{path}: clean, 1 ignored\n2 notes on the mathematics: hsdsl lint --notes\n"
    assert command("lint", path, "--quiet").out == ""
    for option in (["--notes"], ["--select", "HS505,HS507"]):
        shown = command("lint", path, *option)
        assert shown.code == 0 and shown.out.count(": note HS50") == 2 and "2 findings" in shown.out
    assert len(command("lint", path, "--json").json["findings"]) == 2


def test_clean(command, bad):
    answer = command("lint", bad, "--select", "HS406")
    assert (answer.code, answer.out) == (0, f"{bad}: clean\n")
    assert command("lint", bad, "--select", "HS406", "--quiet").out == ""


def test_json(command, bad, model):
    answer = command("lint", bad, model(BROKEN, "broken.yaml"), *ONLY, "--format", "json")
    assert answer.code == 1 and [entry["clean"] for entry in answer.json["models"]] == [False, False]
    (finding,) = answer.json["findings"]
    assert finding == {
        "code": "HS421",
        "path": str(bad),
        "line": 7,
        "column": 42,
        "length": 1,
        "message": "the state 'h' keeps its value anyway",
        "hint": "leave it out",
        "severity": "warning",
        "decided": "symbolic",
        "fixable": True,
    }
    assert [entry["reason"] for entry in answer.json["ignored"]] == ["for later"] * 2
    assert [(error["code"], error["length"]) for error in answer.json["errors"]] == [("HS303", 3)]
    assert command("lint", bad, *ONLY, "--json").json["findings"] == [finding]


@pytest.mark.parametrize("verb", [["lint"], ["validate"]])
def test_sarif(command, model, bad, verb):
    answer = command(*verb, bad, model(BROKEN, "broken.yaml"), "--format", "sarif")
    assert answer.code == 1
    jsonschema.Draft4Validator(SARIF, format_checker=jsonschema.FormatChecker()).validate(answer.json)
    (run,) = answer.json["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert all(rules[result["ruleIndex"]]["id"] == result["ruleId"] for result in run["results"])
    errors = [r for r in run["results"] if r["ruleId"] == "HS303"]
    assert len(errors) == 1 and errors[0]["level"] == "error"
    place = errors[0]["locations"][0]["physicalLocation"]
    assert place["region"] == {"startLine": 7, "startColumn": 28, "endColumn": 31}
    assert place["artifactLocation"]["uri"] == (bad.parent / "broken.yaml").as_uri()


def test_sarif_has_ignored_results_and_fixes(command, bad):
    (run,) = command("lint", bad, *ONLY, "--format", "sarif").json["runs"]
    ignored = [r["suppressions"] for r in run["results"] if r["ruleId"] == "HS401"]
    assert ignored == [[{"kind": "inSource", "justification": "for later"}]] * 2
    (fixable,) = [r for r in run["results"] if "fixes" in r]
    (edit,) = fixable["fixes"][0]["artifactChanges"][0]["replacements"]
    start, length = edit["deletedRegion"]["charOffset"], edit["deletedRegion"]["charLength"]
    assert BAD[start : start + length] == "h: h, " and edit["insertedContent"]["text"] == ""


def test_the_schema_of_sarif_refuses_what_is_not_sarif():
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft4Validator(SARIF).validate({"version": "2.1.0", "runs": [{"results": []}]})


def test_github(command, model, bad, monkeypatch):
    monkeypatch.chdir(bad.parent)
    model(BROKEN, "a,b.yaml")
    answer = command("lint", bad.name, "a,b.yaml", *ONLY, "--format", "github")
    assert answer.out.splitlines() == [
        "::error file=a%2Cb.yaml,line=7,endLine=7,col=28,endColumn=31,title=HS303::"
        "there is no mode 'fal'%0Ahint: did you mean 'fall'?",
        "::warning file=model.yaml,line=7,endLine=7,col=42,endColumn=43,title=HS421::"
        "the state 'h' keeps its value anyway%0Ahint: leave it out",
    ]


@pytest.mark.parametrize(
    "arguments",
    [["--select", "HS999"], ["--ignore", "nothing"], ["--format", "xml"], ["--select", "HS301"], ["--select", ""]],
)
def test_wrong_usage(command, bad, arguments):
    assert command("lint", bad, *arguments).code == 2


@pytest.mark.parametrize(
    ("options", "codes"),
    [
        (["--select", "HS42"], ["HS421"]),
        (["--select", "identity-reset"], ["HS421"]),
        (["--select", "shape,names", "--ignore", "HS421"], []),
        (["--select", "HS401", "--select", "HS421"], ["HS421"]),
    ],
)
def test_selection(command, bad, options, codes):
    found = command("lint", bad, *options, "--json").json["findings"]
    assert sorted({finding["code"] for finding in found}) == codes


@pytest.mark.parametrize(
    ("name", "text"),
    [("hsdsl.toml", "[lint]\nignore = ['HS421']\n"), ("pyproject.toml", "[tool.hsdsl.lint]\nselect = ['HS401']\n")],
)
def test_configuration_is_found_upwards_and_options_count_before_it(command, tmp_path, name, text):
    (tmp_path / name).write_text(text)
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "m.yaml").write_text(BAD)
    assert "HS421" not in command("lint", folder / "m.yaml").out
    options = ["--select", "HS421", "--ignore", ""]
    assert "HS421" in command("lint", folder / "m.yaml", *options).out


@pytest.mark.parametrize(
    "text", ["[lint]\nselect = 'HS401'\n", "[lint]\nselct = []\n", "lint = 3\n", "[lint\n", "[lint]\nselect = ['HS1']"]
)
def test_wrong_configuration(command, bad, text):
    (bad.parent / "hsdsl.toml").write_text(text)
    assert command("lint", bad).code == 2


def test_fix_keeps_comments_and_runs_once(command, bad):
    answer = command("lint", bad, *ONLY, "--fix")
    assert answer.code == 0 and answer.out == f"{bad}: clean, 1 fixed, 2 ignored\n"
    assert bad.read_text() == BAD.replace("h: h, ", "")
    before = bad.stat()
    assert "fixed" not in command("lint", bad, *ONLY, "--fix").out
    assert (bad.stat().st_mtime_ns, bad.stat().st_ino) == (before.st_mtime_ns, before.st_ino)


def test_fix_keeps_line_ends_and_the_byte_order_mark(command, bad):
    windows = BAD.replace("h: h, ", "h: h,\r\n          ").replace("\n", "\r\n").replace("\r\r", "\r")
    bad.write_bytes(b"\xef\xbb\xbf" + windows.encode())
    assert command("lint", bad, *ONLY, "--fix").code == 0
    assert bad.read_bytes() == b"\xef\xbb\xbf" + BAD.replace("h: h, ", "").replace("\n", "\r\n").encode()


def test_fix_leaves_a_model_with_errors_alone(command, model):
    path = model(BROKEN)
    assert command("lint", path, "--fix").code == 1
    assert path.read_text() == BROKEN


def test_fix_leaves_alone_what_an_alias_repeats(command, model):
    text = BAD.replace(
        "reset: {h: h, v: -v}}", "reset: &r {h: h, v: -v}}\n      - {when: h <= -1, to: fall, reset: *r}"
    )
    path = model(text)
    command("lint", path, *ONLY, "--fix")
    assert path.read_text() == text


def test_hooks_for_pre_commit(command, bad):
    hooks = yaml.safe_load((Path(__file__).parents[2] / ".pre-commit-hooks.yaml").read_text())
    assert [hook["id"] for hook in hooks] == ["hsdsl-validate", "hsdsl-lint"]
    for hook in hooks:
        assert {"id", "name", "entry", "language", "files"} <= set(hook)
        assert re.search(hook["files"], "models/ball.yaml") and not re.search(hook["files"], "tests/ball.yaml")
        program, *words = hook["entry"].split()
        assert program == "hsdsl"
        assert command(*words, bad).code == (1 if "lint" in words else 0)


def test_unreadable(command, tmp_path):
    answer = command("lint", tmp_path / "no.yaml", "--json")
    assert answer.code == 2 and "no such file" in answer.json["models"][0]["message"]
