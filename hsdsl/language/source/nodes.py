"""A text with its lines, and the nodes of a YAML document in it: every value and every key knows its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from hsdsl.base.errors import Diagnostic, Span

BREAK = re.compile("\r\n|\r|\n")
DEEPEST = 64  # mappings and lists in each other
TOO_DEEP = f"mappings and lists are nested more than {DEEPEST} deep here"


@dataclass(frozen=True, eq=False)
class Text:
    """A text with its lines, which makes places in it and diagnostics about them."""

    path: str
    content: str
    lines: list[str] = field(repr=False)

    @classmethod
    def of(cls, path: str, content: str) -> Text:
        """A text split into its lines."""
        return cls(path, content, BREAK.split(content))

    def span(self, line: int, column: int, length: int = 1) -> Span:
        """The place at a 1-based line and column, kept inside the text and on one line."""
        line = min(max(line, 1), len(self.lines))
        width = len(self.lines[line - 1])
        column = min(max(column, 1), width + 1)
        return Span(self.path, line, column, max(1, min(length, width + 1 - column)))

    def diagnostic(self, code: str, message: str, span: Span, hint: str | None = None) -> Diagnostic:
        """A diagnostic about a place in this text, with the line it is on."""
        return Diagnostic(code, message, span, hint, self.lines[span.line - 1])

    def fault(
        self, code: str, message: str, line: int, column: int, hint: str | None = None, length: int = 1
    ) -> Diagnostic:
        """A diagnostic about ``length`` characters at a 1-based line and column."""
        return self.diagnostic(code, message, self.span(line, column, length), hint)


def positions(raw: str, length: int, value: str) -> list[int]:
    """The offset in ``raw`` of each character of ``value``, and of the end of the value.

    Exact for scalars on one line. In those that YAML folds, a blank has the place of the character before it.
    """
    if raw == value:
        return list(range(length + 1))
    offsets: list[int] = []
    if raw[:1] in ("'", '"'):
        at = 1
        while at < len(raw) - 1:
            offsets.append(at)
            if raw[0] == '"' and raw[at] == "\\":
                at += 2 + {"x": 2, "u": 4, "U": 8}.get(raw[at + 1], 0)
            else:
                at += 2 if raw[0] == raw[at] == "'" else 1
        offsets.append(len(raw) - 1)
    return offsets if len(offsets) == length + 1 else _aligned(raw, value)


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


Kind = Literal["null", "boolean", "number", "text"]

# The core schema of YAML 1.2, section 10.3.2.
_NULL = ("", "~", "null", "Null", "NULL")
_BOOLEAN = ("true", "True", "TRUE", "false", "False", "FALSE")
_NUMBER = re.compile(
    r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+|[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN"
)


@dataclass(frozen=True)
class SourceRange:
    """The range of a node in its text: 0-based index, line and column of its first character and after its last."""

    text: Text = field(repr=False)
    start: tuple[int, int, int]
    end: tuple[int, int, int]

    @property
    def span(self) -> Span:
        """The node's first line."""
        (first, line, column), (last, end_line, _) = self.start, self.end
        length = last - first if line == end_line else len(self.text.lines[line]) - column
        return self.text.span(line + 1, column + 1, length)

    def diagnostic(self, code: str, message: str, hint: str | None = None) -> Diagnostic:
        """A diagnostic about the node."""
        return self.text.diagnostic(code, message, self.span, hint)


@dataclass(frozen=True, eq=False)
class Scalar:
    """A single value as written: nothing is ever rounded."""

    value: str
    plain: bool
    place: SourceRange

    @property
    def kind(self) -> Kind:
        """What YAML 1.2 takes the value for; in quotes it is text."""
        if not self.plain:
            return "text"
        if self.value in _NULL:
            return "null"
        if self.value in _BOOLEAN:
            return "boolean"
        return "number" if _NUMBER.fullmatch(self.value) else "text"

    def span(self, start: int, end: int) -> Span:
        """The place of the characters ``start`` to ``end`` of the value."""
        first, last = self.place.start[0], self.place.end[0]
        where = positions(self.place.text.content[first:last], len(self.value), self.value)
        begin = first + where[min(start, len(where) - 1)]
        finish = first + where[min(max(end - 1, start), len(where) - 1)] + 1
        first, line, column = self.place.start
        before = BREAK.split(self.place.text.content[first:begin])
        column = len(before[-1]) + (column if len(before) == 1 else 0)
        return self.place.text.span(line + len(before), column + 1, finish - begin)


@dataclass(frozen=True, eq=False)
class Sequence:
    """A list."""

    items: tuple[Node, ...]
    place: SourceRange


class Key(str):
    """A key of a mapping: a text that knows its place."""

    __slots__ = ("place",)
    place: SourceRange

    @classmethod
    def at(cls, text: str, place: SourceRange) -> Key:
        key = cls(text)
        key.place = place
        return key

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        """Pickle the text: its place is of use only where the file is read."""
        return str, (str(self),)


@dataclass(frozen=True, eq=False)
class Mapping:
    """A mapping, in file order."""

    entries: dict[str, tuple[Key, Node]]
    place: SourceRange

    def __iter__(self) -> Iterator[tuple[Key, Node]]:
        return iter(self.entries.values())

    def rename(self, key: str, name: str, value: Node | None = None) -> None:
        """Give an entry another name, and another value if there is one, in its place."""
        entries = list(self.entries.items())
        self.entries.clear()
        for old, (kept, node) in entries:
            renamed = (Key.at(name, kept.place), node if value is None else value)
            self.entries[name if old == key else old] = renamed if old == key else (kept, node)


Node = Scalar | Sequence | Mapping
NodePath = tuple[int | str, ...]  # keys and indices from the root to a node
ABSENT = "\0"  # the value of a scalar in place of one already reported; no text can contain it, written or escaped


def absent(place: SourceRange) -> Scalar:
    """A scalar in the place of something already reported; nothing more is reported of it."""
    return Scalar(ABSENT, False, place)


def is_empty(value: object) -> bool:
    """Whether a value is left out, or null."""
    return isinstance(value, Scalar) and value.kind == "null"


def is_bare(value: Node) -> bool:
    """Whether a value is left out: in braces also that of a key that YAML makes of a part of a value."""
    return isinstance(value, Scalar) and value.plain and value.value == ""


def child(node: Node | None, key: str) -> Node | None:
    """The value of a key, where there is one."""
    return node.entries[key][1] if isinstance(node, Mapping) and key in node.entries else None


def children(node: Node | None) -> Iterator[Node]:
    """The values of a mapping, the items of a list."""
    if isinstance(node, Mapping):
        yield from (value for _, value in node)
    elif isinstance(node, Sequence):
        yield from node.items


def keys(node: Node | None) -> list[Key]:
    """The keys of a mapping; none of anything else."""
    return [key for key, _ in node] if isinstance(node, Mapping) else []


def descend(root: Node, path: NodePath) -> Node | None:
    """The node at the end of a path, if there is one."""
    node: Node | None = root
    for step in path:
        if isinstance(node, Mapping) and step in node.entries:
            node = node.entries[str(step)][1]
        elif isinstance(node, Sequence) and isinstance(step, int) and step < len(node.items):
            node = node.items[step]
        elif not (step == 0 and isinstance(node, Mapping)):  # a single reference is a list of one
            return None
    return node
