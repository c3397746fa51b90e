"""The page of every code, of errors and of rules: what `hsdsl explain` prints and the documentation shows."""

from __future__ import annotations

from hsdsl.errors import CODES
from hsdsl.lint.rules import RULES


def titles() -> dict[str, str]:
    """One line about every code."""
    return {**CODES, **{code: rule.title for code, rule in RULES.items()}}


def pages() -> dict[str, str]:
    """The page of every code that has one, in Markdown."""
    return {code: rule.page for code, rule in RULES.items()}
