"""The method that `auto` is for one run: chosen before it starts, from the expressions and the start's surroundings.

With a fixed step it is the table `dopri5`. With a tolerance it is

========= ============================================================================================
`radau`   where the mode of the start, or one that its edges lead to, is stiff (below)
`taylor`  where every flow is smooth
`dopri5`  where one has `abs`, `sign`, `min`, `max` or `floor` of a state, or no derivatives at the start or, as the
          root of `max(sin(t), 0)`, no Taylor series where a sample or a switch of an input begins
`dop853`  where one has no derivatives at the start, and `dopri5` a stage without a value in the shortest steps
========= ============================================================================================

A mode is stiff where both hold at the last points of a short way along the flow from the start:

- the fastest decay, the largest -Re of an eigenvalue of the flow's Jacobian that does not oscillate faster than it
  decays, would alone keep an explicit method to :data:`LEAST_STEPS` steps until the end;
- the curve there is straight, to a hundredth of the largest that each state has been, for at least :data:`APART` times
  of that decay.

The way has linearly implicit steps of order 2, each at most twice as long as the fast decay and as the straight part of
the curve: fast decays decay on it, and oscillations go on. It is one flight: where a surface is crossed on it, or a
sample or a switch of an input is passed, the mode is not stiff. An implicit method would begin again there, which costs
as much as a few dozen times of decay by an explicit one.

What lies far from the start is seen by the run itself (`simulate.review`): where its steps are at least as long
as the fastest decay at its last row, and the mode is stiff from there on, the run is made again by `radau`.

A run with a precision is not examined, and counts as not stiff.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from math import inf, isfinite

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Array
from hsdsl.engine.integrators import FALLBACK, METHODS, ButcherTableau, Method
from hsdsl.engine.integrators.taylor import NoSeries, terms
from hsdsl.engine.kernel import Kernel
from hsdsl.engine.simulate import Problem, Settings
from hsdsl.engine.simulate.input_segments import Segment, Timeline
from hsdsl.engine.simulate.review import Judge
from hsdsl.mathematics.program import Program

LEAST_STEPS = 1000
REACH = 3.3  # the length of an explicit step, in times of decay, that is still stable (dopri5 on the real axis)
APART = 100
STEPS, LENGTH = 64, 2.0  # along the way, and their greatest length in times of decay
ON = 2.0**-26  # of what the way's first step moves a surface by: a state so near is on it
OTHER_STAGES = "dop853"
SHORT = (20, 30, 40)  # halvings of the run: the lengths of first steps that are tried
LAST = 16  # of these, at which a mode must be stiff
MOST_SEGMENTS = 64  # of inputs, at whose beginnings series are tried
MOST_STATES, MOST_MODES = 100, 8  # a larger Jacobian, or more modes, take longer to examine than to run


def chosen(
    settings: Settings, program: Program, kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]
) -> Settings:
    """The settings with the method that `auto` is for them, and the reason."""
    method, why = METHODS[FALLBACK], "the step is fixed"
    if settings.tolerance is not None:
        method, why = _adaptive(float(settings.until), program, kernel, timeline, mode, x)
    method = method.for_tolerance(settings.tolerance, kernel.arithmetic)
    return replace(settings, method=method, method_chosen=f"{method.name}: {why}")


def _adaptive(
    until: float, program: Program, kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]
) -> tuple[Method, str]:
    near = dict(_near(program, mode, x)) if kernel.arithmetic.digits is None else {}
    for k, values in near.items():
        stiff = stiffness(kernel, timeline, program.modes[k].name, k, values, until)
        if stiff is not None:
            return METHODS["radau"], stiff
    if mode in near and not _has_derivatives(kernel, timeline, mode, x):
        without = f"the flow of {program.modes[mode].name} has no derivatives at the start"
        if _begins(METHODS[FALLBACK], kernel, timeline, mode, x, until):
            return METHODS[FALLBACK], without
        other = METHODS[OTHER_STAGES]
        if _begins(other, kernel, timeline, mode, x, until):
            return other, f"{without}, and a stage of {FALLBACK} no value"
        return METHODS[FALLBACK], without
    kinked = next((each.name for each in program.flows if each.tape is None), None)
    if kinked is not None:
        return METHODS[FALLBACK], f"the flow of {kinked} has abs, sign, min, max, floor or select of a state"
    missing = next(_without_series(program, kernel, timeline, near, mode), None)
    if missing is not None:
        return METHODS[FALLBACK], missing
    return METHODS["taylor"], "every flow is smooth, and none was seen to be stiff"


def judge_of(problem: Problem, plain: Problem | None = None) -> Judge | None:
    """What finds stiff stretches of a run under way; None unless `auto` has chosen an explicit method.

    Of a run with more states ``plain`` is the one that the choice was made for: its modes are judged.
    """
    plain = plain or problem
    settings, digits = problem.settings, problem.arithmetic.digits
    chosen = settings.tolerance is not None and plain.settings.method_chosen is not None
    if chosen and digits is None and settings.method is not None and not settings.method.implicit:
        return partial(_judge, plain, problem.program)
    return None


def _judge(plain: Problem, program: Program, mode: int, t: Number, x: Sequence[Number], step: Number) -> str | None:
    """Why a mode of a program is stiff at a state of a run with such steps on average; None where it is not."""
    name, values = program.modes[mode].name, dict(zip(program.modes[mode].states, x, strict=False))
    if name not in plain.program.mode_names:
        return None
    index = plain.program.mode_names.index(name)
    here, until = _in_mode(plain.program, index, values), float(plain.settings.until)
    if here is None:
        return None
    try:
        flight = _Flight(plain.kernel, plain.timeline, index, float(t), np.array(here))
        decay = flight.decay()
        if decay * float(step) < 1 or flight.straight(decay) * decay < APART:
            return None
    except (*DOMAIN_ERRORS, np.linalg.LinAlgError):
        return None
    return stiffness(plain.kernel, plain.timeline, name, index, here, until, float(t))


def _has_derivatives(kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number]) -> bool:
    """Whether the flow has finite derivatives at the start: the square root of 0 has none, and so no Taylor series."""
    try:
        return bool(np.isfinite(_Flight(kernel, timeline, mode, 0.0, np.array(x, float)).jacobian()).all())
    except DOMAIN_ERRORS:
        return False


def _without_series(
    program: Program, kernel: Kernel, timeline: Timeline, near: Mapping[int, Sequence[float]], start: int
) -> Iterator[str]:
    """Modes whose flow has no Taylor series where one of the first segments begins, near the states of the start.

    Of the modes that the run begins in later, what fails in all segments is due to these states.
    """
    for k, x in near.items():
        tried = timeline.segments[:MOST_SEGMENTS] if program.modes[k].ends else ()
        fails = [segment for segment in tried if not _has_series(kernel, k, segment, tuple(x))]
        if fails and (k == start or len(fails) < len(tried)):
            yield f"the flow of {program.modes[k].name} has no Taylor series at t = {float(fails[0].start):.3g}"


def _has_series(kernel: Kernel, mode: int, segment: Segment, x: tuple[float, ...]) -> bool:
    series = kernel.taylor(mode, segment.data)
    try:
        return series is None or bool(terms(series, 1, segment.start, x))
    except NoSeries:
        return False


def _begins(method: Method, kernel: Kernel, timeline: Timeline, mode: int, x: Sequence[Number], until: float) -> bool:
    """Whether the flow has values at all stages of short steps from the start: the root of a state below 0 has none."""
    assert isinstance(method, ButcherTableau)
    flow = kernel.bind(mode, timeline.at(0.0).data).flow
    try:
        for n in SHORT:
            list(method.places(flow, 0.0, x, until / 2**n))
    except DOMAIN_ERRORS:
        return False
    return True


def _near(program: Program, mode: int, x: Sequence[Number]) -> Iterator[tuple[int, list[float]]]:
    """The mode of the start and those its edges lead to that have no other states, with x in their order."""
    values = dict(zip(program.modes[mode].states, x, strict=True))
    targets = dict.fromkeys((mode, *(edge.target for edge in program.modes[mode].edges)))
    found = ((k, _in_mode(program, k, values)) for k in targets)
    yield from islice(((k, there) for k, there in found if there is not None), MOST_MODES)


def _in_mode(program: Program, mode: int, values: Mapping[str, Number]) -> list[float] | None:
    """The values of a mode's states; None where one is missing, or where there are none or too many to examine."""
    states = program.modes[mode].states
    if not 0 < len(states) <= MOST_STATES or not values.keys() >= set(states):
        return None
    return [float(values[each]) for each in states]


