"""A model's bytes as text: decoded, capped, and free of characters that do not belong in it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from hsdsl.base import limits
from hsdsl.base.errors import Diagnostic, ModelError, Span
from hsdsl.base.names import INVISIBLE

_BREAK = re.compile("\r\n|\r|\n")
_ARCHIVE = b"PK\x03\x04"
_OTHER_ENCODINGS = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True, eq=False)
class Text:
    """A text with its lines, which makes places in it and diagnostics about them."""

    path: str
    content: str
    lines: list[str] = field(repr=False)

    @classmethod
    def of(cls, path: str, content: str) -> Text:
        """A text split into its lines."""
        return cls(path, content, _BREAK.split(content))

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
        """A diagnostic about so many characters at a 1-based line and column."""
        return self.diagnostic(code, message, self.span(line, column, length), hint)


def decode(path: str, data: bytes) -> Text:
    """The text of a model.

    Raises ModelError: when it is too large, not UTF-8, or has characters that no model may have.
    """
    most = limits.current().bytes
    if len(data) > most:
        hint = f"keep data in CSV files and name them in inputs, or allow more with --limit bytes={most * 10}"
        raise _refused(path, "HS003", f"the file is larger than {_size(most)}", hint)
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
    wrong = [_forbidden(text, match) for match in _first_of_each(content)]
    if wrong:
        raise ModelError(wrong)
    return text


def _size(count: int) -> str:
    return f"{count >> 20} MiB" if count % (1 << 20) == 0 else f"{count:,} bytes"


def _refused(path: str, code: str, message: str, hint: str) -> ModelError:
    return ModelError([Diagnostic(code, message, Span(path, 1, 1), hint)])


def _first_of_each(content: str) -> list[re.Match[str]]:
    first: dict[str, re.Match[str]] = {}
    for match in INVISIBLE.finditer(content):
        first.setdefault(match.group(), match)
    return list(first.values())


def _forbidden(text: Text, match: re.Match[str]) -> Diagnostic:
    before = _BREAK.split(text.content[: match.start()])
    span = text.span(len(before), len(before[-1]) + 1)
    return text.diagnostic(
        "HS002", f"the invisible character U+{ord(match.group()):04X} is not allowed in a model", span, "remove it"
    )
