"""The engines as tests put them together: which loop runs over which kernel."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from typing import Any

import pytest

from hsdsl.arithmetic import DOMAIN_ERRORS
from hsdsl.model import Model
from hsdsl.runtime.compiler import NoCompiler, find_compiler
from hsdsl.runtime.kernel import CompiledKernel, CompiledModel

try:
    find_compiler()
    COMPILER = True
except NoCompiler:
    COMPILER = False
needs_compiler = pytest.mark.skipif(not COMPILER, reason="there is no C compiler here")


def over_compiled_kernel(model: Model) -> Model:
    """The same model, run by the Python loop over the compiled kernel."""
    other = Model(model.system)
    other.__dict__["program"] = model.program
    other._kernels[None] = CompiledKernel(model.program, CompiledModel(model.program))  # type: ignore[assignment]
    return other


def alike(execution: Any) -> Any:
    """An execution without what tells engines apart that agree: their names and their times."""
    return replace(execution, engine="", seconds={})


def bits(numbers: Any) -> list[int | str]:
    """Numbers as they are in memory, all not-a-numbers alike."""
    return ["nan" if math.isnan(v) else struct.unpack("<q", struct.pack("<d", v))[0] for v in map(float, numbers)]


def outcome(routine: Any, *arguments: float) -> list[int | str] | None:
    """What a routine returns, to the bit; None where it has no value."""
    try:
        return bits(routine(*arguments))
    except DOMAIN_ERRORS:
        return None
