"""The model as a program in C99: generated routines and numbers, the runtime, a main function, how to build them."""

from __future__ import annotations

from textwrap import wrap

from hsdsl.export.c.sources import EXACT_FLAGS, PARTS, c_sources, readme
from hsdsl.export.source import Source


def files(source: Source) -> dict[str, bytes]:
    """All files of the program.

    Raises UsageError: the C runtime has no such scheme.
    """
    sources = c_sources(source)
    cmake = (
        (PARTS / "CMakeLists.txt")
        .read_text()
        .replace("@EXACT@", "\n    ".join(wrap(" ".join(EXACT_FLAGS), 110, break_on_hyphens=False)))
    )
    texts = {"README.md": readme(source), "CMakeLists.txt": cmake, "main.c": (PARTS / "main.c").read_text()}
    return {name: text.encode() for name, text in texts.items()} | sources
