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
from functools import cache, partial

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine import ahead
from hsdsl.engine.runtime import kernel, library
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.runtime.structures import SCHEMES
from hsdsl.engine.simulate import Settings
from hsdsl.engine.simulate.plan import Pending
from hsdsl.mathematics.program import Program

ENGINES = ("auto", "c", "python")


def check(engine: str) -> None:
    """Refuse an engine that is not one of :data:`ENGINES`."""
    if engine not in ENGINES:
        raise UsageError(f"there is no engine '{engine}'", did_you_mean(engine, ENGINES))


def choose(
    engine: str,
    settings: Settings,
    precision: int | None,
    make: Callable[[], CompiledModel],
    program: Program | None = None,
) -> CompiledModel | Pending | None:
    """The compiled model that a run is for, None where the Python loop is to run it.

    Of a ``program`` that other processes may compile at the moment it need not be there yet.

    Raises UsageError: ``c`` is given and cannot serve.
    """
    take = partial(_taken, engine, settings, precision, make)
    if program is not None and engine == "auto" and _refusal(settings, precision) is None:
        with suppress(NoCompiler):  # what needs the compiler says so
            elsewhere = library.under_way(program)
            return Pending(lambda: ahead.compiling() or elsewhere(), take)
    return take()


def _taken(
    engine: str, settings: Settings, precision: int | None, make: Callable[[], CompiledModel]
) -> CompiledModel | None:
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
