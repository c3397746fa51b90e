"""Which rules count, from the command line or a configuration file, and which findings comments ask to ignore.

Rules are named by code, by the beginning of codes, or by family. A comment is ``# hsdsl: ignore[HS401] why``, on the
line of the finding or on the line above.
"""

from __future__ import annotations

import os
import re
import tomllib
from bisect import bisect
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from hsdsl.analysis.lint.rules import FAMILIES, PLUG_INS, RULES, family
from hsdsl.analysis.lint.subject import Subject
from hsdsl.base.errors import Diagnostic, Span, UsageError
from hsdsl.base.names import did_you_mean, shown
from hsdsl.language.source import Node, Scalar, Text, children

OWN_FILE = "hsdsl.toml"
_KEYS = ("select", "ignore")

# A comment: the line that it is about, its codes with their places, its own place, and its reason.
Comment = tuple[int, list[tuple[str, Span]], Span, str | None]


def selected(select: Iterable[str] | None = None, ignore: Iterable[str] | None = None) -> tuple[str, ...]:
    """The codes of the rules that ``select`` names, of all when it is None, without those that ``ignore`` names.

    Raises UsageError: for a name that no rule has, and for a selection of nothing.
    """
    chosen = set(RULES) if select is None else codes_of(select, "select")
    if not chosen:
        raise UsageError("select: no rule is named", "leave it out to use all rules")
    dropped = set[str]() if ignore is None else codes_of(ignore, "ignore")
    return tuple(code for code in RULES if code in chosen - dropped)


def codes_of(names: Iterable[str], where: str) -> set[str]:
    """The codes that begin with one of some texts, or belong to the family or the rule of that name.

    Raises UsageError: for one that nothing answers to.
    """
    found: set[str] = set()
    for name in filter(None, (part.strip() for part in names)):
        answering = {code for code, rule in RULES.items() if _answers(code, rule.name, name)}
        if not answering:
            known = [*RULES, *FAMILIES, PLUG_INS, *(rule.name for rule in RULES.values())]
            hint = did_you_mean(name, known, "rules have codes such as HS401; the documentation lists them")
            raise UsageError(f"{where}: no lint rule is called '{name}'", hint)
        found |= answering
    return found


def _answers(code: str, rule: str, name: str) -> bool:
    return (len(name) > 1 and code.startswith(name)) or name in (rule, family(code))


def configured(path: str | os.PathLike[str]) -> dict[str, list[str]]:
    """The ``select`` and ``ignore`` that the configuration nearest to a model gives.

    It is the first ``hsdsl.toml`` (table ``lint``) or ``pyproject.toml`` with a table ``tool.hsdsl.lint``, from the
    model's folder upwards.

    Raises UsageError: the file cannot be read, or has something else in that table.
    """
    folder = Path(os.path.abspath(path)).parent
    for place in (folder, *folder.parents):
        for file, keys in ((place / OWN_FILE, ("lint",)), (place / "pyproject.toml", ("tool", "hsdsl", "lint"))):
            if file.is_file():
                try:
                    table: Any = tomllib.loads(file.read_text(encoding="utf-8"))
                except (OSError, ValueError) as error:
                    raise UsageError(f"{file}: {error}") from None
                for key in keys:
                    table = cast("dict[str, Any]", table).get(key) if isinstance(table, dict) else None
                if table is not None or file.name == OWN_FILE:
                    return _checked(file, table or {})
    return {}


def _checked(file: Path, table: Any) -> dict[str, list[str]]:
    if not isinstance(table, dict):
        raise UsageError(f"{file}: the lint configuration is a table with `select` and `ignore`")
    for key, value in cast("dict[str, Any]", table).items():
        if key not in _KEYS:
            raise UsageError(f"{file}: lint has no setting '{key}'", did_you_mean(key, _KEYS))
        texts = cast("list[Any]", value) if isinstance(value, list) else [None]
        if not all(isinstance(text, str) for text in texts):
            raise UsageError(f"{file}: `{key}` is a list of texts", f'such as {key} = ["HS401"]')
    return cast("dict[str, list[str]]", table)


