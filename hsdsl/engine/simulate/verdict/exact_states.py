"""What resets make of the errors of a run: states that they set exactly have none, others may be wrong by a kink.

A state without a flow has the value that a reset gave it, as counters, levels and the memory of events have. Where that
reset has one value over all states and times that the errors of the others allow, and rounds nothing to get it, the
state has no error.

Where a reset has a kink within the error, as `max(0, x)` at 0, two runs may be on one side of it and the solution on
the other: their difference shows nothing of that. What the reset is off a straight line there is an error as well,
which resets carry on with its sign. Of executions that wait the queue keeps both beside their values.
"""

from __future__ import annotations

from dataclasses import replace
from math import copysign
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64
from hsdsl.base.numbers.bernstein import Array
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.execution import Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.queues import Tails
from hsdsl.engine.simulate.verdict.agreement import SAFE, Errors
from hsdsl.mathematics.program import ModeProgram

if TYPE_CHECKING:
    from hsdsl.engine.simulate.verdict.run_view import Place, RunView


def errors_by_resets(run: RunView, errors: Errors, wrong: Array) -> Array:
    """Return how wrong states are that are ``wrong`` by so much where resets say nothing; both (rows, states)."""
    still = _without_flow(run) if run.arithmetic is FLOAT64 else frozenset[str]()
    if not still and not any(any(mode.curved) for mode in run.problem.program.modes):
        return wrong
    found, resets = wrong.copy(), _Resets(run, errors, wrong, still)
    for arc in run.execution.arcs:
        resets.follow(arc.jump)
        rows = slice(arc.first, arc.last + 1)
        for name, error in resets.kinked.items():
            column = errors.columns[name]
            found[rows, column] = np.fmax(found[rows, column], abs(error))
        found[rows, [errors.columns[name] for name in resets.known]] = 0.0
    return found


def _without_flow(run: RunView) -> frozenset[str]:
    """The states that flow in no mode."""
    modes = run.problem.program.modes
    moving = {name for mode in modes for name, still in zip(mode.states, mode.still, strict=True) if not still}
    return frozenset(run.execution.states) - moving


