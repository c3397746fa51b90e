"""Diagnostics for a program: plain data."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hsdsl.errors import Diagnostic


def as_json(diagnostics: Iterable[Diagnostic]) -> dict[str, list[dict[str, Any]]]:
    """The object that ``--json`` prints for a model with errors.

    Returns
    -------
    dict
        ``{"errors": [{"code", "path", "line", "column", "message", "hint"}]}``; what is not known is None.
    """
    return {"errors": [entry(diagnostic) for diagnostic in diagnostics]}


def entry(diagnostic: Diagnostic) -> dict[str, Any]:
    """One error as plain data, with the keys that every verb prints."""
    span = diagnostic.span
    return {
        "code": diagnostic.code,
        "path": span.path if span else None,
        "line": span.line if span else None,
        "column": span.column if span else None,
        "message": diagnostic.message,
        "hint": diagnostic.hint,
    }


def measured(diagnostic: Diagnostic) -> dict[str, Any]:
    """One error as plain data, with the length of its place too, which `validate` and `lint` print."""
    return {**entry(diagnostic), "length": diagnostic.span.length if diagnostic.span else None}


def finding(diagnostic: Diagnostic) -> dict[str, Any]:
    """One finding of a lint rule as plain data."""
    return {
        **measured(diagnostic),
        "severity": diagnostic.severity,
        "decided": diagnostic.decided,
        "fixable": bool(diagnostic.fix),
    }
