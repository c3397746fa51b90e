"""Diagnostics as a log in the Static Analysis Results Interchange Format, SARIF 2.1.0 (OASIS standard, 2020)."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from hsdsl.errors import Diagnostic, Edit, Span

SCHEMA = "https://json.schemastore.org/sarif-2.1.0-rtm.5.json"
VERSION = "2.1.0"


def as_sarif(
    diagnostics: Iterable[Diagnostic],
    ignored: Iterable[tuple[Diagnostic, str | None]],
    titles: Mapping[str, str],
    pages: Mapping[str, str],
    version: str,
) -> dict[str, Any]:
    """One log with one run.

    Parameters
    ----------
    diagnostics : iterable of Diagnostic
        What counts.
    ignored : iterable of (Diagnostic, str or None)
        What a comment in the file asks to ignore, with its reason: results with a suppression.
    titles, pages : mapping
        For every code a line about it, and its page in Markdown.
    version : str
        The version of this software.
    """
    results = [_result(diagnostic) for diagnostic in diagnostics]
    for diagnostic, reason in ignored:
        suppression = {"kind": "inSource", **({"justification": reason} if reason else {})}
        results.append({**_result(diagnostic), "suppressions": [suppression]})
    codes = sorted({result["ruleId"] for result in results})
    for result in results:
        result["ruleIndex"] = codes.index(result["ruleId"])
    rules = [_rule(code, titles[code], pages.get(code)) for code in codes]
    driver = {"name": "hsdsl", "version": version, "rules": rules}
    run = {"tool": {"driver": driver}, "columnKind": "unicodeCodePoints", "results": results}
    return {"$schema": SCHEMA, "version": VERSION, "runs": [run]}


def _rule(code: str, title: str, page: str | None) -> dict[str, Any]:
    rule: dict[str, Any] = {"id": code, "shortDescription": {"text": title}}
    if page:
        rule["help"] = {"text": page, "markdown": page}
    return rule


def _result(diagnostic: Diagnostic) -> dict[str, Any]:
    hint = f" Hint: {diagnostic.hint}." if diagnostic.hint else ""
    result: dict[str, Any] = {
        "ruleId": diagnostic.code,
        "level": diagnostic.severity,
        "message": {"text": f"{diagnostic.message}.{hint}"},
    }
    if diagnostic.span:
        result["locations"] = [{"physicalLocation": _location(diagnostic.span)}]
    if diagnostic.decided:
        result["properties"] = {"decided": diagnostic.decided}
    if diagnostic.fix and diagnostic.span:
        change = {
            "artifactLocation": {"uri": _uri(diagnostic.span.path)},
            "replacements": [*map(_edit, diagnostic.fix)],
        }
        result["fixes"] = [{"artifactChanges": [change]}]
    return result


def _location(span: Span) -> dict[str, Any]:
    region = {"startLine": span.line, "startColumn": span.column, "endColumn": span.column + span.length}
    return {"artifactLocation": {"uri": _uri(span.path)}, "region": region}


def _uri(path: str) -> str:
    """A path as a URI: relative ones stay relative, to be resolved by who reads the log."""
    if os.path.isabs(path):
        return Path(path).as_uri()
    return quote(os.fsencode(Path(path).as_posix()))


def _edit(edit: Edit) -> dict[str, Any]:
    region = {"charOffset": edit.start, "charLength": edit.end - edit.start}
    return {"deletedRegion": region, "insertedContent": {"text": edit.replacement}}
