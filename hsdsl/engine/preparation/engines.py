"""The choice of the loop that runs a model.

======== ==========================================================================
auto     ``c`` where it can serve, ``python`` where it cannot
c        the compiled loop, or a refusal that says why not
python   the readable one
======== ==========================================================================
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache

from hsdsl.base.errors import UsageError
from hsdsl.base.names import did_you_mean
from hsdsl.engine.runtime import kernel
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.engine.runtime.structures import SCHEMES
from hsdsl.engine.simulate import Settings

ENGINES = ("auto", "c", "python")


def check(engine: str) -> None:
    """Refuse an engine that is not one of :data:`ENGINES`."""
    if engine not in ENGINES:
        raise UsageError(f"there is no engine '{engine}'", did_you_mean(engine, ENGINES))


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
