"""The pages of errors, and `hsdsl explain`. The pages of rules are tested with the rules."""

import pytest
from lint.fragments import blocks, completed

from hsdsl.analysis.lint import RULES
from hsdsl.analysis.lint.pages import error_pages, pages, rule_pages, titles, warning_pages
from hsdsl.base.errors import CODES, WARNINGS, ModelError
from hsdsl.language.elaborate import elaborate

# not UTF-8; large files, mappings, expressions and nests; a minute of work
WITHOUT_EXAMPLE = {"HS001", "HS003", "HS015", "HS016", "HS110", "HS122", "HS123"}
WITHOUT_EXAMPLE |= {"HS331", "HS332", "HS333", "HS334"}  # about files to import: tests/import/bad


def codes_found(page, heading, folder):
    for language, text in blocks(page, heading):
        if language == "csv":
            (folder / "u.csv").write_text(text)
    (text,) = [text for language, text in blocks(page, heading) if language == "yaml"]
    try:
        elaborate(folder / "model.yaml", text=completed(text).encode())
    except ModelError as error:
        return {diagnostic.code for diagnostic in error.diagnostics}
    return set()


def test_every_code_has_a_page_and_a_title():
    assert list(error_pages()) == list(CODES)
    assert list(rule_pages()) == list(RULES)
    assert list(warning_pages()) == list(WARNINGS)
    assert set(pages()) == set(titles()) == {*CODES, *WARNINGS, *RULES}


@pytest.mark.parametrize("code", [code for code in CODES if code not in WITHOUT_EXAMPLE])
def test_examples(code, tmp_path):
    page = error_pages()[code]
    assert codes_found(page, "Example", tmp_path) == {code}
    assert codes_found(page, "Use instead", tmp_path) == set()


@pytest.mark.parametrize("code", [*CODES, *WARNINGS])
def test_a_page_says_something_beside_its_examples(code):
    title, text, *_ = pages()[code].split("\n\n")
    assert title.endswith(".") and text.endswith(".") and not text.startswith("#")
