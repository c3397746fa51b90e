"""The library that a program is compiled to."""

from __future__ import annotations

import ctypes

from hsdsl.base import limits
from hsdsl.engine.runtime.compiler import NoCompiler, TooSlow
from hsdsl.engine.runtime.library import load
from hsdsl.mathematics.program import Program

SYMBOL = "hs_the_model"


def compiled(program: Program) -> ctypes.CDLL:
    """The library of a program, from the cache or compiled for it.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    try:
        return load(_content(program), SYMBOL, lambda: _source(program))
    except TooSlow as error:
        raise NoCompiler(f"{error}; {_longest(program)}") from None


def _content(program: Program) -> str:
    data = len(program.parameters), len(program.inputs), len(program.switches)
    return repr(((*data, len(program.outputs), program.initial_states), program.flows))


def _longest(program: Program) -> str:
    """Say where most of the work of a model is."""
    flows = (
        (text, f"the flow of {state} in mode {mode.name}")
        for mode in program.modes
        for state, text in zip(mode.states, mode.flow_texts, strict=True)
    )
    guards = ((edge.text, f"the guard of {edge.name}") for mode in program.modes for edge in mode.edges)
    text, where = max((*flows, *guards), key=lambda pair: len(pair[0]), default=("", "none"))
    return f"the longest expression is {where}, with {len(text):,} characters"


def _source(program: Program) -> list[str]:
    from hsdsl.engine.backends.c import model_parts  # what is compiled already needs none

    return model_parts(program, limits.cores())
