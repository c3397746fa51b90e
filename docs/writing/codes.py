"""The pages of errors, warnings of runs and lint rules, from their Markdown files."""

from __future__ import annotations

from collections.abc import Mapping

from writing.markdown import lowered, table

from hsdsl.analysis.lint.pages import error_pages, rule_pages, titles, warning_pages
from hsdsl.analysis.lint.rules import FAMILIES, RULES, family
from hsdsl.base import errors

ERROR_CODES = """# Error codes

A code keeps its meaning for ever, and a retired code is not used again. `hsdsl explain CODE` prints this text.
Examples may leave out the keys that every model has.

"""

WARNING_CODES = """# Warnings of runs

A run reports its warnings first. Each is a line `warning` of the summary, and an entry (code, time, edge, message) of
`warnings` in `--json` and of `run.warnings` in Python. In ensembles and sweeps its code is in the column `warnings`.
A run with warnings may be right, and its verdict may be `holds`: a warning names what you may not have intended.
Warnings with the same code and transition share one line, with the first time and their number. Codes keep their
meaning. `hsdsl explain CODE` prints this text.

"""

LINT_RULES = """# Lint rules

`hsdsl lint` finds probable mistakes in legal models (warnings), and makes remarks (notes).
`hsdsl explain CODE` prints the page of a rule. [Lint models](../how-to/lint.md) shows how to choose rules and ignore
findings.

"""


def error_codes() -> str:
    """Document every code of an error."""
    return _listed(ERROR_CODES, errors.CODES, error_pages())


def warning_codes() -> str:
    """Document every code of a warning."""
    return _listed(WARNING_CODES, errors.WARNINGS, warning_pages())


def _listed(head: str, titles: Mapping[str, str], pages: Mapping[str, str]) -> str:
    rows = [(f"[`{code}`](#{code.lower()})", text) for code, text in sorted(titles.items())]
    parts = [f"## {code}\n\n{lowered(page)}\n\n" for code, page in pages.items()]
    return head + table(("code", "about"), rows) + "".join(parts)


def rule_index() -> str:
    """List every lint rule by family."""
    parts = [LINT_RULES]
    for name in FAMILIES:
        rows = [
            (f"[`{code}`](rules/{name}.md#{code.lower()}-{rule.name})", rule.name, titles()[code], rule.severity)
            for code, rule in RULES.items()
            if family(code) == name
        ]
        parts.append(f"## {name.capitalize()}\n\n" + table(("code", "name", "finds", ""), rows) if rows else "")
    return "".join(parts)


def rule_family(name: str) -> str:
    """Document the rules of one family."""
    parts = [f"# Rules: {name}\n\n"]
    for code, rule in RULES.items():
        if family(code) == name:
            parts.append(f"## {code} {rule.name}\n\n{lowered(rule_pages()[code])}\n\n")
    return "".join(parts)
