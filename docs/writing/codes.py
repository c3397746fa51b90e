"""The pages of error codes and lint rules, from their Markdown files."""

from __future__ import annotations

from writing.markdown import lowered, table

from hsdsl import errors
from hsdsl.lint.pages import error_pages, rule_pages, titles
from hsdsl.lint.rules import FAMILIES, RULES, family

ERROR_CODES = """# Error codes

A code keeps its meaning for ever; a retired one is not used again. `hsdsl explain CODE` prints this text.
Examples may leave out the keys that every model has.

"""

LINT_RULES = """# Lint rules

`hsdsl lint` finds probable mistakes in legal models (warnings), and makes remarks (notes).
`hsdsl explain CODE` prints the page of a rule. How to choose rules and ignore findings is on
[a page of its own](../how-to/lint.md).

"""


def error_codes() -> str:
    """Document every code of an error."""
    rows = [(f"[`{code}`](#{code.lower()})", text) for code, text in sorted(errors.CODES.items())]
    parts = [f"## {code}\n\n{lowered(page)}\n\n" for code, page in error_pages().items()]
    return ERROR_CODES + table(("code", "about"), rows) + "".join(parts)


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
