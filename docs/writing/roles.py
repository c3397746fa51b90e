"""Docstrings for the site: roles become code, as Markdown has none, and sentences on errors become sections."""

from __future__ import annotations

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:attr|class|data|func|meth):`~?\.?([^`]+)`")
ERROR = re.compile(r"^Raises (\w+): (.+?)\s*(?=\n\n|\Z)", re.MULTILINE | re.DOTALL)


class Roles(griffe.Extension):
    """Rewrite every docstring."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Rewrite one docstring."""
        if obj.docstring:
            text = ROLE.sub(r"`\1`", obj.docstring.value)
            obj.docstring.value = ERROR.sub(section, text)


def section(found: re.Match[str]) -> str:
    """Write the sentence of an error as a section of it."""
    return f"Raises\n------\n{found[1]}\n    {' '.join(found[2].split())}\n"
