"""Standard output and error as people see them: nothing that is said there can steer a terminal, nor hide."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from typing import Any

from hsdsl.names import visible_lines


class Visible:
    """A text stream on which hidden characters are made visible, whoever writes them."""

    def __init__(self, plain: Any) -> None:
        self.plain = plain

    def write(self, text: str) -> int:
        """Write a text, line by line as it is but for what is hidden in it."""
        self.plain.write(visible_lines(text))
        return len(text)

    def writelines(self, texts: Iterable[str]) -> None:
        """Write texts."""
        for text in texts:
            self.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.plain, name)


def prepare() -> None:
    """See to it that there are streams, also where they were closed, that they can write any name and hide nothing."""
    for name in ("stdout", "stderr"):
        stream: Any = getattr(sys, name)
        if stream is None:
            stream = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, stream if isinstance(stream, Visible) else Visible(stream))


def draw(text: str) -> None:
    """Write what is meant to steer a terminal: a line of standard error that is drawn again and again."""
    plain = sys.stderr.plain if isinstance(sys.stderr, Visible) else sys.stderr
    plain.write(text)
    plain.flush()
