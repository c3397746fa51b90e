"""Which expression has no finite value: asked only when a run cannot go on."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Stop
from hsdsl.integrators.stepper import State
from hsdsl.simulate.run import Here, Run
from hsdsl.simulate.stops import show


def not_finite(run: Run, here: Here, t: Number, points: Iterable[State]) -> Stop:
    """Stop at time t, naming the first expression without a finite value at one of ``points``."""
    expressions = run.kernel.expressions(run.program.modes.index(here.mode), here.segment.data)
    for x in points:
        for name, routine in expressions:
            try:
                finite = all(map(run.arithmetic.isfinite, routine(t, *x)))
            except DOMAIN_ERRORS:
                finite = False
            if not finite:
                return Stop("not_finite", t, f"{name}, has no finite value at t = {show(t)} ({_state(here, x)})")
    return Stop("not_finite", t, f"{_largest(here)} grows beyond all numbers at t = {show(t)} in mode {here.mode.name}")


def _largest(here: Here) -> str:
    sized = zip(here.arc.values[-1], here.arc.states, here.mode.flow_texts, strict=True)
    value, state, text = max(sized, key=lambda entry: abs(entry[0]))
    return f"{state}, whose flow is {text} and whose value is {show(value)},"


def _state(here: Here, x: State) -> str:
    return ", ".join(f"{name} = {show(value)}" for name, value in zip(here.arc.states, x, strict=True))
