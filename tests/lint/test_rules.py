"""Every rule against its own page and its own cases.

A case file `cases/RULE.yaml` has models under `good`, and under `bad` what the rule finds in them, in source order:

    good: [MODEL, ..]
    bad:
      - model: MODEL
        finds: [{line, column, length, says, decided, severity, hint}, ..]   # what is given is compared; `says`: a part
        fixed: MODEL                                         # what `--fix` with this rule alone leaves, if it can

A model may be a fragment; see `fragments.completed`.
"""

from pathlib import Path

import pytest
import yaml
from lint.fragments import completed, examples

from hsdsl.analysis.lint import RULES, lint, selected
from hsdsl.analysis.lint.fix import fix
from hsdsl.analysis.lint.pages import rule_pages
from hsdsl.analysis.lint.rules import FAMILIES, family
from hsdsl.language.expression.timebox import OutOfTime

FOLDER = Path(__file__).parent
SECTIONS = ("What it does", "Why it is bad", "Example", "Use instead", "How it is decided", "How to fix it")
CASES = {path.stem: yaml.load(path.read_text("utf-8"), yaml.BaseLoader) for path in FOLDER.glob("cases/*.yaml")}
BAD = [(name, n) for name, case in CASES.items() for n in range(len(case["bad"]))]
GOOD = [(name, n) for name, case in CASES.items() for n in range(len(case["good"]))]


TOLD = [code for code in RULES if code != "HS492"]  # undecided: no model of ordinary size is; tested below


def code_of(name: str) -> str:
    return next(code for code, rule in RULES.items() if rule.name == name)


def found(code: str, model: str):
    """What one rule finds; comments that ignore it count, as they do for users."""
    selection = selected() if code.startswith("HS49") else selected([code])
    return [f for f in lint("model.yaml", selection, text=completed(model).encode()).findings if f.code == code]


def test_names_are_those_of_checks():
    named = {rule.name: rule.check.__name__ for rule in RULES.values() if hasattr(rule.check, "__name__")}
    assert all(name.replace("-", "_") == check for name, check in named.items())
    assert len({rule.name for rule in RULES.values()}) == len(RULES)


def test_every_rule_has_cases():
    assert set(CASES) == {RULES[code].name for code in TOLD}


def test_codes_are_in_families_and_in_order():
    assert list(RULES) == sorted(RULES)
    assert all(family(code) in FAMILIES for code in RULES)


@pytest.mark.parametrize("code", RULES)
def test_page_is_whole(code):
    page = rule_pages()[code]
    headings = [line.removeprefix("## ") for line in page.splitlines() if line.startswith("## ")]
    assert tuple(headings) == SECTIONS
    assert page.splitlines()[0].endswith(".") and not page.splitlines()[1]
    assert all(part.split("\n", 1)[1].strip() for part in page.split("## ")[1:])


@pytest.mark.parametrize("code", TOLD)
def test_examples_of_the_page(code):
    bad, good = (examples(rule_pages()[code], heading) for heading in ("Example", "Use instead"))
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
        for key in ("decided", "severity", "hint"):
            assert getattr(finding, key) == expected.get(key, getattr(finding, key))
        assert finding.span.column + finding.span.length <= len(finding.text) + 1


@pytest.mark.parametrize(("name", "number"), [(n, k) for n, k in BAD if "fixed" in CASES[n]["bad"][k]])
def test_fixes(name, number, tmp_path):
    case, path = CASES[name]["bad"][number], tmp_path / "model.yaml"
    path.write_text(completed(case["model"]))
    report, remedied = fix(path, selected([code_of(name)]))
    assert path.read_text() == completed(case["fixed"])
    assert remedied and not report.findings


@pytest.mark.parametrize(("name", "number"), GOOD)
def test_good_models(name, number):
    assert found(code_of(name), CASES[name]["good"][number]) == []


MODELS = sorted((FOLDER.parent.parent / "models").glob("*.yaml"))


@pytest.mark.parametrize("path", MODELS, ids=lambda path: path.stem)
def test_models_have_no_warnings_and_ignore_no_notes(path):
    report = lint(path)
    warnings = [f"{f.code} {f.span.line}: {f.message}" for f in report.findings if f.severity == "warning"]
    assert warnings == []
    assert all(ignored.reason and ignored.diagnostic.severity == "warning" for ignored in report.ignored)


@pytest.mark.parametrize(("raised", "says"), [(OutOfTime(), "takes too long"), (ValueError("x"), "ValueError")])
def test_a_rule_that_gives_up_says_so_and_the_others_go_on(monkeypatch, raised, says):
    def fails(subject):
        raise raised

    monkeypatch.setitem(RULES.own, "HS421", RULES["HS421"]._replace(check=fails))
    model = "parameters: {p: 1}\nmodes: {m: {flow: {x: 1}}}\n"
    found = lint("model.yaml", selected(["HS401", "HS421"]), text=completed(model).encode()).findings
    assert [f.code for f in found] == ["HS492", "HS401"] and says in found[0].message


@pytest.mark.parametrize(
    ("model", "code", "says"),
    [
        ("oscillator-with-stop-2", "HS462", "starts on the guard of 'impact' with the flow pointing out"),
        ("digital-control", "HS425", "'D3' is entered and never left"),
    ],
)
def test_what_is_known_of_the_paper_scenes_is_found(model, code, says):
    (path,) = [path for path in MODELS if path.stem == model]
    report = lint(path)
    found = [f for f in (*report.findings, *(i.diagnostic for i in report.ignored)) if f.code == code]
    assert len(found) == 1 and says in found[0].message
