"""Comments that ask to ignore findings: ``# hsdsl: ignore[HS401] why``, on the line or on the line above."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from hsdsl.errors import Diagnostic, Span
from hsdsl.lint.rules import RULES
from hsdsl.lint.subject import Subject
from hsdsl.names import did_you_mean, shown
from hsdsl.source import Mapping, Node, Place, Scalar, Text

UNUSED, UNKNOWN = "HS490", "HS491"
_COMMENT = re.compile(r"#\s*hsdsl\s*:\s*ignore\s*(?:\[([^\]\n]*)\])?[ \t]*([^\r\n]*)")


@dataclass(frozen=True)
class Ignored:
    """A finding that a comment asks to ignore, and the reason given there."""

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
    taken = None
    for number, line in enumerate(text.lines, start=1):
        for match in _COMMENT.finditer(line):
            taken = _scalars(root) if taken is None else taken
            if not _begins_comment(line, match.start()) or _inside(taken, number - 1, match.start()):
                continue
            about = _next_content(text.lines, number) if not line[: match.start()].strip() else number
            yield Comment(
                about, tuple(_codes(text, number, match)), _span(text, number, match), match[2].strip() or None
            )
            break


def _begins_comment(line: str, column: int) -> bool:
    return column == 0 or line[column - 1] in " \t"


def _scalars(root: Node) -> list[Place]:
    """The places of all scalars that may contain the sign of a comment: those in quotes, and blocks of text."""
    found: list[Place] = []
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Scalar):
            if "#" in node.value:
                found.append(node.place)
        elif isinstance(node, Mapping):
            waiting.extend(value for _, value in node)
        else:
            waiting.extend(node.items)
    return found


def _inside(places: list[Place], line: int, column: int) -> bool:
    return any(p.start[1:] <= (line, column) < p.end[1:] for p in places)


def _next_content(lines: Sequence[str], number: int) -> int:
    """The first line from ``number`` (counted from 0) on that is neither empty nor a comment, counted from 1."""
    for later in range(number, len(lines)):
        if lines[later].strip() and not lines[later].lstrip().startswith("#"):
            return later + 1
    return number


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
                known = "errors cannot be ignored" if re.fullmatch(r"HS[0-3]\d\d", code) else did_you_mean(code, RULES)
                yield _about(text, UNKNOWN, f"'{shown(code)}' is not the code of a lint rule", span, known)
            elif code in codes and (code, comment.line) not in used:
                message = f"there is no {code} to ignore on line {comment.line}"
                yield _about(text, UNUSED, message, span, "remove the code, or the comment")


def _about(text: Text, code: str, message: str, span: Span, hint: str | None) -> Diagnostic:
    return Diagnostic(code, message, span, hint, text.lines[span.line - 1], RULES[code].severity, "symbolic")


def _order(diagnostic: Diagnostic) -> tuple[int, int, str]:
    span = diagnostic.span
    return (span.line, span.column, diagnostic.code) if span else (0, 0, diagnostic.code)
