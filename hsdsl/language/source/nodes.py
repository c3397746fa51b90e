"""The nodes of a YAML document: every value and every key knows its place."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from hsdsl.base.errors import Diagnostic, Span
from hsdsl.language.source.offsets import positions
from hsdsl.language.source.text import Text

Kind = Literal["null", "boolean", "number", "text"]

# The core schema of YAML 1.2, section 10.3.2.
_NULL = ("", "~", "null", "Null", "NULL")
_BOOLEAN = ("true", "True", "TRUE", "false", "False", "FALSE")
_NUMBER = re.compile(
    r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+|[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
    r"|[-+]?(\.inf|\.Inf|\.INF)|\.nan|\.NaN|\.NAN"
)


@dataclass(frozen=True, eq=False)
class SourceRange:
    """The range of a node in its text: 0-based index, line and column of its first character and behind its last."""

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
    """A single value, kept as it is written: nothing is ever rounded."""

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
        line, column = self._line_and_column(begin)
        return self.place.text.span(line, column, finish - begin)

    def _line_and_column(self, index: int) -> tuple[int, int]:
        first, line, column = self.place.start
        before = Text.of("", self.place.text.content[first:index]).lines
        if len(before) == 1:
            return line + 1, column + 1 + len(before[0])
        return line + len(before), 1 + len(before[-1])


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
        """A key with its place."""
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
