"""A recorded run as its verdict sees it: its states, where they may be within the error, and what a screen leaves open.

Routines of its modes are bound again, so that any state of it can be evaluated: a `Place`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import groupby
from math import inf, isfinite
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from hsdsl.base.names import remembered_state, without_memory
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Arithmetic, Number
from hsdsl.base.numbers.bernstein import Array
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.execution import Arc, Execution, Stop, Transition
from hsdsl.engine.integrators.stepper import Polynomial, State
from hsdsl.engine.kernel import ModeKernel
from hsdsl.engine.simulate.problem import Problem, Tails
from hsdsl.engine.simulate.stops import Remark, show, surface_of
from hsdsl.engine.simulate.verdict.errors import SAFE, Errors
from hsdsl.engine.simulate.verdict.screen import Screen, screened
from hsdsl.engine.simulate.verdict.shadow import ErrorsByShadow, shadow_errors
from hsdsl.mathematics.program import ModeProgram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hsdsl.engine.simulate.surfaces import Surfaces

ALONG = 1e-3  # of what a surface may change by: less is along it
GUARD_ROUNDS = 3  # of Newton's method, back onto a guard
TANGENT_UNITS = 64  # of round-off: a rate that counts as zero
FOLLOWED = 16  # transitions at one instant
ROUNDS = 48  # of closing in on a zero along a step
MOST_PARTS = 1 << 15  # of steps, evaluated together


@dataclass(eq=False)
class RunView:
    """What a run recorded, the problem that it is a run of, and how wrong it is.

    Errors are those that a run ``against`` it shows, which is finer. Without one, where steps are chosen by a
    tolerance, the same run is repeated, finer.
    """

    problem: Problem
    execution: Execution
    against: Execution | None = None
    reliable_until: float = inf  # until when the run can be relied on
    followed: bool = False  # whether motion along surfaces counts as the flow of a mode, as for derivatives
    by_shadow: bool = False  # whether errors are those that a shadow run shows
    screen_made: Screen | None = None  # of a run with a shadow run, where it was made already
    remarks: list[Remark] | None = None  # of `misses`, on surfaces passed along steps; None where it has not looked

    def __post_init__(self) -> None:
        self._tails = 0, Tails(self.problem.waits)
        self._bound: dict[tuple[int, Number], ModeKernel] = {}
        self._before: dict[int, tuple[Place, int]] = {}  # of the last few transitions that were requested
        self._nearby: tuple[Any, list[Place]] = None, []  # the last answer of `landed_nearby`

    # What was recorded

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

    def tie(self, t: Number) -> Number:
        """Times closer than this are not told apart; none is known better than the end of the run."""
        return self.problem.tie(max(abs(t), self.execution.times[-1]))

    # States of it

    def place(self, mode: str | int, t: Number, x: State) -> Place:
        """A state of a mode at a time."""
        from hsdsl.engine.simulate.surfaces import Surfaces  # not every verdict looks at places

        index = self._indices[mode] if isinstance(mode, str) else mode
        segment = self.problem.timeline.at(t)
        key = index, segment.start
        if key not in self._bound:
            self._bound[key] = self.problem.kernel.bind(index, segment.data)
        program, kernel = self.problem.program.modes[index], self._bound[key]
        surfaces = Surfaces(kernel, program.edges, tuple(abs(a) for a in x), self.arithmetic)
        return Place(program, kernel, surfaces, t, x, partial(self._enclosing, index, t))

    def _enclosing(self, index: int, t: Number) -> ModeKernel:
        """A mode's routines over intervals."""
        data = [Range(float(value), float(value)) for value in self.problem.timeline.at(t).data]
        return self.problem.kernel.enclosing.bind(index, data)

    def state(self, arc: Arc, row: int) -> State:
        """The state at a row."""
        return tuple(self.execution.values[row][: len(arc.states)].tolist())

    def at_row(self, arc: Arc, row: int) -> Place:
        """The state at a row, with its mode."""
        return self.place(arc.mode, self.times[row], self.state(arc, row))

    def dense_output(self, arc: Arc, row: int) -> Callable[[Number], Place]:
        """The dense output of the step from a row to the next: states by the share of the step."""
        from hsdsl.engine.simulate.surfaces import at

        t, h = self.times[row], self.times[row + 1] - self.times[row]
        x, d = self.state(arc, row), len(arc.states)
        piece: Polynomial = tuple(tuple(c[:d]) for c in self.execution.coefficients[row].tolist())
        if not piece:
            piece = (tuple(b - a for a, b in zip(x, self.state(arc, row + 1), strict=True)),)
        index, end = self.index(arc.mode), self.times[row + 1]
        step = self.place(index, t, x)  # its end belongs to the step's own segment

        def along(s: Number) -> Place:
            time, inner = min(t + s * h, end), at(x, piece, s)
            return replace(step, t=time, x=inner) if time == end else self.place(index, time, inner)

        return along

    def rows_by_mode(self) -> Iterator[tuple[int, tuple[str, ...], NDArray[np.int64]]]:
        """Give modes and states of all arcs of flow, with the rows at which their steps begin."""
        times = np.asarray(self.execution.times, dtype=float)
        ordered = sorted(self.flows, key=lambda arc: (self.index(arc.mode), arc.states, arc.first))
        for (mode, states), arcs in groupby(ordered, key=lambda arc: (self.index(arc.mode), arc.states)):
            if states == self.problem.program.modes[mode].states:  # a final mode flows as the one before it
                rows = np.concatenate([np.arange(arc.first, arc.last) for arc in arcs])
                yield mode, states, rows[times[rows + 1] > times[rows]]

    def pieces_at(self, rows: NDArray[np.int64], n: int) -> tuple[Array, Array]:
        """The states at rows, and coefficients of the pieces that leave them, straight ones where there are none."""
        values = np.asarray(self.execution.values[rows, :n], dtype=float)
        powers = np.asarray(self.execution.coefficients[rows, :, :n], dtype=float)
        if powers.shape[1] == 0:
            powers = (np.asarray(self.execution.values[rows + 1, :n], dtype=float) - values)[:, None, :]
        return values, np.nan_to_num(powers)

    def data_at(self, times: Array) -> Array:
        """Parameters and input segments at times, one row where they are the same for all."""
        segments = self.problem.timeline.segments
        if len(segments) == 1:
            return np.array([segments[0].data], dtype=float)
        starts = np.array([float(s.start) for s in segments])
        which = np.maximum(np.searchsorted(starts, times, "right") - 1, 0)
        return np.array([s.data for s in segments], dtype=float)[which]

    # Its transitions

    def before(self, made: Transition) -> tuple[Place, int]:
        """The state that a transition was made from, and the surface that it crossed."""
        if made.index not in self._before:
            if len(self._before) > FOLLOWED:
                self._before.clear()
            place = self.place(made.source, made.time, tuple(made.before.values()))
            self._before[made.index] = place, self.edge_at(place, made.edge, made.entry)
        return self._before[made.index]

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

    def is_on(self, place: Place, k: int) -> bool:
        """Whether a state is on surface k, to round-off or what that changes by in a tie."""
        near = max(place.roundoff_bound(k), abs(place.rate(k)) * 2 * self.tie(place.t))
        return bool(abs(place.value(k)) <= near)

    def row_before(self, made: Transition) -> int:
        """The last row before a transition."""
        arc = self.execution.arcs[int(np.searchsorted(self.execution.arc_table.jump, made.index, "right")) - 1]
        return arc.last

    def tails_before(self, made: Transition) -> Tails:
        """What waits after the first of each queue where a transition begins."""
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

    def after(self, chain: Sequence[Transition], x: State) -> Place:
        """Where a state lands that makes some transitions."""
        tails = self.tails_before(chain[0]).copy()
        for made in chain:
            x = self.landed(made, tails, x)
        return self.place(chain[-1].target, chain[-1].time, x)

    def landed_nearby(self, chain: Sequence[Transition], error: State) -> list[Place]:
        """Where states land that an error moves along the guard of the first of some transitions; none of too many."""
        asked = chain[0].index, len(chain), error
        if self._nearby[0] != asked:
            before, edge = self.before(chain[0])
            near = before.moved_by(error) if chain[0].entry else before.along_guard(edge, error)
            self._nearby = asked, [self.after(chain, x) for x in near] if len(chain) <= FOLLOWED else []
        return self._nearby[1]

    def remembered_alike(self, chain: Sequence[Transition], names: Sequence[str], error: State) -> bool:
        """Whether some states are memory of events that is the same after transitions from all states nearby."""
        target = self.problem.program.modes[self.index(chain[-1].target)]
        waiting = {target.states[i] for queue in target.queues for i in queue.values}  # these have errors
        if without_memory(names) or any(map(remembered_state, names)) or waiting.intersection(names):
            return False
        near = (dict(zip(at.mode.states, at.x, strict=True)) for at in self.landed_nearby(chain, error))
        return len({tuple(x[name] for name in names) for x in near}) == 1

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

    # What a screen leaves undecided of it

    @cached_property
    def screen(self) -> Screen | None:
        """What a compiled screen leaves undecided; None where there is none."""
        if self.by_shadow:
            screen = self.screen_made or screened(self.execution, None)
        else:
            screen = self.errors and screened(self.execution, self.errors.finer)
        return None if screen is None or screen.undecided("parted", "accumulation") else screen

    def undecided(self, *words: str) -> bool:
        """Whether the screen leaves any of the hypotheses that are named undecided."""
        return self.screen is None or self.screen.undecided(*words)

    def undecided_flows(self, name: str) -> list[Arc]:
        """Those of the reliable arcs of flow that the screen leaves undecided."""
        marked = self.screen and self.screen.arcs(name)
        if marked is not None and not marked:
            return []
        flows = (arc for arc in self.flows if self.times[arc.first] < self.reliable_until)
        return [arc for arc in flows if marked is None or arc.first in marked]

    def undecided_transitions(self, mark: int) -> list[Transition]:
        """The transitions that the screen leaves undecided."""
        if self.screen is None:
            return self.reliable_transitions
        marked = np.flatnonzero(self.screen.marked("crossing") & mark).tolist()
        return [self.transitions[index] for index in marked]

    @property
    def reliable_transitions(self) -> list[Transition]:
        """The transitions made until the run becomes unreliable: the last one may be why."""
        return [made for made in self.transitions if made.time <= self.reliable_until]

    # Its errors

    @cached_property
    def errors(self) -> Errors | None:
        """How wrong the run is, by a shadow or a finer run; None where steps are fixed and no finer one is given."""
        tolerance, finer = self.problem.settings.tolerance, self.against
        tie = float(self.tie(self.execution.times[-1]))
        known = float(tolerance or 0), float(self.arithmetic.unit), tie, self
        if self.by_shadow:
            shadow = self.screen.shadow_errors if self.screen else shadow_errors(self.problem, self.execution)
            return ErrorsByShadow(self.execution, self.execution, *known, shadow=shadow)
        if finer is None and tolerance is not None:
            finer = self.execution.finer
        if finer is None or finer.stop.reason == "interrupted":
            return None
        return Errors(self.execution, finer, *known)

    def error(self, place: Place, row: int) -> State:
        """How wrong each state of a place may be that is reached at a row."""
        assert self.errors is not None
        columns = self.errors.columns
        return tuple(float(self.errors.by_row[row, columns[name]]) for name in place.mode.states)

    def safe_error(self, place: Place, row: int) -> State:
        """The same, as many times over as a margin must be."""
        return tuple(SAFE * e for e in self.error(place, row))

    def error_before(self, made: Transition) -> State:
        """The same of the state that a transition was made from."""
        return self.safe_error(self.before(made)[0], self.row_before(made))

    def late(self, t: Number) -> float:
        """How wrong the time of what happens at a time may be, as often as a margin must be."""
        assert self.errors is not None
        return SAFE * self.errors.time_error_at(t)

    def surface_error(self, place: Place, k: int, row: int) -> Number:
        """How much the error may move surface k."""
        assert self.errors is not None
        gradient = place.kernel.gradients[k](place.t, *place.x)
        errors = (self.errors.time_error_at(place.t), *self.error(place, row))
        return sum((abs(g) * e for g, e in zip(gradient, errors, strict=True) if e), self.arithmetic.zero)

    def safe_time_error(self, place: Place, k: int, row: int) -> float:
        """How wrong the time may be at which the step to a row reaches surface k, as often as a margin must be."""
        rate, shift = abs(float(place.rate(k))), SAFE * float(self.surface_error(place, k, row))
        step = float(self.times[row] - self.times[row - 1]) if row else 0.0
        return max(self.late(place.t), shift / rate if rate * step > shift else step)

    def conditions(self, place: Place, k: int, row: int) -> set[bool]:
        """What the condition of edge k is at a place and where the error moves that to."""
        return place.conditions(k, self.safe_error(place, row), self.safe_time_error(place, k, row))

    def may_hold(self, place: Place, k: int, row: int) -> bool:
        """Whether the `if` of surface k, if it has one, holds at a place or at a state that the error moves it to."""
        return not place.has_condition(k) or self.conditions(place, k, row) != {False}

    def roundoff(self, place: Place, k: int, row: int) -> Number:
        """Round-off of surface k at a place, by the largest sizes that the states have had."""
        assert self.errors is not None
        columns = self.errors.columns
        sizes = tuple(float(self.errors.sizes[row, columns[name]]) for name in place.mode.states)
        return replace(place.surfaces, scale=sizes).roundoff_bound(k, place.t, place.x, entry=True)


