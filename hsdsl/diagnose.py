"""Diagnostics for a person, as text with a caret, and for a program, as JSON."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from typing import Any

from hsdsl.errors import Diagnostic
from hsdsl.names import visible

_WIDEST = 120


def render(diagnostic: Diagnostic) -> str:
    """The text of one diagnostic.

    Parameters
    ----------
    diagnostic : Diagnostic
        What to say.

    Returns
    -------
    str
        ``path:line:column: error HS012: sentence``, the source line, a caret under the place, and the hint;
        without a line break at the end.
    """
    span = diagnostic.span
    where = f"{span.path}:{span.line}:{span.column}: " if span else ""
    lines = [f"{where}error {diagnostic.code}: {diagnostic.message}"]
    if span and diagnostic.text is not None:
        lines += _pointed(visible(diagnostic.text), span.column - 1, span.length)
    if diagnostic.hint:
        lines.append(f"  hint: {diagnostic.hint}")
    return "\n".join(lines)


def as_json(diagnostics: Iterable[Diagnostic]) -> dict[str, list[dict[str, Any]]]:
    """The object that ``--json`` prints for a model with errors.

    Returns
    -------
    dict
        ``{"errors": [{"code", "path", "line", "column", "message", "hint"}]}``; what is not known is None.
    """
    return {"errors": [_entry(diagnostic) for diagnostic in diagnostics]}


def _entry(diagnostic: Diagnostic) -> dict[str, Any]:
    span = diagnostic.span
    return {
        "code": diagnostic.code,
        "path": span.path if span else None,
        "line": span.line if span else None,
        "column": span.column if span else None,
        "message": diagnostic.message,
        "hint": diagnostic.hint,
    }


def _pointed(line: str, start: int, length: int) -> list[str]:
    """The source line, cut to a readable width around the place, and the line with the caret."""
    left = max(0, start - _WIDEST // 2) if len(line) > _WIDEST else 0
    cut = line[left : left + _WIDEST]
    prefix = "..." if left else ""
    before = "".join("\t" if c == "\t" else " " * _width(c) for c in cut[: start - left])
    carets = sum(map(_width, cut[start - left : start - left + length])) or 1
    return [f"  {prefix}{cut}".rstrip(), f"  {' ' * len(prefix)}{before}{'^' * carets}"]


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1
