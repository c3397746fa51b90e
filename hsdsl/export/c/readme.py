"""The README of a program in C: how to build it, what it prints, what memory it takes."""

from __future__ import annotations

from dataclasses import dataclass

from hsdsl.base.names import visible
from hsdsl.export.source import Source


@dataclass(frozen=True)
class Sizes:
    """What a program takes, in bytes; tests hold it against what a compiler and a run report."""

    code: int
    static: int
    stack: int


# The bouncing ball, compiled by gcc 12 for x86-64 with -Os, at most; by scheme, then with 32-bit floats.
MEASURED = {
    "relaxed": (Sizes(125_000, 16_000, 6_000), Sizes(125_000, 12_000, 6_000)),
    "located": (Sizes(125_000, 200_000, 6_000), Sizes(125_000, 90_000, 6_000)),
}
SMALL = ("-DMOST_PIECES=32", "-DPROBLEM_ROWS=8", "-DPROBLEM_VISITED=8", "-DHS_INLINE=static", "-DHS_NO_CLOCK")
SMALL_MEASURED = {
    "relaxed": (Sizes(95_000, 6_000, 6_000), Sizes(95_000, 5_000, 6_000)),
    "located": (Sizes(95_000, 32_000, 6_000), Sizes(95_000, 16_000, 6_000)),
}

_README = """\
# {name}

{heading}

## Build

```console
cmake -B build . && cmake --build build
./build/model
```

or without CMake:

```console
cc -std=c99 -O2 -ffp-contract=off -I. -Iruntime -o model main.c instance.c problem.c model.c runtime/hs.c -lm
```

It prints transitions, stop and final state as JSON, and ends with 0 where the run got to its end. Compiled with the
flags of `CMakeLists.txt` it prints every digit of `hsdsl run --json`.

## Use it

`instance.h` has all that own code needs. `hs_open` makes an instance ready and `hs_run_instance` runs it to its end;
`hs_begin_instance` and `hs_advance` run it in stretches, as a controller does. Rows and transitions go to `sink`. An
instance has all of its memory, and nothing is allocated.

| option | meaning |
|---|---|
| `-DHS_FLOAT32` | states and parameters are 32-bit floats; instants stay 64-bit, since a sum of steps needs that |
| `-DHS_NO_CLOCK` | there is no `clock()` |
| `-DHS_INLINE=static` | smaller and slower code |
| `-DPROBLEM_ROWS=N` | rows that wait for the sink, by default 64 |
| `-DPROBLEM_WAITING=N` | executions of an event that can wait behind the first, by default 64 |
| `-DPROBLEM_VISITED=N` | modes that one chain of transitions at an instant may enter, by default 64 |
| `-DMOST_PIECES=N` | pieces that a surface is cut into while a state rests on a guard, by default 1000 |

In 32-bit floats a tolerance is at least 2e-6, and what the run does is right to about that.

## Memory

Measured for a ball with one mode, two states and one guard, compiled by gcc 12 for x86-64 with `-Os` and
`-Wl,--gc-sections`, in bytes at most:

| scheme | numbers | options | code and constants | static memory | stack |
|---|---|---|---|---|---|
{rows}

*Small* is `{small}`. Static memory grows with states, guards and outputs; `size build/model` shows it
as `bss`, and `-fstack-usage` the stack of each function. No function calls itself.
"""


def readme(source: Source) -> str:
    """The text, in Markdown that no text of the model is part of, other than as code."""
    heading = "\n".join(f"    {visible(line)}" for line in source.heading)
    return _README.format(name=source.name, heading=heading, rows=sizes_table(), small=" ".join(SMALL))


def sizes_table() -> str:
    """The rows of the table of sizes."""
    return "\n".join(
        f"| {scheme} | {numbers} | {kind} | {size.code:,} | {size.static:,} | {size.stack:,} |"
        for kind, table in (("", MEASURED), ("small", SMALL_MEASURED))
        for scheme, sizes in table.items()
        for numbers, size in zip(("64-bit", "32-bit"), sizes, strict=True)
    )
