"""Comments, strings and arrays of MATLAB."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hsdsl.base.names import visible
from hsdsl.export.matlab.language import literal

_WIDTH = 100


def comment(lines: Iterable[str]) -> str:
    """Comments; none of them is a brace alone, which would begin a block."""
    return "".join(f"% {line}\n" for line in lines)


def string(text: str) -> str:
    """A text between single quotes, in which only the quote itself means something."""
    return "'" + visible(text).replace("'", "''") + "'"


def strings(texts: Iterable[str]) -> str:
    """A row of texts."""
    return cell(map(string, texts))


def cell(items: Iterable[str]) -> str:
    """A row of anything."""
    return "{" + ", ".join(items) + "}"


def vector(values: Iterable[float], sign: str = ", ") -> str:
    """A row of numbers, or with ``"; "`` a column; broken into lines."""
    lines, line = list[str](), ""
    for text in map(literal, values):
        if line and len(line) + len(text) > _WIDTH:
            lines.append(line + sign.rstrip())
            line = ""
        line += (sign if line else "") + text
    return "[" + " ...\n    ".join([*lines, line]) + "]"


def matrix(rows: Sequence[Sequence[float]]) -> str:
    """Rows of numbers, a line each."""
    inner = "; ...\n    ".join(", ".join(map(literal, row)) for row in rows)
    return f"[{inner}]" if rows else "zeros(0, 0)"
