"""A problem under way: what it has recorded, and the state of its mode."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from hsdsl.base.numbers.arithmetic import Number
from hsdsl.engine.execution import Stop, Transition
from hsdsl.engine.integrators.stepper import Derivatives, State, Stepper, stepper
from hsdsl.engine.integrators.taylor import taylor_stepper
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.scheme.pace import Cascade
from hsdsl.engine.scheme.roots import Roots
from hsdsl.engine.simulate.control import Control
from hsdsl.engine.simulate.input_segments import Segment
from hsdsl.engine.simulate.moving import moved_by_flow, moved_crossing
from hsdsl.engine.simulate.problem import Problem, Tails
from hsdsl.engine.simulate.recorder import OpenArc, Recorder
from hsdsl.engine.simulate.stops import Diagnostics, limit
from hsdsl.engine.simulate.surfaces import Crossing, Surfaces, larger, make_roots
from hsdsl.mathematics.program import ModeProgram

if TYPE_CHECKING:
    from hsdsl.engine.simulate.stalls import Standstill

MOST_DEGREE = 8  # of surfaces along steps where a method asks for less


@dataclass(frozen=True)
class ModeState:
    """Mode and its number, input segment, time and state of a run, ready to flow.

    ``flow`` is the number of what flows, among `Program.flows`: the mode itself, or that with motion along its guards,
    whose ``mode``, ``kernel`` and ``surfaces`` these are then.
    """

    index: int
    flow: int
    mode: ModeProgram
    kernel: ModeKernel
    surfaces: Surfaces
    segment: Segment
    arc: OpenArc
    t: Number
    x: State

    @property
    def sizes(self) -> State:
        """The sizes that the states have had, or those of the numbers that they were computed from on entry."""
        return larger(self.arc.scales, self.surfaces.scale)

    def moved(self, t: Number, x: State) -> ModeState:
        """Return the same place in the mode's life, later."""
        return replace(self, t=t, x=x)


