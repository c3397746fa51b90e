"""The engines as tests put them together: which loop runs over which kernel."""

from __future__ import annotations

import math
import random
import struct
from dataclasses import fields, replace
from typing import Any

import pytest
from compiled_kernel import CompiledKernel

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS
from hsdsl.engine.execution import Execution
from hsdsl.engine.execution.records import same
from hsdsl.engine.runtime.compiler import NoCompiler, find_compiler
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.interface.model import Model

try:
    find_compiler()
    COMPILER = True
except NoCompiler:
    COMPILER = False
ENGINES = ("python", "c") if COMPILER else ("python",)
needs_compiler = pytest.mark.skipif(not COMPILER, reason="there is no C compiler here")


def over_compiled_kernel(model: Model) -> Model:
    """The same model, run by the Python loop over the compiled kernel."""
    other = Model(model.system)
    other.pipeline.__dict__["program"] = model.program
    other.pipeline.kernels[None] = CompiledKernel(model.program, CompiledModel(model.program))  # type: ignore[assignment]
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


def assert_sampled_alike(run: Any) -> None:
    """The compiled sampler must give what the execution's arrays give in Python, to the last bit."""
    assert run.sampler is not None
    plain, rng = replace(run, sampler=None), random.Random(len(run.times))
    start, end = map(float, run.time_span)
    times = [rng.uniform(start, end) for _ in range(40)] + rng.choices(run.times.tolist(), k=20)
    rising = [start + (end - start) * k / 150 for k in range(150)] + [end * (1 + 5e-13)]
    for given in (times, rising):
        for side in ("right", "left"):
            for columns in (None, [*run.output_names[:1], *run.states[-1:]]):
                fast, slow = (r.sample(given, side, columns) for r in (run, plain))
                for field in fields(fast):
                    assert same(getattr(fast, field.name), getattr(slow, field.name)), (field.name, side, columns)


COMPARED = [field.name for field in fields(Execution) if field.compare and field.name not in ("engine", "seconds")]


def assert_engines_agree(model: Model, verdict: bool = True, **arguments: Any) -> Any:
    """Run by the Python loop and by the compiled loop; both must give one execution.

    Where they differ, the Python loop over the compiled kernel tells whether the printed C is wrong or the C runtime.
    """
    python, compiled = (model.simulate(**arguments, engine=engine) for engine in ("python", "c"))
    assert (python.engine, compiled.engine) == ("python", "c")
    differing = [each for each in COMPARED if (each != "verdict" or verdict) and not alike_in(each, python, compiled)]
    if differing:
        between = over_compiled_kernel(model).simulate(**arguments, engine="python")
        runtime = all(alike_in(each, python, between) for each in differing if each != "verdict")
        where = "the C runtime" if runtime else "the printed C"
        pytest.fail(f"{where}: {differing}, {python.stop}, {compiled.stop}, {arguments}")
    if not model.program.parts:  # runs of parts are sampled in Python
        assert_sampled_alike(compiled)
    return python


def alike_in(name: str, one: Execution, other: Execution) -> bool:
    return same(getattr(one, name), getattr(other, name))
