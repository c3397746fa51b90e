"""The pages of errors, warnings of runs and lint rules, from their Markdown files."""

from __future__ import annotations

from collections.abc import Mapping

from writing.markdown import lowered, table

from hsdsl.analysis.lint.pages import error_pages, rule_pages, titles, warning_pages
from hsdsl.analysis.lint.rules import FAMILIES, RULES, family
from hsdsl.base import errors

ERROR_CODES = """# Error codes

A code keeps its meaning for ever; a retired one is not used again. `hsdsl explain CODE` prints this text.
Examples may leave out the keys that every model has.

"""

WARNING_CODES = """# Warnings of runs

What a run reports first: each is a line `warning` of its summary, an entry of `warnings` in `--json` (code, time, edge,
message) and of `run.warnings` in Python, and a code in the column `warnings` of ensembles and sweeps. A run with
warnings may be right, and its verdict may be `holds`: they are about what its author may not have meant.
Several of one code about one transition are one line, with the first time and how often. Codes keep their meaning.
`hsdsl explain CODE` prints this text.

"""

LINT_RULES = """# Lint rules

`hsdsl lint` finds probable mistakes in legal models (warnings), and makes remarks (notes).
`hsdsl explain CODE` prints the page of a rule. How to choose rules and ignore findings is on
[a page of its own](../how-to/lint.md).

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