@dataclass(frozen=True)
class Place:
    """A mode at a time: its routines bound (``enclosing`` binds them over intervals), and one state."""

    mode: ModeProgram
    kernel: ModeKernel
    surfaces: Surfaces
    t: Number
    x: State
    enclosing: Callable[[], ModeKernel]

    def value(self, k: int) -> Number:
        """Surface k."""
        return self.kernel.surfaces(self.t, *self.x)[k]

    def rate(self, k: int) -> Number:
        """How fast surface k rises along the flow."""
        return self.kernel.rates[k](self.t, *self.x)[0]

    def rate_roundoff(self, k: int) -> Number:
        """Below this the rate of surface k counts as zero."""
        gradient, slope = self.kernel.gradients[k](self.t, *self.x), self.kernel.flow(self.t, *self.x)
        terms = (abs(g * f) for g, f in zip(gradient[1:], slope, strict=True))
        return TANGENT_UNITS * self.surfaces.arithmetic.unit * sum(terms, abs(gradient[0]))

    def flow_roundoff(self) -> list[Number]:
        """A bound on the round-off of each component of the flow, also of one that is zero by cancellation; else 0."""
        units = self.surfaces.arithmetic.unit / FLOAT64.unit
        try:
            flow = self.enclosing().flow(*(Range(float(a), float(a)) for a in (self.t, *self.x)))
        except (Undecided, *DOMAIN_ERRORS):
            return [0.0 for _ in self.x]
        widths = [float(f.high - f.low) for f in map(as_range, flow)]
        return [units * width if isfinite(width) else 0.0 for width in widths]

    def roundoff_bound(self, k: int) -> Number:
        """Round-off of surface k."""
        return self.surfaces.roundoff_bound(k, self.t, self.x)

    def moved_by(self, error: State) -> Iterator[State]:
        """The state, and with each component moved by its error either way."""
        yield self.x
        for i, e in enumerate(error):
            for way in (-1, 1) if e else ():
                yield (*self.x[:i], self.x[i] + way * e, *self.x[i + 1 :])

    def along_guard(self, k: int, error: State) -> Iterator[State]:
        """The state moved by the error in each component, and then back onto the guard of edge k."""
        for moved in self.moved_by(error):
            x = moved
            for _ in range(GUARD_ROUNDS):
                x = moved_onto(x, self.kernel.gradients[k](self.t, *x)[1:], self.kernel.surfaces(self.t, *x)[k])
            yield x

    def conditions(self, k: int, error: State, late: float) -> set[bool]:
        """What the condition of edge k is there, and anywhere in the box of the error, so much later or earlier."""
        times = (self.t - late, self.t, self.t + late)
        found = {bool(self.kernel.conditions[k](t, *x)[0]) for x in self.moved_by(error) for t in times}
        if len(found) == 1 and (late or any(error)):
            try:
                found |= {bool(self.enclosing().conditions[k](*self.box(error, late))[0])}
            except (Undecided, *DOMAIN_ERRORS):
                found = {True, False}
        return found

    def box(self, error: Sequence[Number], late: Number) -> list[Range]:
        """Time and states as far away as an error moves them."""
        span = Range(float(self.t - late), float(self.t + late))
        return [span, *(Range(float(x - e), float(x + e)) for x, e in zip(self.x, error, strict=True))]

    def rates_within(self, k: int, error: State, late: float) -> Range:
        """How fast surface k may rise anywhere in the box of the error; everything where that has no value."""
        try:
            return as_range(self.enclosing().rates[k](*self.box(error, late))[0])
        except (Undecided, *DOMAIN_ERRORS):
            return Range(-inf, inf)

    def outranks(self, j: int, k: int, error: State, late: float = 0.0) -> bool:
        """Whether edge j goes before edge k wherever either may be reached: they have one surface.

        It has the higher priority, or on the guard the condition of k does not hold: nowhere else is it reached.
        """
        edges = self.mode.edges
        try:
            if k >= len(edges) or not self.coincide(j, k, error):
                return False
            times = (self.t - late, self.t, self.t + late)
            return edges[j].priority > edges[k].priority or not any(
                self.kernel.conditions[k](t, *x)[0] for x in self.along_guard(k, error) for t in times
            )
        except DOMAIN_ERRORS:
            return False

    def coincide(self, j: int, k: int, error: State) -> bool:
        """Whether surface k is a multiple of surface j around the state, as p >= 1 and 2*p >= 2 are."""
        slopes, others = (self.kernel.gradients[i](self.t, *self.x) for i in (j, k))
        size, product = sum(g * g for g in slopes), sum(g * h for g, h in zip(slopes, others, strict=True))
        if not (size > 0 and product > 0):
            return False
        times = product / size
        for x in self.moved_by(error):
            values = self.kernel.surfaces(self.t, *x)
            near = times * self.surfaces.roundoff_bound(j, self.t, x) + self.surfaces.roundoff_bound(k, self.t, x)
            if not abs(times * values[j] - values[k]) <= near:
                return False
        return True

    def has_condition(self, k: int) -> bool:
        """Whether surface k is that of an edge with an `if`."""
        return k < len(self.mode.edges) and self.mode.edges[k].conditional

    def name(self, k: int) -> str:
        """Surface k for a person."""
        return surface_of(self.mode, k)

    def where(self, k: int) -> str:
        """Surface k and when, for a person."""
        return f"the surface of {self.name(k)} at t = {show(self.t)}"


def moved_onto(x: Sequence[Number], along: Sequence[Number], value: Number) -> State:
    """A point moved along a direction, by what takes something linear with this slope from a value to zero."""
    size = sum(a * a for a in along)
    return tuple(a - value * g / size for a, g in zip(x, along, strict=True)) if size > 0 else tuple(x)


@dataclass(frozen=True)
class Finding:
    """One thing that keeps the theorem from holding, or from being known to hold."""

    kind: str  # those of one kind are named together
    theorem: Literal["left", "unknown"]  # what it makes of the verdict
    sentence: str
    wall: tuple[str, Number] | None = None  # a wall that the run was beyond, and when
