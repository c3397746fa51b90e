"""Identifiers of a target language for the names of a model: ASCII, distinct, none of its reserved words."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterable

_GREEK = re.compile("GREEK (?:SMALL|CAPITAL) LETTER ([A-Z]+)")


def identifiers(names: Iterable[str], reserved: Collection[str] = ()) -> dict[str, str]:
    """An identifier for each name, in order; one that is taken or reserved gets underscores at its end."""
    taken: dict[str, str] = {}
    used = set(reserved)
    for name in dict.fromkeys(names):
        identifier = ascii_name(name)
        while identifier in used:
            identifier += "_"
        used.add(identifier)
        taken[name] = identifier
    return taken


def ascii_name(text: str) -> str:
    """An ASCII identifier that resembles a text: Greek letters by name, other signs as underscores."""
    letters = "".join(map(_letters, unicodedata.normalize("NFKD", text)))
    return letters if letters[:1].isalpha() else f"n{letters}"


def _letters(sign: str) -> str:
    if sign.isascii():
        return sign if sign.isalnum() else "_"
    if unicodedata.combining(sign):
        return ""
    greek = _GREEK.fullmatch(unicodedata.name(sign, ""))
    return greek.group(1).lower() if greek else "_"
