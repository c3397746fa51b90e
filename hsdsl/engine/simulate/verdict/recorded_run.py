"""A recorded run with its modes' routines bound again, so that any state of it can be evaluated."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, Arithmetic, Number
from hsdsl.base.numbers.enclosures import Range
from hsdsl.engine.execution import Arc, Execution, Stop, Transition
from hsdsl.engine.integrators.stepper import Polynomial, State
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.problem import Problem
from hsdsl.engine.simulate.surfaces import Surfaces, at
from hsdsl.engine.simulate.transitions import Tails
from hsdsl.engine.simulate.verdict.place import Place


@dataclass(eq=False)
class RecordedRun:
    """What a run recorded, and the problem that it is a run of."""

    problem: Problem
    execution: Execution

    def __post_init__(self) -> None:
        self._tails = 0, Tails(self.problem.waits)

    @property
    def transitions(self) -> Sequence[Transition]:
        """The run's transitions."""
        return self.execution.transitions

    @property
    def stop(self) -> Stop:
        """How it ended."""
        return self.execution.stop

    @property
    def arithmetic(self) -> Arithmetic:
        """The run's number type."""
        return self.problem.arithmetic

    @cached_property
    def times(self) -> list[Number]:
        """Times of all rows."""
        return self.execution.times.tolist()

    @cached_property
    def flows(self) -> list[Arc]:
        """Arcs of flow that take time."""
        arcs = self.execution.arcs
        return [arc for arc in arcs if arc.kind == "flow" and self.times[arc.last] > self.times[arc.first]]

    @cached_property
    def sizes(self) -> dict[str, float]:
        """The largest size that each state has in the run."""
        return self.execution.sizes()

    @cached_property
    def crossed(self) -> dict[int, int]:
        """The surface whose transition ends an arc, by the arc's last row."""
        found: dict[int, int] = {}
        for arc in self.flows:
            if arc.jump < len(self.transitions):
                made = self.transitions[arc.jump]
                if not made.time > self.times[arc.last] + self.tie(made.time):  # else it ends at a jump of an input
                    found[arc.last] = self.before(made)[1]
        return found

    def arc_of(self, row: int) -> Arc:
        """The arc of the step that begins at a row."""
        return self.flows[bisect_right(self.flows, row, key=lambda arc: arc.first) - 1]

    def index(self, mode: str) -> int:
        """The number of a mode."""
        return self._indices[mode]

    @cached_property
    def _indices(self) -> dict[str, int]:
        return {mode.name: k for k, mode in enumerate(self.problem.program.modes)}

    @cached_property
    def _bound(self) -> dict[tuple[int, Number], ModeKernel]:
        return {}

    def place(self, mode: str | int, t: Number, x: State) -> Place:
        """A state of a mode at a time."""
        index = self._indices[mode] if isinstance(mode, str) else mode
        segment = self.problem.timeline.at(t)
        key = index, segment.start
        if key not in self._bound:
            self._bound[key] = self.problem.kernel.bind(index, segment.data)
        program, kernel = self.problem.program.modes[index], self._bound[key]
        scale = tuple(abs(a) for a in x)
        surfaces = Surfaces(kernel, program.edges, scale, self.arithmetic)
        return Place(program, kernel, surfaces, t, x, partial(self._enclosing, index, t))

    def _enclosing(self, index: int, t: Number) -> ModeKernel:
        """A mode's routines over intervals."""
        data = [Range(float(value), float(value)) for value in self.problem.timeline.at(t).data]
        return self.problem.kernel.enclosing.bind(index, data)

    def before(self, made: Transition) -> tuple[Place, int]:
        """The state that a transition was made from, and the surface that it crossed."""
        place = self.place(made.source, made.time, tuple(made.before.values()))
        return place, self.edge_at(place, made.edge, made.entry)

    def edge_at(self, place: Place, name: str, entry: bool = False) -> int:
        """The edge of a name at a place; of several the closest to its guard, on ``entry`` the furthest beyond.

        Of comparisons of one event that are on their surfaces, the one that rises is crossed.
        """
        found = [k for k, edge in enumerate(place.mode.edges) if edge.name == name]
        if len(found) == 1:
            return found[0]
        if entry:
            return max((k for k in found if not place.mode.edges[k].conditional), key=place.value)
        return min([k for k in found if self._rises(place, k)] or found, key=lambda k: abs(place.value(k)))

    def _rises(self, place: Place, k: int) -> bool:
        """Whether a state is on surface k, which rises there."""
        try:
            return self.is_on(place, k) and bool(place.rate(k) > 0)
        except DOMAIN_ERRORS:
            return False

    def state(self, arc: Arc, row: int) -> State:
        """The state at a row."""
        return tuple(self.execution.values[row][: len(arc.states)].tolist())

    def at_row(self, arc: Arc, row: int) -> Place:
        """The state at a row, with its mode."""
        return self.place(arc.mode, self.times[row], self.state(arc, row))

    def dense_output(self, arc: Arc, row: int) -> Callable[[Number], Place]:
        """The dense output of the step from a row to the next: states by the share of the step."""
        t, h = self.times[row], self.times[row + 1] - self.times[row]
        x, d = self.state(arc, row), len(arc.states)
        piece: Polynomial = tuple(tuple(c[:d]) for c in self.execution.coefficients[row].tolist())
        if not piece:
            piece = (tuple(b - a for a, b in zip(x, self.state(arc, row + 1), strict=True)),)
        index, start, end = self.index(arc.mode), t, self.times[row + 1]

        def along(s: Number) -> Place:
            time = min(t + s * h, end)
            inner = self.place(index, start, x) if time == end else None  # the end belongs to the step's own segment
            place = self.place(index, time, at(x, piece, s))
            return place if inner is None else replace(inner, t=time, x=place.x)

        return along

    def row_before(self, made: Transition) -> int:
        """The last row before a transition."""
        arc = self.execution.arcs[int(np.searchsorted(self.execution.arc_table.jump, made.index, "right")) - 1]
        return arc.last

    def tails_before(self, made: Transition) -> Tails:
        """What waits behind the first of each queue where a transition begins."""
        index, tails = self._tails
        if index > made.index:
            index, tails = 0, Tails(self.problem.waits)
        for earlier in self.transitions[index : made.index] if self.problem.program.queues else ():
            self.landed(earlier, tails)
        self._tails = made.index, tails
        return tails

    def landed(self, made: Transition, tails: Tails, x: State | None = None) -> State:
        """Where a transition leads from its state or another one, while executions wait."""
        place, k = self.before(made)
        x, target = place.x if x is None else x, self.problem.program.modes[place.mode.edges[k].target]
        return tails.advance(place.mode, x, target, place.kernel.resets[k](place.t, *x))

    def cascade(self, made: Transition) -> list[Transition]:
        """The transitions up to one that follow each other with no flow between."""
        chain = [made]
        for k in range(made.index - 1, -1, -1):
            before = self.transitions[k]
            if before.resumed is None or chain[-1].time - before.resumed > self.tie(chain[-1].time):
                break
            chain.append(before)
        return chain[::-1]

    def tied_at_end(self, arc: Arc) -> set[int]:
        """The edge whose transition ends an arc, and those that were tied with it."""
        if arc.last not in self.crossed:
            return set()
        place = self.before(self.transitions[arc.jump])[0]
        names = {self.transitions[arc.jump].edge, *self.transitions[arc.jump].alternatives}
        tied = (k for k, edge in enumerate(place.mode.edges) if edge.name in names)
        return {self.crossed[arc.last], *(k for k in tied if k != self.crossed[arc.last] and self.is_on(place, k))}

    def is_on(self, place: Place, k: int) -> bool:
        """Whether a state is on surface k, to round-off or what that changes by in a tie."""
        near = max(place.roundoff_bound(k), abs(place.rate(k)) * 2 * self.tie(place.t))
        return bool(abs(place.value(k)) <= near)

    def tie(self, t: Number) -> Number:
        """Times closer than this are not told apart; none is known better than the end of the run."""
        return self.problem.tie(max(abs(t), self.execution.times[-1]))
