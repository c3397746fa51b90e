"""The model as a program in C99: generated routines and numbers, the runtime, a main function, how to build them.

`files` are those of the program. Every target that compiles C begins with `c_sources`: the model with its runtime and
its numbers, which build alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from textwrap import wrap
from typing import NamedTuple

from hsdsl.base.errors import UsageError
from hsdsl.base.names import visible
from hsdsl.engine.backends.c.source import model_source
from hsdsl.engine.runtime.compiler import FLAGS
from hsdsl.engine.runtime.library import runtime_text
from hsdsl.export.c.problem import PARTS, comment, header, numbers
from hsdsl.export.source import Source, filled

COMPILED = ("model.c", "problem.c", "instance.c", "runtime/hs.c")  # with -I. -Iruntime, and linked with -lm

_INCLUDE = re.compile(r'^#include "(.+)"', re.MULTILINE)

# those that decide the bits of a run
EXACT_FLAGS = tuple(flag for flag in FLAGS if flag.startswith(("-ffp-", "-fno-math-", "-fno-builtin-")))


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


def c_sources(source: Source, tunable: bool = False, *further: str) -> dict[str, bytes]:
    """The files by their paths: ``model.c`` and ``problem.[ch]`` generated, ``instance.[ch]`` and ``runtime/``.

    With ``tunable`` parameters and initial values can be changed, and take memory for that. ``further`` are other
    files of `parts`.

    Raises UsageError: the runtime has no such scheme.
    """
    settings = source.problem.settings
    if settings.method is None:
        raise UsageError(f"the C runtime has no scheme {settings.scheme}", "choose --scheme located or relaxed")
    files = {
        "model.c": comment(source.heading) + model_source(source.problem.program),
        "problem.h": header(source, tunable),
        "problem.c": numbers(source),
    }
    parts = {name: (PARTS / name).read_text() for name in ("instance.c", "instance.h", *further)}
    runtime = {f"runtime/{name}": text for name, text in sorted(_included(["hs.c"], {**files, **parts}).items())}
    return {name: text.encode() for name, text in {**files, **parts, **runtime}.items()}


def _included(names: Iterable[str], including: Mapping[str, str]) -> dict[str, str]:
    """The files of the runtime of these names, and those that they and ``including`` include."""
    found: dict[str, str] = {}
    ahead = [*names, *(name for text in including.values() for name in _INCLUDE.findall(text))]
    while ahead:
        name = ahead.pop()
        if name not in found and name not in including:
            found[name] = runtime_text(name)
            ahead += _INCLUDE.findall(found[name])
    return found


class Sizes(NamedTuple):
    """What a program takes, in bytes; tests hold it against what a compiler and a run report."""

    code: int
    static: int
    stack: int


# The bouncing ball, compiled by gcc 12 for x86-64 with -Os, at most; by scheme, then with 32-bit floats.
MEASURED = {
    "relaxed": (Sizes(130_000, 16_000, 6_000), Sizes(130_000, 12_000, 6_000)),
    "located": (Sizes(130_000, 200_000, 6_000), Sizes(130_000, 90_000, 6_000)),
}
SMALL = ("-DMOST_PIECES=32", "-DPROBLEM_ROWS=8", "-DPROBLEM_VISITED=8", "-DHS_INLINE=static", "-DHS_NO_CLOCK")
SMALL_MEASURED = {
    "relaxed": (Sizes(100_000, 6_000, 6_000), Sizes(100_000, 5_000, 6_000)),
    "located": (Sizes(100_000, 32_000, 6_000), Sizes(100_000, 16_000, 6_000)),
}


def readme(source: Source) -> str:
    """The text, in Markdown that no text of the model is part of, other than as code."""
    heading = "\n".join(f"    {visible(line)}" for line in source.heading)
    return filled(
        (PARTS / "README.md.in").read_text(),
        name=source.name,
        heading=heading,
        rows="\n".join(
            f"| {scheme} | {numbers} | {kind} | {size.code:,} | {size.static:,} | {size.stack:,} |"
            for kind, table in (("", MEASURED), ("small", SMALL_MEASURED))
            for scheme, sizes in table.items()
            for numbers, size in zip(("64-bit", "32-bit"), sizes, strict=True)
        ),
        small=" ".join(SMALL),
    )
