"""Diagnostics as workflow commands, which GitHub shows as annotations beside the lines of a change."""

from __future__ import annotations

from hsdsl.errors import Diagnostic
from hsdsl.names import visible

_COMMAND = {"error": "error", "warning": "warning", "note": "notice"}
_IN_MESSAGE, _IN_PROPERTY = "%", "%:,"


def as_annotation(diagnostic: Diagnostic) -> str:
    """One line, such as ``::error file=m.yaml,line=3,endLine=3,col=7,endColumn=8,title=HS111::nothing is called q``."""
    span = diagnostic.span
    properties: dict[str, str | int] = {}
    if span:
        place = {"line": span.line, "endLine": span.line, "col": span.column, "endColumn": span.column + span.length}
        properties = {"file": span.path, **place}
    properties["title"] = diagnostic.code
    listed = ",".join(f"{key}={_escaped(str(value), _IN_PROPERTY)}" for key, value in properties.items())
    hint = f"\nhint: {diagnostic.hint}" if diagnostic.hint else ""
    return f"::{_COMMAND[diagnostic.severity]} {listed}::{_escaped(diagnostic.message + hint, _IN_MESSAGE)}"


def _escaped(text: str, signs: str) -> str:
    """Write as %XX what is a sign of a command, ends a line, steers a terminal or hides."""
    return "".join(_encoded(c) if c in signs or visible(c) != c else c for c in text)


def _encoded(character: str) -> str:
    return "".join(f"%{byte:02X}" for byte in character.encode("utf-8", "surrogatepass"))
