"""Bytes to text, and YAML events to nodes.

PyYAML's parser gives the events; its own composer and constructors are not used, for they round numbers, follow
YAML 1.1 (`on` is true, `010` is eight), lose places and recurse before anything is counted.
"""

from __future__ import annotations

import re
from typing import Any

import yaml

from hsdsl.base import limits
from hsdsl.base.errors import Diagnostic, ModelError, Span
from hsdsl.base.names import INVISIBLE, is_identifier, normalised, shown
from hsdsl.language.files import DataRefused, ModelFiles
from hsdsl.language.source.nodes import (
    BREAK,
    DEEPEST,
    TOO_DEEP,
    Key,
    Mapping,
    Node,
    Scalar,
    Sequence,
    SourceRange,
    Text,
    absent,
    child,
    is_bare,
)

_Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_ARCHIVE = b"PK\x03\x04"
_OTHER_ENCODINGS = (b"\xff\xfe", b"\xfe\xff")
_ABOUT = ("hsdsl", "title", "source")  # keys that a file may have and that say nothing about its automaton


class Unread(Exception):
    """A document is not as it should be: `hsdsl.language.diagnosis` reads it again, and says what is wrong."""


def compose(files: ModelFiles, faults: Any = None) -> tuple[Text, Node, dict[str, bytes]]:
    """The text of a model, its root node, with automata of files in their places, and the bytes of these files.

    Raises Unread: at the first fault, unless ``faults`` takes it.
    Raises ModelError: a file is too large or is no text.
    """
    text, data = decode(files.path, files.text), dict[str, bytes]()
    composer = Composer(text, faults)
    root = composer.document()
    automata = child(root, "automata")
    for key, entry in list(automata) if isinstance(automata, Mapping) else ():
        name = child(entry, "file")
        if not isinstance(name, Scalar) or not isinstance(entry, Mapping) or len(entry.entries) > 1:
            continue
        try:
            content = data.setdefault(name.value, files.content(name.value))
        except DataRefused as refusal:
            composer.faults.report(name.place.diagnostic(refusal.code, refusal.message, refusal.hint))
            continue
        inner = Composer(decode(str(files.folder / name.value), content), faults).document()
        if isinstance(inner, Mapping):
            for about in _ABOUT:
                inner.entries.pop(about, None)
        assert isinstance(automata, Mapping)
        automata.entries[str(key)] = (key, inner)
    return text, root, data


def _is_strange(entry: tuple[Node, Node]) -> bool:
    """Whether an entry in braces has no value, and no name for a key."""
    key, value = entry
    return is_bare(value) and not (isinstance(key, Scalar) and is_identifier(key.value))


def _is_cut(item: Node) -> bool:
    """Whether YAML ended an item inside its parentheses."""
    return isinstance(item, Scalar) and item.plain and item.value.count("(") > item.value.count(")")


def decode(path: str, data: bytes) -> Text:
    """The text of a model.

    Raises ModelError: when it is too large, not UTF-8, or has characters that no model may have.
    """
    most = limits.current().bytes
    if len(data) > most:
        size = f"{most >> 20} MiB" if most % (1 << 20) == 0 else f"{most:,} bytes"
        hint = f"keep data in CSV files and name them in inputs, or allow more with --limit bytes={most * 10}"
        raise _refused(path, "HS003", f"the file is larger than {size}", hint)
    data = data.removeprefix(b"\xef\xbb\xbf")
    if data.startswith(_ARCHIVE):
        hint = "a saved run (.npz) is read with hsdsl.store.load"
        raise _refused(path, "HS001", "the file is an archive, not the text of a model", hint)
    if data.startswith(_OTHER_ENCODINGS):
        raise _refused(path, "HS001", "the file is UTF-16 text, not UTF-8", "save it as UTF-8")
    try:
        content = data.decode("utf-8")
    except UnicodeDecodeError as error:
        before = Text.of(path, data[: error.start].decode("utf-8"))
        span = Span(path, len(before.lines), len(before.lines[-1]) + 1)
        message = f"the byte 0x{data[error.start]:02x} here is not UTF-8 text"
        raise ModelError([Diagnostic("HS001", message, span, "save the file as UTF-8", before.lines[-1])]) from None
    text = Text.of(path, content)
    first: dict[str, int] = {}
    for match in re.finditer(INVISIBLE, content):
        first.setdefault(match.group(), match.start())
    wrong: list[Diagnostic] = []
    for sign, start in first.items():
        before = BREAK.split(content[:start])
        message = f"the invisible character U+{ord(sign):04X} is not allowed in a model"
        wrong.append(text.fault("HS002", message, len(before), len(before[-1]) + 1, "remove it"))
    if wrong:
        raise ModelError(wrong)
    return text


