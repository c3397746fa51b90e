"""The page of every code, of errors and of rules: what `hsdsl explain` prints and the documentation shows."""

from __future__ import annotations

import re
from importlib import resources

from hsdsl.errors import CODES
from hsdsl.lint.rules import RULES


def titles() -> dict[str, str]:
    """One line about every code."""
    return {**CODES, **{code: rule.title for code, rule in RULES.items()}}


def pages() -> dict[str, str]:
    """The page of every code, in Markdown."""
    return {**error_pages(), **{code: rule.page for code, rule in RULES.items()}}


def error_pages() -> dict[str, str]:
    """The pages of errors, which stand in one file, each below its code."""
    text = resources.files("hsdsl.lint").joinpath("errors.md").read_text(encoding="utf-8")
    parts = re.split(r"^# (HS\d{3})\n", text, flags=re.MULTILINE)
    return {
        code: f"{_sentence(CODES[code])}\n\n{page.strip()}" for code, page in zip(parts[1::2], parts[2::2], strict=True)
    }


def _sentence(title: str) -> str:
    return title[0].upper() + title[1:] + "."
