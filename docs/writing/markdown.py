"""Markdown: tables, code, and text that is no markup."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Make a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    cells = ([" ".join(text.split()).replace("|", "\\|") for text in row] for row in lines)
    return "".join("| " + " | ".join(row) + " |\n" for row in cells) + "\n"


def code(text: str) -> str:
    """Set a text as code, with any marks in it."""
    text = text.strip()
    fence = "``" if "`" in text else "`"
    space = " " if text.startswith("`") or text.endswith("`") else ""
    return f"{fence}{space}{text}{space}{fence}"


def escaped(text: str) -> str:
    """Keep signs of a message from being marks of the page."""
    return re.sub(r"([\\*_<\[\]{}]|^`(?=``))", r"\\\1", text) if "`" not in text else parted(text)


def parted(text: str) -> str:
    """As :func:`escaped`, but for what is between backticks, which is code."""
    if text.count("`") % 2 or "``" in text:
        return re.sub(r"([\\*_<\[\]{}`])", r"\\\1", text)
    pieces = text.split("`")
    return "`".join(escaped(piece) if i % 2 == 0 else piece for i, piece in enumerate(pieces))


def lowered(page: str) -> str:
    """Make the headings of a page those of a part of another."""
    return page.replace("\n## ", "\n### ")
