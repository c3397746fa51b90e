"""Errors and findings as text with a caret, as plain data, as SARIF, and as annotations of GitHub."""

from __future__ import annotations

import os
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from hsdsl.base.errors import Diagnostic, Span
from hsdsl.base.names import visible

WIDEST = 120
DECIDED = {None: "", "symbolic": "", "interval": " (decided by intervals)", "sampled": " (decided by samples)"}
SARIF_SCHEMA = "https://json.schemastore.org/sarif-2.1.0-rtm.5.json"
COMMANDS = {"error": "error", "warning": "warning", "note": "notice"}  # of GitHub's workflows


def render(diagnostic: Diagnostic) -> str:
    """``path:line:column: error HS012: sentence``, the source line, a caret under the place, and the hint.

    A finding decided by bounds or samples is marked.
    """
    span = diagnostic.span
    where = f"{visible(span.path)}:{span.line}:{span.column}: " if span else ""
    decided = DECIDED[diagnostic.decided]
    lines = [f"{where}{diagnostic.severity} {diagnostic.code}: {visible(diagnostic.message)}{decided}"]
    if span and diagnostic.text is not None:
        lines += _pointed(visible(diagnostic.text), span.column - 1, span.length)
    if diagnostic.hint:
        lines.append(f"  hint: {visible(diagnostic.hint)}")
    return "\n".join(lines)


def _pointed(line: str, start: int, length: int) -> list[str]:
    """The source line, cut to a readable width around the place, and the line with the caret."""
    left = max(0, start - WIDEST // 2) if len(line) > WIDEST else 0
    cut = line[left : left + WIDEST]
    prefix = "..." if left else ""
    before = "".join("\t" if c == "\t" else " " * _width(c) for c in cut[: start - left])
    carets = sum(map(_width, cut[start - left : start - left + length])) or 1
    return [f"  {prefix}{cut}".rstrip(), f"  {' ' * len(prefix)}{before}{'^' * carets}"]


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def as_json(diagnostics: Iterable[Diagnostic]) -> dict[str, list[dict[str, Any]]]:
    """``{"errors": [{"code", "path", "line", "column", "message", "hint"}]}``, None for what is not known."""
    return {"errors": [_entry(diagnostic) for diagnostic in diagnostics]}


def _entry(diagnostic: Diagnostic) -> dict[str, Any]:
    span = diagnostic.span
    place = {"path": span.path, "line": span.line, "column": span.column} if span else {}
    place = {"path": None, "line": None, "column": None, **place}
    return {"code": diagnostic.code, **place, "message": diagnostic.message, "hint": diagnostic.hint}


def measured(diagnostic: Diagnostic) -> dict[str, Any]:
    """An error of `validate` and `lint` as plain data, with the length of its place."""
    return {**_entry(diagnostic), "length": diagnostic.span.length if diagnostic.span else None}


def finding(diagnostic: Diagnostic) -> dict[str, Any]:
    """A finding of a lint rule as plain data."""
    how = {"severity": diagnostic.severity, "decided": diagnostic.decided, "fixable": bool(diagnostic.fix)}
    return {**measured(diagnostic), **how}


def as_annotation(diagnostic: Diagnostic) -> str:
    """One line, such as ``::error file=m.yaml,line=3,endLine=3,col=7,endColumn=8,title=HS111::nothing is called q``."""
    span = diagnostic.span
    properties: dict[str, str | int] = {}
    if span:
        place = {"line": span.line, "endLine": span.line, "col": span.column, "endColumn": span.column + span.length}
        properties = {"file": span.path, **place}
    properties["title"] = diagnostic.code
    listed = ",".join(f"{key}={_escaped(str(value), '%:,')}" for key, value in properties.items())
    hint = f"\nhint: {diagnostic.hint}" if diagnostic.hint else ""
    return f"::{COMMANDS[diagnostic.severity]} {listed}::{_escaped(diagnostic.message + hint, '%')}"


def _escaped(text: str, signs: str) -> str:
    """Write as %XX what is a sign of a workflow command, ends a line, steers a terminal or hides."""
    return "".join(_encoded(c) if c in signs or visible(c) != c else c for c in text)


def _encoded(character: str) -> str:
    return "".join(f"%{byte:02X}" for byte in character.encode("utf-8", "surrogatepass"))


def as_sarif(
    diagnostics: Iterable[Diagnostic],
    ignored: Iterable[tuple[Diagnostic, str | None]],
    titles: Mapping[str, str],
    pages: Mapping[str, str],
    version: str,
) -> dict[str, Any]:
    """A log with one run, in the Static Analysis Results Interchange Format 2.1.0 (OASIS standard, 2020).

    Findings that a comment in the file ignores, with its reason, are results with a suppression. ``titles`` and
    ``pages`` have for every code a line about it, and its page in Markdown.
    """
    results = [_result(diagnostic) for diagnostic in diagnostics]
    for diagnostic, reason in ignored:
        suppression = {"kind": "inSource", **({"justification": reason} if reason else {})}
        results.append({**_result(diagnostic), "suppressions": [suppression]})
    codes = sorted({result["ruleId"] for result in results})
    for result in results:
        result["ruleIndex"] = codes.index(result["ruleId"])
    rules: list[dict[str, Any]] = [{"id": code, "shortDescription": {"text": titles[code]}} for code in codes]
    for rule in rules:
        if page := pages.get(rule["id"]):
            rule["help"] = {"text": page, "markdown": page}
    driver = {"name": "hsdsl", "version": version, "rules": rules}
    run = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}
    return {"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]}


def _result(diagnostic: Diagnostic) -> dict[str, Any]:
    hint = f" Hint: {diagnostic.hint}." if diagnostic.hint else ""
    message = {"text": f"{diagnostic.message}.{hint}"}
    result: dict[str, Any] = {"ruleId": diagnostic.code, "level": diagnostic.severity, "message": message}
    if diagnostic.span:
        span = diagnostic.span
        region = {"startLine": span.line, "startColumn": span.column, "endColumn": span.column + span.length}
        result["locations"] = [{"physicalLocation": {"artifactLocation": _artifact(span), "region": region}}]
    if diagnostic.decided:
        result["properties"] = {"decided": diagnostic.decided}
    if diagnostic.fix and diagnostic.span:
        edits = [
            {
                "deletedRegion": {"charOffset": edit.start, "charLength": edit.end - edit.start},
                "insertedContent": {"text": edit.replacement},
            }
            for edit in diagnostic.fix
        ]
        change = {"artifactLocation": _artifact(diagnostic.span), "replacements": edits}
        result["fixes"] = [{"artifactChanges": [change]}]
    return result


def _artifact(span: Span) -> dict[str, str]:
    """A path as a URI: relative ones stay relative, for the reader of the log to resolve."""
    path = Path(span.path)
    return {"uri": path.as_uri() if path.is_absolute() else quote(os.fsencode(path.as_posix()))}