class _Resets:
    """States that are ``known`` exactly, and errors by kinks of those that are ``kinked``, after some transitions."""

    def __init__(self, run: RunView, errors: Errors, wrong: Array, still: frozenset[str]) -> None:
        self._run, self._errors, self._wrong, self._still = run, errors, wrong, still
        self._before: list[dict[str, float]] = []  # how wrong states are before each transition, as often as is safe
        self.known = self._at_start()
        self.kinked: dict[str, float] = {}
        modes = run.problem.program.modes
        self._noted = {mode.name: _noted(mode) for mode in modes} if run.problem.program.queues else {}
        waits = {queue.name: len(queue.values) for mode in modes for queue in mode.queues}
        self._tails = Tails(
            {name: [(*w, *[0.0] * (2 * waits[name])) for w in given] for name, given in run.problem.waits.items()}
        )

    def follow(self, jump: int) -> None:
        """Make the transitions up to one."""
        while len(self._before) < jump:
            self._make(self._run.transitions[len(self._before)])

    def _at_start(self) -> frozenset[str]:
        """The states that begin with a number which is not rounded."""
        run, problem = self._run, self._run.problem
        if not self._still:
            return self._still
        data = problem.timeline.at(run.times[0]).data[: len(problem.program.parameters)]
        try:
            values = problem.kernel.enclosing.constant("initial", [Range(float(p), float(p)) for p in data])
        except (Undecided, *DOMAIN_ERRORS):
            return frozenset[str]()
        given = dict(zip(problem.program.initial_states, values, strict=True))
        starts = zip(problem.states, problem.x, strict=True)
        return frozenset(name for name, x in starts if name in self._still and _is(given.get(name), x))

    def _make(self, made: Transition) -> None:
        run, row = self._run, self._run.row_before(made)
        place, k = run.before(made)
        found = {name: float(self._wrong[row, self._errors.columns[name]]) for name in place.mode.states}
        found |= {name: max(found[name], abs(error)) for name, error in self.kinked.items() if name in found}
        self._before.append({name: SAFE * e for name, e in found.items() if name not in self.known})
        target = run.problem.program.modes[place.mode.edges[k].target]
        try:
            after = place.kernel.resets[k](place.t, *place.x) if made.after is not None else ()
        except DOMAIN_ERRORS:
            after = ()
        if len(after) != len(target.states):
            self.known, self.kinked = frozenset[str](), {}
            return
        known = self._known_behind(made, place, k, after)
        off = zip(target.states, self._off(made, place, k, after), strict=True)
        kinked = {name: e for name, e in off if e and name not in known}
        if self._noted:
            x, z = self._notes(place.mode, place.x, self.known, self.kinked), self._notes(target, after, known, kinked)
            z = self._tails.advance(self._noted[place.mode.name], x, self._noted[target.name], z)
            exact, errors = z[(d := len(target.states)) : 2 * d], z[2 * d :]
            known = frozenset(name for name, e in zip(target.states, exact, strict=True) if e)
            kinked = {name: float(e) for name, e in zip(target.states, errors, strict=True) if e}
        self.known, self.kinked = known, kinked

    @staticmethod
    def _notes(mode: ModeProgram, x: State, known: frozenset[str], kinked: dict[str, float]) -> State:
        exact = (float(name in known) for name in mode.states)
        return (*x, *exact, *(kinked.get(name, 0.0) for name in mode.states))

    def _error(self, made: Transition) -> State:
        """How wrong the states may be that a transition is made from."""
        before = self._before[made.index]
        return tuple(before.get(name, 0.0) for name in self._run.before(made)[0].mode.states)

    def _known_behind(self, made: Transition, place: Place, k: int, after: State) -> frozenset[str]:
        """The states that are known behind a reset; of those of queues, in the execution that it makes wait."""
        run, edge = self._run, place.mode.edges[k]
        changed = {edge.target_states[i] for i in edge.changes} & self._still
        names = (self.known - changed) & frozenset(edge.target_states)
        if changed:
            late = SAFE * self._errors.time_error_at(made.time)
            chain = run.cascade(made)
            try:
                values = place.enclosing().resets[k](*place.box(self._error(made), late))
                results = zip(edge.target_states, values, after, strict=True)
                exact = {name for name, value, x in results if name in changed and _is(value, x)}
                error = self._error(chain[0])
                names |= exact | {x for x in changed - exact if run.remembered_alike(chain, [x], error)}
            except (Undecided, *DOMAIN_ERRORS):
                pass
        return names

    def _off(self, made: Transition, place: Place, k: int, after: State) -> list[float]:
        """How wrong the results of a reset are by its own kinks and by those before."""
        off, by = [0.0] * len(after), [self.kinked.get(name, 0.0) for name in place.mode.states]
        try:
            if any(by):
                moved = place.kernel.resets[k](place.t, *(x + e for x, e in zip(place.x, by, strict=True)))
                off = [float(a - r) for a, r in zip(moved, after, strict=True)]
            if place.mode.curved[k]:
                bent = self._bent(made, place, k, after)
                off = [e + copysign(b, e) for e, b in zip(off, bent, strict=True)]
        except DOMAIN_ERRORS:
            pass
        return off

    def _bent(self, made: Transition, place: Place, k: int, after: State) -> list[float]:
        """By how much the error of one state, or of the time, may take the results of a reset off a straight line."""
        error, late = self._error(made), SAFE * self._errors.time_error_at(made.time)
        flown = not made.entry and len(self._run.cascade(made)) == 1
        near = [(place.t, x) for x in (place.along_guard(k, error) if flown else place.moved_by(error))][1:]
        near += [(place.t - late, place.x), (place.t + late, place.x)]
        ends = [place.kernel.resets[k](t, *x) for t, x in near]
        bent = [0.0] * len(after)
        for one, other in zip(ends[::2], ends[1::2], strict=True):
            apart = (abs(float((a - r) + (b - r))) / SAFE for a, b, r in zip(one, other, after, strict=True))
            bent = list(map(max, bent, apart))
        return bent


def _noted(mode: ModeProgram) -> ModeProgram:
    """A mode with two more states for each: whether it is known, and its error by kinks; queues keep them as values."""
    d, queues = len(mode.states), mode.queues
    notes = (replace(q, values=(*q.values, *(n * d + i for n in (1, 2) for i in q.values))) for q in queues)
    return replace(mode, states=3 * mode.states, queues=tuple(notes))


def _is(value: Any, x: Any) -> bool:
    """Whether a range is one number, and which."""
    found = as_range(value)
    return bool(found.low == found.high == x)