UNUSED, UNKNOWN = "HS490", "HS491"
_LISTED = "every finding has its code: HS and three digits, or that of a plug-in"
_COMMENT = re.compile(r"(?<![^ \t])#\s*hsdsl\s*:\s*ignore\s*(?:\[([^\]\n]*)\])?(?=[ \t]{0,9}(.{0,500}))")


class Ignored(NamedTuple):
    """A finding that a comment ignores, and the reason given there."""

    diagnostic: Diagnostic
    reason: str | None


def sift(
    subject: Subject, found: Sequence[Diagnostic], codes: Sequence[str]
) -> tuple[tuple[Diagnostic, ...], tuple[Ignored, ...]]:
    """Part findings into those that count and those that comments ask to ignore, each in source order.

    What is wrong with the comments themselves counts, where its rules are among ``codes``.
    """
    text = subject.reading.text
    comments = list(comments_of(text, subject.root))
    reasons = {(code, line): reason for line, named, _, reason in comments for code, _ in named}
    kept = [each for each in found if _where(each) not in reasons]
    ignored = [Ignored(each, reasons[_where(each)]) for each in found if _where(each) in reasons]
    used = {_where(each.diagnostic) for each in ignored}
    kept += [each for each in _wrong(text, comments, used, codes) if each.code in codes]
    return tuple(sorted(kept, key=_order)), tuple(sorted(ignored, key=lambda each: _order(each.diagnostic)))


def comments_of(text: Text, root: Node) -> Iterator[Comment]:
    """The comments of a file that ask to ignore something."""
    found = [(number, match) for number, line in enumerate(text.lines, start=1) for match in _COMMENT.finditer(line)]
    if not found:
        return
    nodes = [root]
    for node in nodes:
        nodes += children(node)
    texts = (node.place for node in nodes if isinstance(node, Scalar) and "#" in node.value)
    taken, following = sorted({(place.start[1:], place.end[1:]) for place in texts}), _following(text.lines)
    for number, match in found:
        place = number - 1, match.start()
        before = bisect(taken, place, key=lambda ends: ends[0])
        if before and place < taken[before - 1][1]:
            continue  # it is in a text
        alone = not text.lines[number - 1][: match.start()].strip()
        named = [
            (part.group(), text.span(number, match.start(1) + part.start() + 1, len(part.group())))
            for part in re.finditer(r"[^\s,]+", match[1] or "")
        ]
        span = text.span(number, match.start() + 1, match.end() - match.start())
        yield following[number - 1] if alone else number, named, span, match[2].strip() or None


def _following(lines: Sequence[str]) -> list[int]:
    """For each line the number of the next one that is neither empty nor a comment; its own where there is none."""
    found = list(range(1, len(lines) + 1))
    following = None
    for index in reversed(range(len(lines))):
        found[index] = following or index + 1
        if lines[index].strip() and not lines[index].lstrip().startswith("#"):
            following = index + 1
    return found


def _wrong(
    text: Text, comments: Sequence[Comment], used: set[tuple[str, int]], codes: Sequence[str]
) -> Iterator[Diagnostic]:
    for line, named, place, _ in comments:
        if not named:
            message = "this comment does not say what to ignore"
            yield _about(text, UNKNOWN, message, place, "write `# hsdsl: ignore[HS401]`, with the code")
        for code, span in named:
            if code not in RULES:
                hint = "errors cannot be ignored" if re.fullmatch(r"HS[0-3]\d\d", code) else _LISTED
                yield _about(text, UNKNOWN, f"'{shown(code)}' is not the code of a lint rule", span, hint)
            elif code in codes and (code, line) not in used:
                message = f"there is no {code} to ignore on line {line}"
                yield _about(text, UNUSED, message, span, "remove the code, or the comment")


def _about(text: Text, code: str, message: str, span: Span, hint: str | None) -> Diagnostic:
    return Diagnostic(code, message, span, hint, text.lines[span.line - 1], RULES[code].severity, "symbolic")


def _where(diagnostic: Diagnostic) -> tuple[str, int]:
    return diagnostic.code, diagnostic.span.line if diagnostic.span else 0


def _order(diagnostic: Diagnostic) -> tuple[int, int, str]:
    span = diagnostic.span
    return (span.line, span.column, diagnostic.code) if span else (0, 0, diagnostic.code)
