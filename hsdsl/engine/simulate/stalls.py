"""When no shorter step helps: how that is noticed, and why it is so, in a sentence; the same of the compiled loop.

A run that closes in on a surface ends there, one whose steps creep says so. Steps that go to and fro across a jump of
the flow are counted, and the jump is looked for by halving the way between two states. A *standstill* is the place of a
run that cannot go on: an expression has no finite value there, or no step leads past it.

The compiled loop returns codes: `add_note` and `stop` give its notes and stops the words of the Python loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import nan

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Number
from hsdsl.engine.execution import Stop
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.integrators.tableau import ButcherTableau
from hsdsl.engine.integrators.taylor import NoSeries, terms
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.runtime import structures
from hsdsl.engine.scheme.pace import (
    MOST_SHORT,
    SHORT,
    Pace,
    count_creeping,
    count_cut_short,
    count_idle,
    count_turns,
    jump_between,
)
from hsdsl.engine.simulate import stops
from hsdsl.engine.simulate.control import StepFailure
from hsdsl.engine.simulate.input_segments import Segment
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.run import ModeState, Run
from hsdsl.engine.simulate.stops import LEAVES, Diagnostics, left_domain, show, slides
from hsdsl.engine.simulate.workspace import Workspace
from hsdsl.mathematics.program import HELD, ModeProgram, Program


def make_pace(run: Run, t: Number) -> Pace:
    """Begin to count the steps of one stretch of flow that do not lead on, from time t."""
    brief = run.settings.until * (SHORT if run.control.tolerance > 0 else 0)
    return Pace(run.arithmetic.unit, brief, t, nan)


def stall_ends(
    pace: Pace, here: ModeState, halvings: int, full: Number, failure: StepFailure,
    t: Number, x: State, t1: Number, z: State,
) -> StepFailure | None:  # fmt: skip
    """Count a step from (t, x) to (t1, z) that was halved because of ``failure``; say what ends the run, if so."""
    small, k = count_cut_short(pace, t, t1, full), failure.surface
    # the surface in the way did not come nearer: its round-off is larger than what the step adds
    still = k is not None and here.kernel.surfaces(t1, *z)[k] == here.kernel.surfaces(t, *x)[k]
    nowhere, creeping = count_idle(pace, small or still), count_creeping(pace, halvings)
    if nowhere or (small and z == x):
        return failure
    return StepFailure("creeping", k) if creeping else None


def across_jump(
    pace: Pace, here: ModeState, t: Number, x: State, slope: State, t1: Number, z: State, end: State
) -> bool:
    """Count a step; say whether it is one of very many across a jump. Smooth flows that turn around are none."""
    if not count_turns(pace, slope, end, len(x)):
        return False
    turned = [k for k, (a, b) in enumerate(zip(slope, end, strict=True)) if a * b < 0]
    return any(jump_between(here.kernel, k, t, x, t1, z) is not None for k in turned)


SHORTEST = 40  # halvings of a step, at which expressions without a value are looked for
NEAR = 8  # doublings and halvings of a step: how far a jump of the flow is looked for


@dataclass(frozen=True)
class Standstill:
    """A place of a run: number of the mode, input segment, time t, state x and its scales; h is the next step."""

    problem: Problem
    index: int
    segment: Segment
    t: Number
    x: State
    scales: Sequence[Number]
    h: Number

    @property
    def mode(self) -> ModeProgram:
        """The mode."""
        return self.problem.program.modes[self.index]

    def not_finite(self, places: Iterable[tuple[Number, State]]) -> Stop:
        """Stop and name the first expression without a finite value at one of ``places``, or in a stage of a step."""
        t, name, unit = self.t, self.mode.name, self.problem.arithmetic.unit
        for place in places:
            if found := self._without_value(*place):
                return Stop("not_finite", t, found)
        if found := self._without_value_in_a_stage():
            return Stop("not_finite", t, found)
        missing = "Taylor series" if self._has_no_series() else "derivatives" if self._has_no_jacobian() else None
        if missing:
            sentence = f"the flow of mode {name} has no {missing} at t = {show(t)}; another method may go on"
            return Stop("not_finite", t, sentence)
        grown = any(a * a * unit > 1 for a in self.x)
        if not grown and (found := self._without_value_later()):
            return Stop("not_finite", t, found)
        if not grown and not t > 0:  # where time has any number of digits
            length = show(self.problem.settings.until)
            sentence = f"no step leads on at t = {show(t)} in mode {name}, however small a part of the run, {length}"
            return Stop("not_finite", t, f"{sentence}: take a shorter one")
        how = "grows beyond all numbers" if grown else "changes faster than time can tell"
        state = self._largest() if grown else self._fastest()
        return Stop("not_finite", t, f"{state} {how} at t = {show(t)} in mode {name}")

    def stuck(self, failure: StepFailure, slope: State) -> Stop:
        """Stop where no step is short enough, and say why; ``slope`` is the flow here."""
        t, x, h, name = self.t, self.x, self.h, self.mode.name
        if failure.kind == "wall" and failure.surface is not None:
            return left_domain(self.mode, failure.surface, t, LEAVES)
        if failure.kind == "slow":
            steps = f"in mode {name} {MOST_SHORT} steps were made within a millionth of the run, up to t = {show(t)}"
            return Stop(
                "step_underflow", t, f"{steps}; fastest is {self._fastest()} take a shorter run or a larger scale"
            )
        instant = self.problem.arithmetic.sqrt(self.problem.arithmetic.unit) * t
        faster_than_time = any(0 < s < instant * abs(f) for s, f in zip(self.scales, slope, strict=True))
        if failure.kind == "not finite" or (failure.kind in ("error", "unsolved", "creeping") and faster_than_time):
            ahead = (
                (t + h / 2**n, tuple(a + h * f / 2**n for a, f in zip(x, slope, strict=True)))
                for n in range(SHORTEST, -1, -1)
            )
            return self.not_finite(ahead)
        if failure.kind in ("error", "unsolved", "creeping", "jump") and (jump := self._jump_near(slope)):
            why = f"{jump}, and the solution is driven back; with a mode for each side, completion: auto follows it"
            return Stop("step_underflow", t, f"no step leads on at t = {show(t)} in mode {name}: {why}")
        why = {
            "unsolved": "the equations of an implicit step are not solved by Newton's method",
            "error": "the error estimate stays above the tolerance, as where a flow jumps",
            "creeping": "steps had to be cut below a thousandth thousands of times in a row",
            "flat": "the gradient of a guard's surface vanishes on it, as that of sign, floor and squares: "
            "write the guard without them, x >= 1 for floor(x) >= 1",
        }.get(failure.kind, "a guard can neither be passed within the relaxation nor avoided")
        return Stop("step_underflow", t, f"no step is short enough at t = {show(t)} in mode {name}: {why}")

    def _without_value(self, t: Number, x: State) -> str | None:
        """Name the first expression without a finite value at a place."""
        for name, routine in self.problem.kernel.expressions(self.index, self.segment.data):
            try:
                finite = all(map(self.problem.arithmetic.isfinite, routine(t, *x)))
            except DOMAIN_ERRORS:
                finite = False
            if not finite:
                return f"{name}, has no finite value at t = {show(t)} ({self._state(x)})"
        return None

    def _without_value_in_a_stage(self) -> str | None:
        """Name the first expression without a value in a stage of the method's steps, the shortest first."""
        method, kernel = self.problem.settings.method, self.problem.kernel
        if not isinstance(method, ButcherTableau):
            return None
        flow = kernel.bind(self.index, self.segment.data).flow
        for n in range(SHORTEST, -1, -1):
            for place in method.places(flow, self.t, self.x, self.h / 2**n):
                if found := self._without_value(*place):
                    others = "a method with other stages may go on, such as dop853, rk4 or heun"
                    return f"{found}, where a stage of {method.name} from t = {show(self.t)} is; {others}"
        return None

    def _without_value_later(self) -> str | None:
        """Name an expression that time alone takes beyond all numbers before the segment ends, and when, by halving."""
        last, later = self.t, self.segment.end
        found = self._without_value(later, self.x)
        while found and last < (middle := (last + later) / 2) < later:
            if sentence := self._without_value(middle, self.x):
                later, found = middle, sentence
            else:
                last = middle
        return found

    def _jump_near(self, slope: State) -> str | None:
        """Name a component of a flow that jumps a few steps ahead or behind, and the place."""
        for step in (way * self.h * 2**n for n in range(-NEAR, NEAR + 1) for way in (1, -1)):
            t1, z = self.t + step, tuple(a + step * f for a, f in zip(self.x, slope, strict=True))
            for kernel, texts in self._flows():
                for k, (state, text) in enumerate(zip(self.mode.states, texts, strict=True)):
                    if jump := jump_between(kernel, k, self.t, self.x, t1, z):
                        share, before, behind = jump
                        point = tuple(a + share * (b - a) for a, b in zip(self.x, z, strict=True))
                        values = f"from {show(before)} to {show(behind)}"
                        return f"the flow of {state}{text} jumps {values} at {self._state(point)}"
        return None

    def _flows(self) -> Iterator[tuple[ModeKernel, Sequence[str]]]:
        """The mode's flow, and those along each of its guards alone, with what to call their components."""
        kernel, data, mode = self.problem.kernel, self.segment.data, self.mode
        yield kernel.bind(self.index, data), [f", {text}," for text in mode.flow_texts]
        if mode.held is None:
            return
        contacts = {edge.contact: edge.name for edge in mode.edges if edge.contact is not None}
        for i, name in contacts.items():
            numbers = (self.problem.arithmetic.zero + (HELD if j == i else 0) for j in sorted(contacts))
            yield kernel.bind(mode.held, (*data, *numbers)), [f" along the guard of {name}"] * len(mode.states)

    def _has_no_series(self) -> bool:
        """Whether the method is Taylor's and cannot expand the flow here."""
        method = self.problem.settings.method
        series = self.problem.kernel.taylor(self.index, self.segment.data)
        if method is None or not method.is_series or series is None:
            return False
        try:
            terms(series, method.order, self.t, self.x)
        except NoSeries:
            return True
        return False

    def _has_no_jacobian(self) -> bool:
        """Whether the method is implicit and the flow has no derivatives here."""
        method = self.problem.settings.method
        if method is None or not method.implicit:
            return False
        try:
            slopes = self.problem.kernel.jacobian(self.index, self.segment.data)(self.t, *self.x)
        except DOMAIN_ERRORS:
            return True
        return not all(map(self.problem.arithmetic.isfinite, slopes))

    def _largest(self) -> str:
        return self._described(max(range(len(self.x)), key=lambda i: abs(self.x[i])))

    def _fastest(self) -> str:
        """The state whose flow is largest against its scale."""
        try:
            slope = self.problem.kernel.bind(self.index, self.segment.data).flow(self.t, *self.x)
        except DOMAIN_ERRORS:
            return self._largest()
        moving = [i for i, s in enumerate(self.scales) if s > 0]
        return self._described(max(moving or [0], key=lambda i: abs(slope[i] / (self.scales[i] or 1))))

    def _described(self, i: int) -> str:
        state, text = self.mode.states[i], self.mode.flow_texts[i]
        return f"{state}, whose flow is {text} and whose value is {show(self.x[i])},"

    def _state(self, x: State) -> str:
        return ", ".join(f"{name} = {show(value)}" for name, value in zip(self.mode.states, x, strict=True))


