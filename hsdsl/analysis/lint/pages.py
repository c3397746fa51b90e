"""Pages of errors, warnings of runs and rules in Markdown: for `hsdsl explain`, SARIF and the documentation."""

from __future__ import annotations

import re
from collections.abc import Mapping
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


@cache
def rule_pages() -> dict[str, str]:
    """The pages of rules, in one file a family; the first line of a page is its title."""
    return {code: page for family in FAMILIES for code, page in _pages(f"rules/{family}.md").items()}


def error_pages() -> dict[str, str]:
    """The pages of errors, with their titles. The first example of a page is wrong, the second right."""
    return _titled("errors.md", CODES)


def warning_pages() -> dict[str, str]:
    """The pages of warnings of runs, in the same form."""
    return _titled("warnings.md", WARNINGS)


def _titled(file: str, titles: Mapping[str, str]) -> dict[str, str]:
    pages = {code: _WRONG.sub(r"## Example\n\n\1## Use instead\n\n", page) for code, page in _pages(file).items()}
    return {code: f"{titles[code][0].upper()}{titles[code][1:]}.\n\n{page}" for code, page in pages.items()}


def _pages(file: str) -> dict[str, str]:
    """The pages of a file, each below its code."""
    text = resources.files("hsdsl.analysis.lint").joinpath(file).read_text(encoding="utf-8")
    _, *parts = re.split(r"^# (HS\d{3})\n", text, flags=re.MULTILINE)
    return {code: page.strip() for code, page in zip(parts[::2], parts[1::2], strict=True)}
