"""Text of a model as LaTeX: every sign that has a meaning there is escaped, and what fonts may lack is spelled out."""

from __future__ import annotations

import unicodedata

from hsdsl.base.names import visible

_SIGNS = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\(<\)",
    ">": r"\(>\)",
    "|": r"\(|\)",
    '"': "''",
    "°": r"\(^\circ\)",
    "·": r"\(\cdot\)",
    "×": r"\(\times\)",
    "²": r"\(^2\)",
    "³": r"\(^3\)",
    "–": "--",
    "—": "---",
    "ß": r"\ss{}",
    "ø": r"\o{}",
    "Ø": r"\O{}",
    "æ": r"\ae{}",
    "Æ": r"\AE{}",
    "ł": r"\l{}",
    "Ł": r"\L{}",
    "’": "'",
    "‘": "`",
    "“": "``",
    "”": "''",
    **{sign: f"\\{sign}" for sign in "#$%&_{}"},
}
_ACCENTS = {"\u0300": "`", "\u0301": "'", "\u0302": "^", "\u0303": "~", "\u0308": '"', "\u030a": "r", "\u030c": "v"}
_ACCENTS["\u0327"] = "c"
_LETTERS = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi"
_CAPITALS = "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
GREEK = frozenset(f"{_LETTERS} psi omega {_CAPITALS}".split())  # that LaTeX has commands for


def escaped(text: str) -> str:
    """A text in one line that LaTeX prints as it is."""
    return "".join(map(_sign, unicodedata.normalize("NFC", visible(text))))


def _sign(sign: str) -> str:
    if sign in _SIGNS:
        return _SIGNS[sign]
    if sign.isascii():
        return sign
    greek = greek_name(sign)
    if greek in GREEK:
        return rf"\(\{greek}\)"
    base, *marks = unicodedata.normalize("NFD", sign)
    if base.isascii() and base.isalpha() and len(marks) == 1 and marks[0] in _ACCENTS:
        letter = {"i": r"\i", "j": r"\j"}.get(base, base)
        return rf"\{_ACCENTS[marks[0]]}{{{letter}}}"
    return f"[U+{ord(sign):04X}]"


def greek_name(sign: str) -> str:
    """The name of a Greek letter, capital ones with a capital; empty for another sign."""
    name = unicodedata.name(sign, "")
    kind, _, letter = name.partition(" LETTER ")
    known = {"LAMDA": "lambda"}.get(letter, letter.lower())
    return {"GREEK SMALL": known, "GREEK CAPITAL": known.capitalize()}.get(kind, "")
