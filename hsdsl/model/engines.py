"""The choice of the loop that runs a model.

======== ==========================================================================
auto     ``c`` where it can serve, ``python`` where it cannot or has ended before the model is compiled
c        the compiled loop, or a refusal that says why not
python   the readable one
======== ==========================================================================
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from math import inf

from hsdsl import ahead
from hsdsl.errors import UsageError
from hsdsl.names import did_you_mean
from hsdsl.program import Program
from hsdsl.runtime import kernel, library, programs
from hsdsl.runtime.compiler import NoCompiler, find_compiler
from hsdsl.runtime.kernel import CompiledModel
from hsdsl.runtime.structures import SCHEMES
from hsdsl.simulate import Settings

ENGINES = ("auto", "c", "python")


def check(engine: str) -> None:
    """Refuse an engine that is not one of :data:`ENGINES`."""
    if engine not in ENGINES:
        raise UsageError(f"there is no engine '{engine}'", did_you_mean(engine, ENGINES))


def begin(engine: str, precision: int | None, scheme: str | None) -> None:
    """Compile the loop while a model is read, where the run may need it and no other process does so."""
    if engine != "python" and precision is None and (scheme or SCHEMES[0]) in SCHEMES and not ahead.begun():
        library.begin()


def pending(
    program: Program, settings: Settings, precision: int | None, compiling: Callable[[], bool] | None
) -> Callable[[], bool] | None:
    """Whether other processes still make what can run a program; None where there is nothing to wait for.

    ``compiling`` says it of a process that was begun for it.
    """
    if _refusal(settings, precision) is None:
        with suppress(NoCompiler):
            find_compiler()  # what has none says so
            compiling = compiling or programs.under_way(program)
            return compiling if compiling() else None
    return None


def worth(spent: float) -> float:
    """How many seconds the Python loop may take to make a run whose model took so long to read.

    That is about how long the compiler takes for the model; the compiled loop, where it is not kept, takes longer.
    """
    return spent if library.is_kept(library.LOOP[0]) else inf


def choose(
    engine: str, settings: Settings, precision: int | None, make: Callable[[], CompiledModel]
) -> CompiledModel | None:
    """The compiled model that a run is for, None where the Python loop is to run it.

    Raises UsageError: ``c`` is given and cannot serve.
    """
    if engine == "python":
        return None
    why = _refusal(settings, precision)
    if why is None:
        try:
            compiled = make()
            kernel.runtime()
            return compiled
        except NoCompiler as error:
            why = str(error)
        if engine == "auto":
            _warn_once(why)
    if engine == "c":
        raise UsageError(f"engine 'c' cannot run this: {why}", "use engine 'python', or 'auto'")
    return None


def _refusal(settings: Settings, precision: int | None) -> str | None:
    if precision is not None:
        return "it computes with float64 only, and a precision is given"
    if settings.scheme not in SCHEMES:
        return f"scheme '{settings.scheme}' has no compiled loop"
    return None


@cache
def _warn_once(why: str) -> None:
    print(f"hsdsl: the Python engine runs this, 50 or more times slower than compiled code: {why}", file=sys.stderr)
