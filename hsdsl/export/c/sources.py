"""A model with its runtime and its numbers as C that builds alone; every target that compiles C begins with these."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from hsdsl.base.errors import UsageError
from hsdsl.engine.backends.c import model_source
from hsdsl.engine.runtime.compiler import FLAGS
from hsdsl.engine.runtime.library import RUNTIME
from hsdsl.export.c.problem import header, numbers
from hsdsl.export.c.text import comment
from hsdsl.export.source import Source

PARTS = Path(__file__).parent / "parts"
COMPILED = ("model.c", "problem.c", "instance.c", "runtime/hs.c")  # with -I. -Iruntime, and linked with -lm

_INCLUDE = re.compile(r'^#include "(.+)"', re.MULTILINE)

# those that decide the bits of a run
EXACT_FLAGS = tuple(flag for flag in FLAGS if flag.startswith(("-ffp-", "-fno-math-", "-fno-builtin-")))


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
            found[name] = (RUNTIME / name).read_text()
            ahead += _INCLUDE.findall(found[name])
    return found
