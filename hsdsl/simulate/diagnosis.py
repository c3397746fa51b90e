"""Which expression has no finite value: asked only when a run cannot go on."""

from __future__ import annotations

from collections.abc import Iterable

from hsdsl.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.execution import Stop
from hsdsl.integrators import RadauMethod, TaylorMethod
from hsdsl.integrators.stepper import State
from hsdsl.integrators.taylor import NoSeries, terms
from hsdsl.simulate.chatter import jump_between
from hsdsl.simulate.run import ModeState, Run
from hsdsl.simulate.stops import show

NEAR = 8  # doublings and halvings of a step: how far a jump of the flow is looked for


Place = tuple[Number, State]


def not_finite(run: Run, here: ModeState, t: Number, places: Iterable[Place]) -> Stop:
    """Stop at time t, naming the first expression without a finite value at one of ``places``."""
    for place in places:
        if found := without_value(run, here, *place):
            return Stop("not_finite", t, found)
    if has_no_series(run, here, t):
        sentence = f"the flow of mode {here.mode.name} has no Taylor series at t = {show(t)}; another method may go on"
        return Stop("not_finite", t, sentence)
    if has_no_jacobian(run, here, t):
        sentence = f"the flow of mode {here.mode.name} has no derivatives at t = {show(t)}; another method may go on"
        return Stop("not_finite", t, sentence)
    grown = any(a * a * run.arithmetic.unit > 1 for a in here.x)
    if not grown and (found := without_value_later(run, here, t)):
        return Stop("not_finite", t, found)
    return Stop("not_finite", t, f"{_largest(here)} grows beyond all numbers at t = {show(t)} in mode {here.mode.name}")


def without_value(run: Run, here: ModeState, t: Number, x: State) -> str | None:
    """Name the first expression without a finite value at a place."""
    for name, routine in run.kernel.expressions(run.program.modes.index(here.mode), here.segment.data):
        try:
            finite = all(map(run.arithmetic.isfinite, routine(t, *x)))
        except DOMAIN_ERRORS:
            finite = False
        if not finite:
            return f"{name}, has no finite value at t = {show(t)} ({_state(here, x)})"
    return None


def without_value_later(run: Run, here: ModeState, t: Number) -> str | None:
    """Name an expression that time alone takes beyond all numbers before the segment ends, and when, by halving."""
    last, later = t, here.segment.end
    found = without_value(run, here, later, here.x)
    while found and last < (middle := (last + later) / 2) < later:
        if sentence := without_value(run, here, middle, here.x):
            later, found = middle, sentence
        else:
            last = middle
    return found


def jump_near(run: Run, here: ModeState, slope: State) -> str | None:
    """Name a component of the flow that jumps a few steps ahead of a state or behind it, and the place."""
    h, flow = run.control.h, here.kernel.flow
    for n in range(-NEAR, NEAR + 1):
        for way in (h * 2**n, -h * 2**n):
            t1, z = here.t + way, tuple(a + way * f for a, f in zip(here.x, slope, strict=True))
            for k, (state, text) in enumerate(zip(here.mode.states, here.mode.flow_texts, strict=True)):
                if jump := jump_between(flow, k, here.t, here.x, t1, z):
                    point, before, behind = jump
                    values = f"from {show(before)} to {show(behind)}"
                    return f"the flow of {state}, {text}, jumps {values} at {_state(here, point)}"
    return None


def has_no_series(run: Run, here: ModeState, t: Number) -> bool:
    """Whether the method is Taylor's and cannot expand the flow where the run stands."""
    method = run.settings.method
    series = run.kernel.taylor(run.program.modes.index(here.mode), here.segment.data)
    if not isinstance(method, TaylorMethod) or series is None:
        return False
    try:
        terms(series, method.order, t, here.x)
    except NoSeries:
        return True
    return False


def has_no_jacobian(run: Run, here: ModeState, t: Number) -> bool:
    """Whether the method is implicit and the flow has no derivatives where the run stands."""
    if not isinstance(run.settings.method, RadauMethod):
        return False
    try:
        slopes = run.kernel.jacobian(run.program.modes.index(here.mode), here.segment.data)(t, *here.x)
    except DOMAIN_ERRORS:
        return True
    return not all(map(run.arithmetic.isfinite, slopes))


def _largest(here: ModeState) -> str:
    sized = zip(here.arc.values[-1], here.arc.states, here.mode.flow_texts, strict=True)
    value, state, text = max(sized, key=lambda entry: abs(entry[0]))
    return f"{state}, whose flow is {text} and whose value is {show(value)},"


def _state(here: ModeState, x: State) -> str:
    return ", ".join(f"{name} = {show(value)}" for name, value in zip(here.arc.states, x, strict=True))
