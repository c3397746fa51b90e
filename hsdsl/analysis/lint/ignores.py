"""Comments that ask to ignore findings: ``# hsdsl: ignore[HS401] why``, on the line or on the line above."""

from __future__ import annotations

import re
from bisect import bisect
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hsdsl.analysis.lint.rules import RULES
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.errors import Diagnostic, Span
from hsdsl.base.names import shown
from hsdsl.language.source import Node, Scalar, Text, children

UNUSED, UNKNOWN = "HS490", "HS491"
_LISTED = "codes are HS and three digits; every finding has its own"
_COMMENT = re.compile(r"#\s*hsdsl\s*:\s*ignore\s*(?:\[([^\]\n]*)\])?(?=[ \t]{0,9}(.{0,500}))")


@dataclass(frozen=True)
class Ignored:
    """A finding that a comment ignores, and the reason given there."""

    diagnostic: Diagnostic
    reason: str | None


@dataclass(frozen=True)
class Comment:
    """One such comment: the line that it is about, its codes with their places, and its reason."""

    line: int
    codes: tuple[tuple[str, Span], ...]
    span: Span
    reason: str | None


def sift(
    subject: Subject, found: Sequence[Diagnostic], codes: Sequence[str]
) -> tuple[tuple[Diagnostic, ...], tuple[Ignored, ...]]:
    """Part findings into those that count and those that comments ask to ignore, each in source order.

    What is wrong with the comments themselves counts, where its rules are among ``codes``.
    """
    text = subject.reading.text
    reasons: dict[tuple[str, int], str | None] = {}
    comments = tuple(comments_of(text, subject.root))
    for comment in comments:
        for code, _ in comment.codes:
            reasons[code, comment.line] = comment.reason
    kept: list[Diagnostic] = []
    ignored: list[Ignored] = []
    for diagnostic in found:
        where = (diagnostic.code, diagnostic.span.line if diagnostic.span else 0)
        if where in reasons:
            ignored.append(Ignored(diagnostic, reasons[where]))
        else:
            kept.append(diagnostic)
    used = {(i.diagnostic.code, i.diagnostic.span.line if i.diagnostic.span else 0) for i in ignored}
    kept += [d for d in _wrong(text, comments, used, codes) if d.code in codes]
    return tuple(sorted(kept, key=_order)), tuple(sorted(ignored, key=lambda i: _order(i.diagnostic)))


def comments_of(text: Text, root: Node) -> Iterator[Comment]:
    """The comments of a file that ask to ignore something."""
    found = [
        (number, match)
        for number, line in enumerate(text.lines, start=1)
        for match in _COMMENT.finditer(line)
        if _begins_comment(line, match.start())
    ]
    if not found:
        return
    taken, following = _scalars(root), _following(text.lines)
    for number, match in found:
        if not _inside(taken, number - 1, match.start()):
            alone = not text.lines[number - 1][: match.start()].strip()
            codes = tuple(_codes(text, number, match))
            about = following[number - 1] if alone else number
            yield Comment(about, codes, _span(text, number, match), match[2].strip() or None)


def _begins_comment(line: str, column: int) -> bool:
    return column == 0 or line[column - 1] in " \t"


def _scalars(root: Node) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Beginnings and ends, in order, of all scalars that contain the sign of a comment."""
    nodes = [root]
    for node in nodes:
        nodes += children(node)
    texts = (node for node in nodes if isinstance(node, Scalar) and "#" in node.value)
    return sorted({(node.place.start[1:], node.place.end[1:]) for node in texts})


def _inside(scalars: list[tuple[tuple[int, int], tuple[int, int]]], line: int, column: int) -> bool:
    before = bisect(scalars, (line, column), key=lambda ends: ends[0])
    return before > 0 and (line, column) < scalars[before - 1][1]


def _following(lines: Sequence[str]) -> list[int]:
    """For each line the number of the next one that is neither empty nor a comment; its own where there is none."""
    found = list(range(1, len(lines) + 1))
    following = None
    for index in reversed(range(len(lines))):
        found[index] = following or index + 1
        if lines[index].strip() and not lines[index].lstrip().startswith("#"):
            following = index + 1
    return found


def _codes(text: Text, number: int, match: re.Match[str]) -> Iterator[tuple[str, Span]]:
    for part in re.finditer(r"[^\s,]+", match[1] or ""):
        yield part.group(), text.span(number, match.start(1) + part.start() + 1, len(part.group()))


def _span(text: Text, number: int, match: re.Match[str]) -> Span:
    return text.span(number, match.start() + 1, match.end() - match.start())


def _wrong(
    text: Text, comments: Sequence[Comment], used: set[tuple[str, int]], codes: Sequence[str]
) -> Iterator[Diagnostic]:
    for comment in comments:
        if not comment.codes:
            message = "this comment does not say what to ignore"
            yield _about(text, UNKNOWN, message, comment.span, "write `# hsdsl: ignore[HS401]`, with the code")
        for code, span in comment.codes:
            if code not in RULES:
                hint = "errors cannot be ignored" if re.fullmatch(r"HS[0-3]\d\d", code) else _LISTED
                yield _about(text, UNKNOWN, f"'{shown(code)}' is not the code of a lint rule", span, hint)
            elif code in codes and (code, comment.line) not in used:
                message = f"there is no {code} to ignore on line {comment.line}"
                yield _about(text, UNUSED, message, span, "remove the code, or the comment")


def _about(text: Text, code: str, message: str, span: Span, hint: str | None) -> Diagnostic:
    return Diagnostic(code, message, span, hint, text.lines[span.line - 1], RULES[code].severity, "symbolic")


def _order(diagnostic: Diagnostic) -> tuple[int, int, str]:
    span = diagnostic.span
    return (span.line, span.column, diagnostic.code) if span else (0, 0, diagnostic.code)