def stiffness(
    kernel: Kernel, timeline: Timeline, name: str, mode: int, x: Sequence[Number], until: float, t: float = 0.0
) -> str | None:
    """Why a mode is stiff near x at a time; None where it is not.

    Something decays fast in comparison with the time for which the curve is straight to a hundredth.
    """
    try:
        flight = _Flight(kernel, timeline, mode, t, np.array(x, float))
        decay = straight = inf
        for count in range(STEPS):
            decay = flight.decay()
            if decay * (until - t) < LEAST_STEPS * REACH:
                return None
            straight = flight.straight(decay)
            if count >= STEPS - LAST and straight * decay < APART:
                return None
            flight.step(min(LENGTH / decay, straight))
            if flight.has_ended():
                return None
    except (*DOMAIN_ERRORS, np.linalg.LinAlgError):
        return None  # unknown
    near = f"at t = {t:.3g}" if t else "near the start"
    rests = f"the curve is straight for {straight:.2g}" if isfinite(straight) else "to rest"
    return f"{name} is stiff {near}: something decays within {1 / decay:.2g}, {rests}"


class _Flight:
    """A mode's flow and Jacobian as arrays, with the inputs of a time, and a point on the way from there."""

    x: Array

    def __init__(self, kernel: Kernel, timeline: Timeline, mode: int, t: float, x: Array) -> None:
        segment = timeline.at(t)
        self._mode, self._jacobian = kernel.bind(mode, segment.data), kernel.jacobian(mode, segment.data)
        self._flow, self._end = self._mode.flow, float(segment.end)
        self.t, self.x = t, x
        self._scales: Array = np.abs(x)
        self._before = self._mode.surfaces(t, *x.tolist())
        self._left: set[int] | None = None

    def flow(self, t: float, x: Array) -> Array:
        return np.array(self._flow(t, *x.tolist()), float)

    def jacobian(self) -> Array:
        return np.array(self._jacobian(self.t, *self.x.tolist()), float).reshape(len(self.x), len(self.x))

    def has_ended(self) -> bool:
        """Whether the flight from the start of the way has ended; surfaces that the state was on do not end it."""
        place = self.t, *self.x.tolist()
        now, fires = self._mode.surfaces(*place), self._mode.conditions
        if self._left is None:
            both = enumerate(zip(self._before, now, strict=True))
            self._left = {k for k, (a, b) in both if abs(a) <= ON * abs(b - a)}
        crossed = (k for k, r in enumerate(now) if r > 0 and k not in self._left)
        return self.t > self._end or any(k >= len(fires) or fires[k](*place)[0] for k in crossed)

    def decay(self) -> float:
        """The fastest decay that does not oscillate faster than it decays; 0 where nothing decays."""
        values = np.linalg.eigvals(self.jacobian())
        return float(max((-v.real for v in values if v.real < 0 and abs(v.imag) <= -v.real), default=0.0))

    def step(self, h: float) -> None:
        """Make a step of ROS2 (Verwer, Spee, Blom, Hundsdorfer: A second-order Rosenbrock method, 1999)."""
        share, f = 1 - 0.5**0.5, self.flow(self.t, self.x)
        matrix: Array = np.eye(len(self.x)) - share * h * self.jacobian()
        late: Array = share * 128 * (self.flow(self.t + h / 128, self.x) - f)  # share h df/dt
        first: Array = _solve(matrix, f + late)
        second: Array = _solve(matrix, self.flow(self.t + h, self.x + h * first) - 2 * first - late)
        self.x = self.x + 1.5 * h * first + 0.5 * h * second
        self.t += h
        self._scales = np.maximum(self._scales, np.abs(self.x))

    def straight(self, decay: float) -> float:
        """For how long the curve stays within a hundredth of the scales of its tangent."""
        f, ahead = self.flow(self.t, self.x), 0.01 / decay
        bend = np.abs(self.flow(self.t + ahead, self.x + ahead * f) - f) / ahead
        bent, sizes = bend > 0, np.maximum(self._scales, np.abs(f) / decay)
        return float(np.sqrt(0.02 * np.min(sizes[bent] / bend[bent]))) if np.any(bent) else inf


def _solve(matrix: Array, right: Array) -> Array:
    return np.array(np.linalg.solve(matrix, right), float)
