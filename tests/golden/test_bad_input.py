"""Bad models, and the text that is printed for each. Every code has at least one."""

from pathlib import Path

import pytest
from shipped import assert_golden, bad_models

from hsdsl.base.errors import CODES, TOO_LONG, ModelError
from hsdsl.language.diagnose import as_json, render
from hsdsl.language.elaborate import elaborate

FOLDER = Path(__file__).parent / "bad"
CASES = bad_models()


@pytest.fixture(autouse=True)
def in_folder(monkeypatch):
    monkeypatch.chdir(FOLDER)


def diagnostics(name):
    with pytest.raises(ModelError) as raised:
        elaborate(f"{name}.yaml", text=CASES[name])
    return raised.value.diagnostics


@pytest.mark.parametrize("case", CASES)
def test_says_what_is_expected(case):
    printed = "".join(render(d) + "\n" for d in diagnostics(case))
    assert_golden(printed, FOLDER / f"{case}.txt")


@pytest.mark.parametrize("case", CASES)
def test_places_are_in_the_file_and_in_order(case):
    found = diagnostics(case)
    places = [(d.span.path, d.span.line, d.span.column) for d in found]
    assert places == sorted(places, key=lambda p: (p[0] != f"{case}.yaml", *p))
    for entry in as_json(found)["errors"]:
        assert set(entry) == {"code", "path", "line", "column", "message", "hint"}
        text = CASES[case] if entry["path"] == f"{case}.yaml" else Path(entry["path"]).read_bytes()
        lines = text.decode("utf-8", "replace").splitlines() or [""]
        assert 1 <= entry["line"] <= len(lines) + 1
        assert entry["column"] <= len(lines[min(entry["line"], len(lines)) - 1]) + 1


def test_every_code_has_a_case():
    expected = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("*.txt"))
    by_limits = ["HS003", "HS016", TOO_LONG]  # tests/cli/test_limits.py
    of_imports = ["HS331", "HS332", "HS333", "HS334"]  # tests/import
    assert [code for code in CODES if f"error {code}:" not in expected] == by_limits + of_imports


def test_nothing_is_left_over():
    assert {path.stem for path in FOLDER.glob("*.txt")} == set(CASES)


def test_no_jargon_of_the_libraries():
    for path in FOLDER.glob("*.txt"):
        printed = path.read_text(encoding="utf-8").lower()
        for word in ("pydantic", "sympy", "traceback", "input should", "token", "scalar", "zoo", "node"):
            assert word not in printed, path.name
