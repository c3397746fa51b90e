"""Diagnostics for a person: text with the line and a caret."""

from __future__ import annotations

import unicodedata

from hsdsl.errors import Diagnostic
from hsdsl.names import visible

_WIDEST = 120
_DECIDED = {None: "", "symbolic": "", "interval": " (decided by intervals)", "sampled": " (decided by samples)"}


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
        without a line break at the end. A finding that is known by bounds or from samples says so.
    """
    span = diagnostic.span
    where = f"{visible(span.path)}:{span.line}:{span.column}: " if span else ""
    decided = _DECIDED[diagnostic.decided]
    lines = [f"{where}{diagnostic.severity} {diagnostic.code}: {visible(diagnostic.message)}{decided}"]
    if span and diagnostic.text is not None:
        lines += _pointed(visible(diagnostic.text), span.column - 1, span.length)
    if diagnostic.hint:
        lines.append(f"  hint: {visible(diagnostic.hint)}")
    return "\n".join(lines)


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
