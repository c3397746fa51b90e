"""Insertions into the text of a model: entries behind the last one of a mapping or list, in the style of it."""

from __future__ import annotations

from hsdsl.language.source import Node, Text


class Insertions:
    """What is inserted into a text, by its places."""

    def __init__(self, text: Text) -> None:
        self._text = text
        self._insertions: dict[int, list[str]] = {}

    def result(self) -> str:
        """The text with all insertions, which are made from its end to its start."""
        content = self._text.content
        for index in sorted(self._insertions, reverse=True):
            content = content[:index] + "".join(self._insertions[index]) + content[index:]
        return content

    def append(self, node: Node, inline: str, block: str) -> None:
        """Add an entry behind the last one of a mapping or a list, in its style."""
        start, end = node.place.start[0], node.place.end[0]
        content = self._text.content
        if content[start] in "[{":
            before = "" if content[start + 1 : end - 1].strip() == "" else ", "
            self.insert(end - 1, before + inline)
            return
        column = node.place.start[2]
        last = _end_of_block(content[:end], column)
        line_end = content.find("\n", last)
        at = len(content) if line_end < 0 else line_end
        self.insert(at, "".join(f"\n{' ' * column}{line}" for line in block.splitlines()))

    def insert(self, index: int, text: str) -> None:
        """Insert at an index of the text."""
        self._insertions.setdefault(index, []).append(text)


def _end_of_block(content: str, column: int) -> int:
    """The end of the last line of a block: comments behind it that begin further left belong to what follows."""
    lines = content.rstrip().split("\n")
    while (last := lines[-1].lstrip()) == "" or (last[0] == "#" and len(lines[-1]) - len(last) < column):
        lines.pop()
    return len("\n".join(lines).rstrip())


def flow_style(fields: dict[str, str]) -> str:
    """A mapping inside braces."""
    return "{" + ", ".join(f"{key}: {_quoted(value)}" for key, value in fields.items()) + "}"


def _quoted(text: str) -> str:
    """A value inside brackets: in quotes where a comma or a bracket of its own would end it."""
    return f"'{text}'" if "," in text and text[0] not in "{[" else text
