"""Offsets of the characters of a YAML scalar's value in the text that it was read from."""

from __future__ import annotations

_ESCAPE_LENGTHS = {"x": 2, "u": 4, "U": 8}


def positions(raw: str, length: int, value: str) -> list[int]:
    """The offset in ``raw`` of each character of ``value``, and of the end of the value.

    Exact for scalars on one line. In those that YAML folds, a blank has the place of the character before it.
    """
    if raw == value:
        return list(range(length + 1))
    if raw.startswith('"'):
        offsets = _double_quoted(raw)
    elif raw.startswith("'"):
        offsets = _single_quoted(raw)
    else:
        offsets = []
    if len(offsets) == length + 1:
        return offsets
    return _aligned(raw, value)


def _single_quoted(raw: str) -> list[int]:
    offsets: list[int] = []
    at = 1
    while at < len(raw) - 1:
        offsets.append(at)
        at += 2 if raw[at] == "'" else 1
    return [*offsets, len(raw) - 1]


def _double_quoted(raw: str) -> list[int]:
    offsets: list[int] = []
    at = 1
    while at < len(raw) - 1:
        offsets.append(at)
        at += 2 + _ESCAPE_LENGTHS.get(raw[at + 1], 0) if raw[at] == "\\" else 1
    return [*offsets, len(raw) - 1]


def _aligned(raw: str, value: str) -> list[int]:
    """Match the visible characters one after the other: folding changes blanks alone."""
    at = raw.find("\n") + 1 if raw[:1] in ("|", ">") else 0
    offsets: list[int] = []
    last = at
    for character in value:
        if not character.isspace():
            here = raw.find(character, at)
            if here >= 0:
                last, at = here, here + 1
        offsets.append(last)
    return [*offsets, min(last + 1, len(raw))]