def _refused(path: str, code: str, message: str, hint: str) -> ModelError:
    return ModelError([Diagnostic(code, message, Span(path, 1, 1), hint)])


class Composer:
    """One reading of one stream of events; it raises `Unread` at the first fault, unless ``faults`` takes it."""

    def __init__(self, text: Text, faults: Any = None) -> None:
        self.text = text
        self._faults = faults
        self.parser = _Parser(text.content)
        self.depth = 0
        self.count = 0
        self.limits = limits.current()
        self.anchors: dict[str, tuple[Node | None, int, int]] = {}  # node (None while open), nodes, height
        self.unused: dict[str, Any] = {}

    @property
    def faults(self) -> Any:
        """What takes faults, where it can go on after them."""
        if self._faults is None:
            raise Unread
        return self._faults

    def document(self) -> Node:
        """The only document of the stream."""
        try:
            return self._document()
        except yaml.MarkedYAMLError as error:
            self.faults.unparsed(self.text, error)
            raise
        finally:
            self.parser.dispose()

    def _document(self) -> Node:
        self.parser.get_event()
        if self.parser.check_event(yaml.StreamEndEvent):
            span = Span(self.text.path, 1, 1)
            self.faults.stop(self.text.diagnostic("HS011", "the file is empty", span, "a model begins with 'hsdsl: 1'"))
        self.parser.get_event()
        root, _, _ = self.node()
        self.parser.get_event()
        if not self.parser.check_event(yaml.StreamEndEvent):
            place = self._place(self.parser.peek_event())
            self.faults.stop(place.diagnostic("HS010", "a second document begins here", "a file holds one model"))
        for name, event in self.unused.items():
            message = f"`&{name}` is an anchor in YAML, and nothing refers to it"
            self.faults.report(self._place(event).diagnostic("HS007", message, "quote this expression"))
        return root

    def node(self) -> tuple[Node, int, int]:
        """The next node, how many nodes it has with aliases expanded, and its height."""
        event = self.parser.get_event()
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event)
        anchor = event.anchor
        if anchor is not None:
            self.anchors[anchor] = (None, 0, 0)
        if event.tag is not None:
            message = f"`{shown(event.tag)}` is a tag in YAML, and models have no tags"
            hint = "quote this expression; a condition is negated with `not`"
            self.faults.report(self._place(event).diagnostic("HS009", message, hint))
        self._grow(event, 1, 1)
        if isinstance(event, yaml.ScalarEvent):
            measured: tuple[Node, int, int] = (self._scalar(event), 1, 1)
            if anchor is not None and measured[0].plain:  # pyright: ignore[reportAttributeAccessIssue]
                self.unused[anchor] = event
        else:
            self.depth += 1
            measured = self._sequence(event) if isinstance(event, yaml.SequenceStartEvent) else self._mapping(event)
            self.depth -= 1
        if anchor is not None:
            self.anchors[anchor] = measured
        return measured

    def _scalar(self, event: Any) -> Scalar:
        if event.tag is not None:
            return absent(self._place(event))
        hidden = re.search(INVISIBLE, event.value)
        if hidden:
            message = f"this escape is the invisible character U+{ord(hidden.group()):04X}"
            self.faults.report(self._place(event).diagnostic("HS002", message, "remove it"))
            return Scalar(re.sub(INVISIBLE, "", event.value), False, self._place(event))
        return Scalar(event.value, event.style is None or event.style == "", self._place(event))

    def _sequence(self, event: Any) -> tuple[Node, int, int]:
        items: list[Node] = []
        nodes, height = 1, 0
        while not self.parser.check_event(yaml.SequenceEndEvent):
            item, more, tall = self.node()
            items.append(item)
            nodes, height = nodes + more, max(height, tall)
        place = self._place(event, self.parser.get_event())
        if event.flow_style and any(map(_is_cut, items)):
            items = self.faults.rejoined_items(items)
        return Sequence(tuple(items), place), nodes, height + 1

    def _mapping(self, event: Any) -> tuple[Node, int, int]:
        entries: list[tuple[Node, Node]] = []
        nodes, height = 1, 0
        while not self.parser.check_event(yaml.MappingEndEvent):
            key, more_keys, _ = self.node()
            value, more, tall = self.node()
            entries.append((key, value))
            if len(entries) > self.limits.modes:
                message = f"a mapping has at most {self.limits.modes:,} entries, and here one has more"
                hint = f"allow more with --limit modes={self.limits.modes * 10}"
                self.faults.stop(key.place.diagnostic("HS016", message, hint))
            nodes, height = nodes + more_keys + more, max(height, tall)
        place = self._place(event, self.parser.get_event())
        if event.flow_style and any(map(_is_strange, entries)):
            entries = self.faults.rejoined_entries(entries)
        return Mapping(self._unique(entries), place), nodes, height + 1

    def _unique(self, entries: list[tuple[Node, Node]]) -> dict[str, tuple[Key, Node]]:
        unique: dict[str, tuple[Key, Node]] = {}
        for node, value in entries:
            if not isinstance(node, Scalar) or node.kind == "null":
                self.faults.report(node.place.diagnostic("HS013", "a key must be a word", "quote it if it is one"))
                continue
            if node.plain and (node.value[:1].isspace() or "{" in node.value):
                self.faults.strange_key(node)
            key = Key.at(normalised(node.value), node.place)
            if key in unique:
                line = unique[key][0].place.span.line
                message = f"the key '{shown(key)}' is repeated; line {line} has the first one"
                self.faults.report(node.place.diagnostic("HS008", message, "keep one of them"))
                continue
            unique[str(key)] = (key, value)
        return unique

    def _alias(self, event: Any) -> tuple[Node, int, int]:
        name = event.anchor
        place = self._place(event)
        if name not in self.anchors:
            self.faults.no_anchor(name, place)
        node, nodes, height = self.anchors[name]
        self.unused.pop(name, None)
        if node is None:
            self.faults.stop(place.diagnostic("HS012", f"`*{name}` is inside the value that it repeats"))
        assert node is not None
        self._grow(event, nodes, height)
        return node, nodes, height

    def _grow(self, event: Any, nodes: int, height: int) -> None:
        self.count += nodes
        if self.count > self.limits.values:
            message = f"the file has more than {self.limits.values:,} values once its aliases are expanded"
            hint = f"keep data in CSV files, or allow more with --limit values={self.limits.values * 10}"
            self.faults.stop(self._place(event).diagnostic("HS015", message, hint))
        if self.depth + height > DEEPEST:
            self.faults.stop(self._place(event).diagnostic("HS014", TOO_DEEP))

    def _place(self, event: Any, last: Any = None) -> SourceRange:
        start, end = event.start_mark, (last or event).end_mark
        return SourceRange(self.text, (start.index, start.line, start.column), (end.index, end.line, end.column))
