"""Texts of a model as C: string literals and comments that nothing in them can end; arrays."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from hsdsl.base.names import visible

_PLAIN = frozenset(map(chr, range(0x20, 0x7F))) - set('"\\?')


def string(text: str) -> str:
    """A string literal of UTF-8: all but plain ASCII are octal escapes, a question mark too (trigraphs)."""
    signs = (sign if sign in _PLAIN else "".join(f"\\{byte:03o}" for byte in _bytes(sign)) for sign in text)
    return f'"{"".join(signs)}"'


def _bytes(sign: str) -> bytes:
    return sign.encode(errors="replace")


def comment(lines: Iterable[str]) -> str:
    """A comment of these lines; no signs in them open, close or splice anything."""
    plain = (visible(line).replace("\\", "/").replace("*/", "* /").replace("/*", "/ *") for line in lines)
    wrapped = [part for line in plain for part in textwrap.wrap(line.replace("??", "? ?"), 114) or [""]]
    return "/* " + "\n   ".join(wrapped) + " */\n"


def array(kind: str, name: str, values: Iterable[str], after: str = "") -> str:
    """The definition of an array, of at least one element: C has no empty ones; ``after`` is of its type."""
    listed = list(values) or ["0"]
    return f"{kind} {name}[]{after} = {{\n  {_wrapped(listed)}}};\n"


def function(name: str, arguments: str, body: str, real: str = "hs_real") -> str:
    """The definition of a routine of ``p`` that writes to ``out``; it returns 0 where it has a value."""
    head = f"static int {name}({arguments}, {real} *out) {{\n  int bad = 0;\n  (void)p, (void)out;\n"
    return f"{head}{body}\n  return bad;\n}}\n"


def _wrapped(values: Sequence[str]) -> str:
    rows, row = list[str](), ""
    for value in values:
        if row and len(row) + len(value) > 112:
            rows.append(row.rstrip())
            row = ""
        row += f"{value}, "
    return "\n  ".join([*rows, row.removesuffix(", ")])