@dataclass(frozen=True, eq=False)
class Run(Problem):
    """A problem under way: everything that stays for a whole run, and what it writes to."""

    control: Control
    recorder: Recorder
    diagnostics: Diagnostics = field(default_factory=Diagnostics)
    tails: Tails = field(default_factory=Tails)

    @cached_property
    def cascade(self) -> Cascade:
        """Where transitions without flow between them have led."""
        return Cascade([self.arithmetic.zero] * max(len(mode.states) for mode in self.program.modes))

    @cached_property
    def roots(self) -> Roots:
        """Room to look for roots of surfaces along steps."""
        method = self.settings.method
        return make_roots(
            max(MOST_DEGREE, method.degree, method.error_order) if method else MOST_DEGREE, self.arithmetic
        )

    def stepper(self, here: ModeState) -> Stepper:
        """The method for the mode that the run is in."""
        method = self.settings.method
        assert method is not None
        if method.kind == "table":
            return stepper(method, len(here.x), self.arithmetic)
        mode = here.flow
        if method.kind == "taylor":
            series = self.kernel.taylor(mode, here.segment.data)
            assert series is not None
            return taylor_stepper(method, series, self.arithmetic)
        known, data = here.mode.jacobian, here.segment.data
        derivatives = Derivatives(
            self.kernel.jacobian(mode, data), here.arc.scales, self.kernel.terms(mode, data), known.places,
            known.elimination, here.mode.measured, known.variation, self.control.first,
        )  # fmt: skip
        return method.stepper(derivatives, self.settings.tolerance, self.arithmetic)

    def place(
        self,
        mode: int,
        states: tuple[str, ...],
        t: Number,
        x: State,
        scale: State,
        before: ModeState | None = None,
        active: set[int] | None = None,
    ) -> ModeState:
        """Enter a mode: bind its routines to the input segment of this time and open an arc.

        A final mode without a flow has the states, and so the outputs, of the mode ``before`` it.
        """
        segment = self.timeline.at(t)
        program, kernel = self.program.modes[mode], self.kernel.bind(mode, segment.data)
        outputs = kernel.outputs if program.states == states else None
        if outputs is None and before is not None and before.mode.states == states:
            outputs = before.kernel.outputs
        self.control.begin_arc(program.name)
        arc = self.recorder.begin(program.name, states, "flow", outputs, t, x)
        surfaces = Surfaces(kernel, program.edges, scale, self.arithmetic, set(active or ()), end=self.settings.until)
        here = ModeState(mode, mode, program, kernel, surfaces, segment, arc, t, x)
        if not self.settings.moves or not t < segment.end or program.states != states:
            return here
        h = min(self.control.within_reach(program.name, self.control.h), segment.end - t)
        arc.values[-1] = self.moved_along(here, t, x, h)
        return here.moved(t, arc.values[-1])

    def moved_along(self, here: ModeState, t: Number, x: State, h: Number) -> State:
        """A state on its way, moved by what round-off of the flow does in a time h."""
        if not self.settings.moves or here.flow != here.index:  # a flow that follows guards is not moved
            return x
        return moved_by_flow(self.kernel, here.index, here.segment.data, t, x, h, here.arc.scales)

    def moved_crossing(self, here: ModeState, crossing: Crossing) -> Crossing:
        """A crossing moved by the round-off of its surface."""
        if not self.settings.moves:
            return crossing
        k, t, q = crossing.edge, crossing.time, crossing.state
        at = moved_crossing(self.kernel, here.index, k, here.segment.data, t, q, here.arc.scales)
        return replace(crossing, state=at)

    def wait(self, here: ModeState, rows: list[tuple[Number, Number]], q: State) -> None:
        """Write a strip: the state waits at q while time and depth pass through ``rows``; inputs go on."""
        mode = here.index

        def outputs(t: Number, *x: Number) -> State:
            return self.kernel.bind(mode, self.timeline.at(t).data).outputs(t, *x)

        end = rows[-1][0]
        further = end > here.segment.end or end == self.settings.until
        self.recorder.strip(here.arc, rows, q, outputs if further else here.arc.outputs)

    def has_flowed(self, t: Number) -> bool:
        """Whether the run has flowed between its last transition and a time."""
        made = self.recorder.transitions
        return not made or made[-1].resumed is None or t > made[-1].resumed

    def standstill(self, here: ModeState) -> Standstill:
        """Where the run cannot go on, in the mode itself where guards hold the state."""
        from hsdsl.engine.simulate.stalls import Standstill  # few runs end so

        segment = here.segment if here.flow == here.index else self.timeline.at(here.t)
        return Standstill(self, here.index, segment, here.t, here.x, here.arc.scales, self.control.h)

    def limit_reached(self, t: Number) -> Stop | None:
        """Stop where one more transition would exceed what the run may make."""
        if len(self.recorder.transitions) < self.settings.max_transitions:
            return None
        return limit(self.settings.max_transitions, t)

    def record(
        self,
        here: ModeState,
        crossing: Crossing,
        resumed: Number | None,
        after: State | None,
        alternatives: tuple[str, ...],
        entry: bool = False,
    ) -> State:
        """Write one transition down; return the state after it, with the first of the executions that wait then."""
        edge = here.mode.edges[crossing.edge]
        after = (
            None
            if after is None
            else self.tails.advance(here.mode, crossing.state, self.program.modes[edge.target], after)
        )
        self.recorder.transitions.append(
            Transition(
                index=len(self.recorder.transitions),
                time=crossing.time,
                resumed=resumed,
                edge=edge.name,
                source=here.mode.name,
                target=self.program.modes[edge.target].name,
                before=dict(zip(here.arc.states, crossing.state, strict=True)),
                after=None if after is None else dict(zip(edge.target_states, after, strict=True)),
                alternatives=alternatives,
                entry=entry,
            )
        )
        return after or ()
