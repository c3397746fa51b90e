"""Every rule against its own page and its own cases.

A case file `cases/RULE.yaml` has models under `good`, and under `bad` what the rule finds in them, in source order:

    good: [MODEL, ..]
    bad:
      - model: MODEL
        finds: [{line, column, length, says, decided}, ..]   # what is given is compared; `says` is part of the message
        fixed: MODEL                                         # what `--fix` with this rule alone leaves, if it can

A model may be a fragment; see `fragments.completed`.
"""

from pathlib import Path

import pytest
import yaml
from lint.fragments import completed, examples

from hsdsl.lint import RULES, Selection, lint
from hsdsl.lint.fix import fix
from hsdsl.lint.rules import FAMILIES, family

FOLDER = Path(__file__).parent
MODULES = FOLDER.parent.parent / "hsdsl" / "lint" / "rules"
SECTIONS = ("What it does", "Why it is bad", "Example", "Use instead", "How it is decided", "How to fix it")
CASES = {path.stem: yaml.load(path.read_text("utf-8"), yaml.BaseLoader) for path in FOLDER.glob("cases/*.yaml")}
BAD = [(name, n) for name, case in CASES.items() for n in range(len(case["bad"]))]
GOOD = [(name, n) for name, case in CASES.items() for n in range(len(case["good"]))]


def code_of(name: str) -> str:
    return next(code for code, rule in RULES.items() if rule.name == name)


def found(code: str, model: str):
    """What one rule finds; comments that ignore it count, as they do for users."""
    selection = Selection.of() if code.startswith("HS49") else Selection.of([code])
    return [f for f in lint("model.yaml", selection, text=completed(model).encode()).findings if f.code == code]


def test_every_file_is_registered_once():
    files = {path.stem for path in MODULES.glob("*.py")} - {"__init__"}
    registered = [rule.module.__name__.rpartition(".")[2] for rule in RULES.values()]
    assert sorted(registered) == sorted(files)


def test_every_rule_has_cases():
    assert set(CASES) == {rule.name for rule in RULES.values()}


def test_codes_are_in_families_and_in_order():
    assert list(RULES) == sorted(RULES)
    assert all(family(code) in FAMILIES for code in RULES)


@pytest.mark.parametrize("code", RULES)
def test_page_is_whole(code):
    page = RULES[code].page
    headings = [line.removeprefix("## ") for line in page.splitlines() if line.startswith("## ")]
    assert tuple(headings) == SECTIONS
    assert page.splitlines()[0].endswith(".") and not page.splitlines()[1]
    assert all(part.split("\n", 1)[1].strip() for part in page.split("## ")[1:])


@pytest.mark.parametrize("code", RULES)
def test_examples_of_the_page(code):
    bad, good = (examples(RULES[code].page, heading) for heading in ("Example", "Use instead"))
    assert bad and good
    assert all(found(code, model) for model in bad)
    assert not any(found(code, model) for model in good)


@pytest.mark.parametrize(("name", "number"), BAD)
def test_bad_models(name, number):
    case = CASES[name]["bad"][number]
    findings = found(code_of(name), case["model"])
    assert len(findings) == len(case["finds"]), [f.message for f in findings]
    for finding, expected in zip(findings, case["finds"], strict=True):
        for key in ("line", "column", "length"):
            assert str(getattr(finding.span, key)) == expected.get(key, str(getattr(finding.span, key))), finding
        assert expected.get("says", "") in finding.message
        assert finding.decided == expected.get("decided", finding.decided)
        assert finding.span.column + finding.span.length <= len(finding.text) + 1


@pytest.mark.parametrize(("name", "number"), [(n, k) for n, k in BAD if "fixed" in CASES[n]["bad"][k]])
def test_fixes(name, number, tmp_path):
    case, path = CASES[name]["bad"][number], tmp_path / "model.yaml"
    path.write_text(completed(case["model"]))
    report, remedied = fix(path, Selection.of([code_of(name)]))
    assert path.read_text() == completed(case["fixed"])
    assert remedied and not report.findings


@pytest.mark.parametrize(("name", "number"), GOOD)
def test_good_models(name, number):
    assert found(code_of(name), CASES[name]["good"][number]) == []
