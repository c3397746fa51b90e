"""A SpaceEx configuration: which component, where it starts, and how long it runs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from hsdsl.base.errors import ModelError
from hsdsl.base.names import shown
from hsdsl.interface.imports.spaceex.formula import Relation, checked, relations
from hsdsl.language.source.nodes import Text, decode
from hsdsl.language.source.xml import Passage

_ENTRY = re.compile(r"[ \t]*([A-Za-z][\w-]*)[ \t]*=[ \t]*(\"[^\"]*\"|'[^']*'|[^#\n\"']*)[ \t]*(?:#[^\n]*)?(?:\n|$)")
_BLANK = re.compile(r"[ \t]*(?:#[^\n]*)?(?:\n|$)")
_AT = re.compile(r"\bloc\s*\(\s*([\w.]*)\s*\)\s*={1,2}\s*([A-Za-z_]\w*)\s*&*")
_QUALIFIED = re.compile(r"\b[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+")


@dataclass(frozen=True)
class Configuration:
    """The entries of a configuration that matter here.

    ``locations`` has (instance, location, place); ``values`` the relations of `initially` with dots in names written
    as ``__dot__``; ``others`` what is only named in comments.
    """

    system: Passage | None = None
    initially: Passage | None = None
    horizon: Passage | None = None
    locations: tuple[tuple[str, str, tuple[int, int]], ...] = ()
    values: tuple[Relation, ...] = ()
    others: dict[str, str] = field(default_factory=dict[str, str])


def configuration(path: str, data: bytes) -> Configuration:
    """Read a configuration.

    Raises ModelError: a line that is no entry, or an initial set that cannot be read.
    """
    file = decode(path, data)
    text = file.content.replace("\r\n", "\n")
    entries: dict[str, Passage] = {}
    at = 0
    while at < len(text):
        match = _BLANK.match(text, at) or _ENTRY.match(text, at)
        line = text.count("\n", 0, at) + 1
        if match is None:
            raise ModelError([file.fault("HS333", 'expected an entry such as system = "ball"', line, 1)])
        if match.re is _ENTRY:
            quoted = match[2][:1] in ("'", '"') and match[2]
            entries[match[1]] = _passage(file, text, match.start(2) + bool(quoted), match.end(2) - bool(quoted))
        at = match.end()
    return _meaning(entries)


def _passage(file: Text, text: str, start: int, end: int) -> Passage:
    """A part of the file: a piece a line."""
    starts: list[tuple[int, int, int]] = []
    for offset in (start, *(m.end() for m in re.finditer("\n", text[:end]) if m.end() > start)):
        line = text.count("\n", 0, offset) + 1
        starts.append((offset - start, line, offset - (text.rfind("\n", 0, offset) + 1) + 1))
    return Passage(file, text[start:end], tuple(starts))


def _meaning(entries: dict[str, Passage]) -> Configuration:
    used = ("system", "initially", "time-horizon")
    others = {key: shown(entry.text, None) for key, entry in entries.items() if key not in used}
    found = {key: entries.get(key) for key in used}
    initially = found["initially"]
    if initially is None:
        return Configuration(found["system"], None, found["time-horizon"], others=others)
    places = tuple((m[1], m[2], m.span()) for m in _AT.finditer(initially.text))
    bare = _AT.sub(lambda m: " " * len(m[0]), initially.text)
    bare = re.sub(r"&&?(?=\s*$)", lambda m: " " * len(m[0]), bare)
    bare = _QUALIFIED.sub(lambda m: m[0].replace(".", DOT), bare)
    values = tuple(map(checked, relations(Passage(initially.file, bare, initially.starts))))
    return Configuration(found["system"], initially, found["time-horizon"], places, values, others)


DOT = "__dot__"
