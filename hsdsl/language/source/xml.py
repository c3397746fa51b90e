"""Elements of an XML file with their places: no document type, hence no entities; depth and number are bounded."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple, NoReturn
from xml.parsers import expat

from hsdsl.base import limits
from hsdsl.base.errors import Diagnostic, ModelError, Span
from hsdsl.base.names import shown
from hsdsl.language.source.compose import decode
from hsdsl.language.source.nodes import Text

DEEPEST = 16
_DECLARED = re.compile(rb"""\s*<\?xml[^>]*encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_ENCODINGS = {"utf-8": "utf-8", "us-ascii": "utf-8", "ascii": "utf-8", "iso-8859-1": "latin-1", "latin1": "latin-1"}


class Passage(NamedTuple):
    """A text in a file: ``starts`` has (offset in the text, line, column) of each piece that is whole in the file."""

    file: Text
    text: str
    starts: tuple[tuple[int, int, int], ...]

    def span(self, start: int, end: int) -> Span:
        """The place of some characters of the text."""
        offset, line, column = max(s for s in self.starts if s[0] <= max(start, 0))
        return self.file.span(line, column + start - offset, max(1, end - start))

    def fault(
        self, code: str, message: str, hint: str | None = None, start: int = 0, end: int | None = None
    ) -> Diagnostic:
        """A diagnostic about some characters of the text, about all of them by default."""
        return self.file.diagnostic(code, message, self.span(start, len(self.text) if end is None else end), hint)

    def refusal(self, code: str, message: str, *place: Any) -> ModelError:
        """The error of one such diagnostic."""
        return ModelError([self.fault(code, message, *place)])


@dataclass
class Element:
    """An element: its attributes, the elements in it, and its text with the place of each piece."""

    file: Text
    tag: str
    attributes: dict[str, str]
    line: int
    column: int
    children: list[Element] = field(default_factory=list["Element"])
    pieces: list[tuple[str, int, int]] = field(default_factory=list[tuple[str, int, int]])

    @property
    def passage(self) -> Passage:
        """Its text; one without a text is where it begins."""
        starts: list[tuple[int, int, int]] = []
        offset = 0
        for text, line, column in self.pieces:
            starts.append((offset, line, column))
            offset += len(text)
        text = "".join(piece[0] for piece in self.pieces)
        return Passage(self.file, text, tuple(starts) or ((0, self.line, self.column),))

    def fault(self, code: str, message: str, hint: str | None = None) -> Diagnostic:
        """A diagnostic about the element."""
        return self.file.fault(code, message, self.line, self.column, hint, len(self.tag) + 1)

    def refusal(self, code: str, message: str, hint: str | None = None) -> ModelError:
        """The error of one such diagnostic."""
        return ModelError([self.fault(code, message, hint)])

    def within(self) -> Iterator[Element]:
        """The element and all in it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.within()

    def all(self, tag: str) -> list[Element]:
        return [child for child in self.children if child.tag == tag]

    def passage_of(self, tag: str) -> Passage | None:
        """The text of the one element in it with a tag; None where it has none.

        Raises ModelError: it has several.
        """
        found = self.all(tag)
        if len(found) > 1:
            raise found[1].refusal("HS331", f"a <{self.tag}> has one <{tag}> at most, this is its second")
        return found[0].passage if found else None

    def attribute(self, name: str) -> str:
        """An attribute that it must have.

        Raises ModelError: it does not.
        """
        if name not in self.attributes:
            raise self.refusal("HS331", f"this <{self.tag}> lacks the attribute '{name}'")
        return self.attributes[name]


def read_xml(path: str, data: bytes, deepest: int = DEEPEST) -> Element:
    """The root element of a file whose elements are nested at most ``deepest`` deep.

    Raises ModelError: no well-formed XML, a document type, too large or too deep.
    """
    declared = _DECLARED.match(data[:200])
    name = declared[1].decode().lower() if declared else "utf-8"
    if name not in _ENCODINGS:
        message = f"the encoding '{shown(name)}' is not read"
        raise ModelError([Diagnostic("HS331", message, Span(path, 1, 1), "save the file as UTF-8")])
    text = decode(path, data.decode("latin-1").encode() if _ENCODINGS[name] == "latin-1" else data)
    return _Reader(text, deepest).root()


class _Reader:
    def __init__(self, file: Text, deepest: int) -> None:
        self.file, self.deepest = file, deepest
        self.parser: Any = expat.ParserCreate("utf-8")
        self.open: list[Element] = []
        self.first: Element | None = None
        self.count = 0
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end
        self.parser.CharacterDataHandler = self.characters
        self.parser.StartDoctypeDeclHandler = self.document_type

    def root(self) -> Element:
        """Read all of it."""
        try:
            self.parser.Parse(self.file.content.encode(), True)
        except expat.ExpatError as error:
            sentence = f"this is not XML: {expat.ErrorString(error.code)}"
            raise ModelError([self.file.fault("HS331", sentence, error.lineno, error.offset + 1)]) from None
        assert self.first is not None
        return self.first

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        self.count += 1
        if self.count > limits.current().values:
            self.refuse(
                f"the file has more than {limits.current().values:,} elements", "allow more with --limit values="
            )
        if len(self.open) >= self.deepest:
            self.refuse(f"elements are nested more than {self.deepest} deep", None)
        element = Element(self.file, tag, attributes, *self.here)
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.first = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        """End the element that is open."""
        self.open.pop()

    def document_type(self, *_: object) -> NoReturn:
        """Refuse what could declare entities."""
        self.refuse("a document type has no place in a model", "remove <!DOCTYPE ...>")

    def characters(self, text: str) -> None:
        """Add text to the element that is open."""
        if self.open:
            self.open[-1].pieces.append((text, *self.here))

    @property
    def here(self) -> tuple[int, int]:
        return self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1

    def refuse(self, message: str, hint: str | None) -> NoReturn:
        """Raise an error about what is read now."""
        raise ModelError([self.file.fault("HS331", message, *self.here, hint)])
