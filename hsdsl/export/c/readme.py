"""The README of a program in C: how to build it, what it prints, what memory it takes."""

from __future__ import annotations

from hsdsl.export.source import Source
from hsdsl.names import visible

_README = """\
# {name}

{heading}

## Build

```console
cmake -B build . && cmake --build build
./build/model
```

or without CMake, in one line:

```console
cc -std=c99 -O2 -ffp-contract=off -I. -Iruntime -o model main.c instance.c problem.c model.c runtime/hs.c -lm
```
"""


def readme(source: Source) -> str:
    """The text, in Markdown that no text of the model is part of, other than as code."""
    heading = "\n".join(f"    {visible(line)}" for line in source.heading)
    return _README.format(name=source.name, heading=heading)
