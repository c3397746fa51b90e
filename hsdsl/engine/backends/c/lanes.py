"""A program's routines for lanes of runs: the text of those for one run, after `runtime/c/lane.h`, which makes of a
number a vector of them. A mode whose routines choose by numbers, or whose flow has no Taylor series, has none.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TypeVar

from hsdsl.engine.backends.c.series import is_large
from hsdsl.engine.backends.c.source import DEFINITION, Writer
from hsdsl.mathematics.program import ModeProgram, Program

Written = TypeVar("Written")
_NUMBER = re.compile(r"\(\(hs_real\)([^()]*)\)")
_PLAIN = re.compile(r"(?<== )\d\.\d(?=;)|(?<=\(p, )0\.0(?=, 0, c)")
_CHOICE = re.compile(r"(?<!k % 2 )\?|\bhs_below\b")  # by numbers
_NONE = "{0}"
_TEXT = """\
/* Generated from a model; see hs_lanes.h. */

#include "lane.h"

{functions}{tables}static const hs_lane_mode lane_modes[] = {{
  {modes}}};
static const int32_t lanes_are_for[] = {{{eligible}}};

#include "lane_step.c"
"""


def lane_source(program: Program) -> str | None:
    """Write a program's lanes as C; None where no mode has any."""
    writer = Writer(program)
    modes = [_mode(writer, mode) for mode in program.modes]
    if not any(modes):
        return None
    functions = "".join(map(_wide, writer.functions.values()))
    return _TEXT.format(
        functions=functions,
        tables="".join(writer.tables),
        modes=",\n  ".join(mode or _NONE for mode in modes),
        eligible=", ".join(str(int(bool(mode))) for mode in modes),
    )


def _mode(writer: Writer, mode: ModeProgram) -> str | None:
    """Write the routines of a mode, and return its row of the table."""
    tape, n = mode.tape, len(mode.states)
    if tape is None or mode.final or mode.derived or is_large(tape, n) or not n or None in tape.surfaces:
        return None
    texts = dict[str, str](DEFINITION.findall(mode.routines.source))

    def own() -> tuple[list[str], list[str], list[str]]:
        routines = [writer.function(texts[name]) for name in ("flow", "surfaces", "magnitudes")]
        gradients = [writer.sparse(writer.few(texts[f"gradient_{k}"]), mode.slopes[k]) for k in mode.surfaces]
        rates = [writer.few(texts[f"rate_{k}"]) for k in mode.surfaces]
        return [*routines, *writer.series(tape, n, False)], gradients, rates

    found = _without_choices(writer, own)
    if found is None:
        return None
    routines, gradients, rates = found
    pairs = [(texts[f"reset_{k}"], texts[f"spread_{k}"]) for k in range(len(mode.edges))]
    edges = [
        _without_choices(writer, lambda reset=reset, spread=spread: f"{{{writer.few(reset)}, {writer.few(spread)}}}")
        for reset, spread in pairs
    ]
    tables = (
        writer.table("hs_sparse", "gradients", gradients),
        writer.table("hs_local", "locals", rates),
        writer.table("hs_lane_edge", "edges", [edge or "{{0}}" for edge in edges]),
    )
    return f"{{{', '.join((f'{n}, {len(mode.surfaces)}, {len(mode.edges)}', *routines, *tables))}}}"


def _without_choices(writer: Writer, write: Callable[[], Written]) -> Written | None:
    """Write something; None where its routines choose by numbers."""
    kept = dict(writer.functions)
    found = write()
    if any(_CHOICE.search(text) for name, text in writer.functions.items() if name not in kept):
        writer.functions = kept
        return None
    return found


def _wide(function: str) -> str:
    """Write numbers as vectors where nothing makes them such."""
    return _PLAIN.sub(r"HS_ALL(\g<0>)", _NUMBER.sub(r"HS_ALL(\1)", function))
