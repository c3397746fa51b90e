"""Pages of errors, warnings of runs and rules in Markdown: for `hsdsl explain`, SARIF and the documentation."""

from __future__ import annotations

import re
from functools import cache
from importlib import resources

from hsdsl.analysis.lint.rules import FAMILIES, RULES
from hsdsl.base.errors import CODES, WARNINGS

_WRONG = re.compile(r"(```yaml\n.*?)(?=```yaml)", re.DOTALL)


def titles() -> dict[str, str]:
    """One line about every code."""
    return {**CODES, **WARNINGS, **{code: rule_pages()[code].partition("\n")[0].rstrip(".") for code in RULES}}


def pages() -> dict[str, str]:
    """The page of every code."""
    return {**error_pages(), **warning_pages(), **rule_pages()}


def rule_pages() -> dict[str, str]:
    """The pages of rules, in one file a family; the first line of a page is its title."""
    return _own_pages() | {code: rule.page.strip() for code, rule in RULES.items() if rule.page}


@cache
def _own_pages() -> dict[str, str]:
    return {code: page for family in FAMILIES for code, page in _pages("analysis.lint.rules", f"{family}.md").items()}


def error_pages(file: str = "errors.md") -> dict[str, str]:
    """The pages of errors, with their titles. The first example of a page is wrong, the second right."""
    pages = {
        code: _WRONG.sub(r"## Example\n\n\1## Use instead\n\n", page) for code, page in _pages("base", file).items()
    }
    return {code: page[0].upper() + page[1:].replace("\n", ".\n", 1) for code, page in pages.items()}


def warning_pages() -> dict[str, str]:
    """The pages of warnings of runs, in the same form."""
    return error_pages("warnings.md")


def _pages(package: str, file: str) -> dict[str, str]:
    """The pages of a file, each below its code."""
    text = resources.files(f"hsdsl.{package}").joinpath(file).read_text(encoding="utf-8")
    _, *parts = re.split(r"^# (HS\d{3})\s", text, flags=re.MULTILINE)
    return {code: page.strip() for code, page in zip(parts[::2], parts[1::2], strict=True)}
