"""Sentences that differ in numbers only, as one: how many there are, when, and between which numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence

_NUMBER = re.compile(r"(?<![\w.\-])-?\d+(?:,\d{3})*(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)")
_MARK = "\0"
_TIME = f"t = {_MARK}"
_WHEN = re.compile(f"(?:^|,? )(?:from {_TIME} (?:on|to {_TIME})|(?:at|close to) {_TIME})")
MOST_LISTED = 3  # of indices


def condensed(sentences: Sequence[str]) -> list[str]:
    """The same sentences, those that differ in numbers only as one."""
    groups: dict[str, list[str]] = {}
    for sentence in sentences:
        groups.setdefault(form(sentence), []).append(sentence)
    return [alike[0] if len(alike) == 1 else _joined(each, alike) for each, alike in groups.items()]


def form(sentence: str) -> str:
    """A sentence without its numbers: the same for all that are alike."""
    return _NUMBER.sub(_MARK, sentence)


def _joined(form: str, alike: Sequence[str]) -> str:
    """One sentence for several, with the times before it."""
    columns = list(zip(*map(_NUMBER.findall, alike), strict=True))
    place, times, kept = 0, list[str](), ""
    for piece in re.split(f"({_WHEN.pattern})", form):
        own = columns[place : place + piece.count(_MARK)]
        place += len(own)
        moves = any(len(set(column)) > 1 for column in own)
        if moves and _WHEN.fullmatch(piece):
            times += [text for column in own for text in column]
        else:
            kept += _filled(piece, own)
    when = f" between t = {_least(times)} and {_largest(times)}" if times else ""
    return f"{len(alike)} times{when}: {kept.strip()}"


def _filled(piece: str, columns: Sequence[Sequence[str]]) -> str:
    """A piece of a sentence with the span of each number."""
    first, *rest = piece.split(_MARK)
    texts = [_span(column, first if k == 0 else rest[k - 1]) for k, column in enumerate(columns)]
    return first + "".join(text + after for text, after in zip(texts, rest, strict=True))


def _span(column: Sequence[str], before: str) -> str:
    distinct = list(dict.fromkeys(column))
    if len(distinct) == 1:
        return distinct[0]
    if before.endswith("["):  # an index
        inner = sorted(distinct, key=_value)
        return ", ".join(inner) if len(inner) <= MOST_LISTED else f"{inner[0]}..{inner[-1]}"
    return f"{_least(distinct)} to {_largest(distinct)}"


def _least(texts: Sequence[str]) -> str:
    return min(texts, key=_value)


def _largest(texts: Sequence[str]) -> str:
    return max(texts, key=_value)


def _value(text: str) -> float:
    return float(text.replace(",", ""))