Note = tuple[int, int, int, int, float, float]  # as in `hs_note`


def add_note(diagnostics: Diagnostics, program: Program, note: Note) -> Stop | None:
    """Add what the loop has noted; returns a stop where that ends the run."""
    notice, index, k, count, time, other = note
    mode, kind = program.modes[index], structures.NOTICES[notice]
    if kind == "unsettled":
        return diagnostics.unsettled(mode.name, k, time)
    if kind == "crowded":
        return diagnostics.crowded(time)
    if kind == "in contact":
        return diagnostics.in_contact(mode.edges[k].name, time, other, bool(count))
    if kind == "replaced":
        return diagnostics.replaced(mode.edges[k], count, time, other)
    if kind == "slides":
        return slides(program.modes[count].edges[k].name, program.modes[count], mode, time)
    if kind == "takes turn":
        return diagnostics.turns.append(mode.edges[k].name)
    if kind == "coupled":
        return diagnostics.coupled(mode.edges[k].name, time)
    return diagnostics.accumulates(mode.edges[k].name, time, other)


def stop(problem: Problem, workspace: Workspace, reason: str, diagnostics: Diagnostics) -> Stop:
    """Say why a run stopped."""
    found = workspace.task.stop
    number, t = int(found.mode), found.time
    mode, segment = problem.program.modes[number], problem.timeline.segments[int(found.segment)]
    if reason in ("until in strip", "until on guard"):
        return stops.reached_in_strip(t, mode.edges[int(found.edge)].name, reason == "until on guard")
    if reason == "reset not finite":
        return stops.reset_not_finite(mode.edges[int(found.edge)], t)
    if reason == "zeno":
        return stops.endless(mode.name, t)
    if reason == "waiting":
        return stops.too_many_wait(mode, mode.queues[int(found.edge)].name, t)
    if reason == "limit":
        return stops.limit(problem.settings.max_transitions, t)
    if reason in ("entered outside", "left"):
        return stops.left_domain(mode, found.surface, t, stops.LEAVES if reason == "left" else stops.ENTERED)
    x, slope, scales = (column[: found.dimension].tolist() for column in workspace.stopped)
    if reason == "accumulated":
        return diagnostics.takes_turns(mode.states, tuple(x), t)
    here = Standstill(problem, number, segment, t, tuple(x), scales, found.h)
    if reason == "here not finite":
        return here.not_finite([(t, here.x)])
    if reason == "step not finite":
        return here.not_finite([(t, here.x), (found.h, tuple(slope))])
    assert reason == "stuck", reason
    surface = None if found.surface < 0 else int(found.surface)
    return here.stuck(StepFailure(structures.FAILURES[int(found.failure)], surface), tuple(slope))
