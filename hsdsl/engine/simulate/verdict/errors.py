"""Errors of a run, as the same run made finer shows them: by row and state, by transition time, and where they part.

Both runs are compared at equal times since the transition before, in equal arcs of hybrid time, and right before and
after each transition. So the error of a state is free of that of time, which is kept apart. An error counts from where
it is first seen: it never falls again, so a difference that happens to vanish somewhere excuses nothing.

Resets change errors. A state without a flow has the value that a reset gave it, as counters, levels and the memory of
events have. Where that reset has one value over all states and times that the errors of the others allow, and rounds
nothing to get it, the state has no error. Where a reset has a kink within the error, as `max(0, x)` at 0, two runs may
be on one side of it and the solution on the other: their difference shows nothing of that. What the reset is off a
straight line there is an error as well, which resets carry on with its sign. Of executions that wait the queue keeps
both beside their values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import copysign
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.base.names import remembered_state
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, FLOAT64, Number
from hsdsl.base.numbers.bernstein import Array
from hsdsl.base.numbers.enclosures import Range, Undecided, as_range
from hsdsl.engine.execution import Execution, Transition
from hsdsl.engine.integrators.stepper import State
from hsdsl.engine.simulate.moving import ERROR_UNITS
from hsdsl.engine.simulate.problem import Tails
from hsdsl.mathematics.program import ModeProgram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hsdsl.engine.simulate.verdict.run_view import Place, RunView

SAFE = 10  # margins below so many errors are named
MOST_NAMED = 10**6


def times(margin: Number) -> str:
    """Write a margin as so many times something, in plain words."""
    if not margin < MOST_NAMED:
        return "more than a million times"
    return f"{round(float(margin)):,} times" if margin >= 100 else f"{abs(float(margin)):.2g} times"


@dataclass(frozen=True)
class Errors:
    """What two runs of one model show of the coarser one.

    With a ``tolerance``, 0 for fixed steps, no error is smaller, relative to the size of the state, once a step is
    made. ``view`` is the run with its problem, by which resets are followed; None where they are not.
    """

    run: Execution
    finer: Execution
    tolerance: float
    unit: float  # round-off of the run's numbers
    tie: float  # times closer than this are the same instant
    view: RunView | None = None

    @cached_property
    def parted(self) -> float | None:
        """From when on the two runs make other transitions, or stop otherwise; None where they never do."""
        a, b = self.run, self.finer
        time = self._orders[1]
        if time is None and (a.stop.reason, a.final.mode) != (b.stop.reason, b.final.mode):
            time = min(float(a.stop.time), float(b.stop.time))
        return time

    @cached_property
    def _orders(self) -> tuple[set[int], float | None]:
        """After how many transitions the runs are not alike, for these have other orders; and when they part."""
        return _orders(self.run.transitions, self.finer.transitions, self._slack)

    @property
    def _slack(self) -> float:
        span = float(self.run.time_span[1])
        strips = float(self.run.settings["relaxation"]) if self.run.scheme == "relaxed" else 0.0
        return SAFE * max(self.tie, self.tolerance * span) + strips

    @cached_property
    def time_errors(self) -> Array:
        """How far times of transitions are apart, up to each of them; shape (transitions in common,)."""
        pairs = zip(self.run.transitions, self.finer.transitions, strict=False)
        apart = [abs(float(one.time - other.time)) for one, other in pairs]
        return np.maximum.accumulate(np.array([self.tie, *apart]))[1:]

    def time_error_at(self, time: Any) -> float:
        """How wrong the time of what happens at a time is."""
        made = int(np.searchsorted(self._made_at, float(time) + self.tie, "right"))
        made = min(made, len(self.time_errors))
        return float(self.time_errors[made - 1]) if made else self.tie

    @cached_property
    def _made_at(self) -> Array:
        return np.array([float(t.time) for t in self.run.transitions])

    @cached_property
    def sizes(self) -> Array:
        """The largest size that each state has had; shape (rows, states)."""
        return np.maximum.accumulate(np.nan_to_num(np.abs(self._values)))

    @cached_property
    def measured(self) -> Array:
        """How far the two runs are apart in each state; shape (rows, states), nowhere falling."""
        found = np.zeros(self._values.shape)
        count = len(self.time_errors) if self.parted is None else int(np.searchsorted(self._made_at, self.parted))
        shift = np.array([0.0, *(self._resumed(self.finer, k) - self._resumed(self.run, k) for k in range(count))])
        apart = self._orders[0]
        rows = np.flatnonzero((self._jumps <= count) & ~np.isin(self._jumps, [*apart]))
        self._compare(found, rows, self._values[rows], self._times[rows] + shift[self._jumps[rows]])
        if self.tolerance == 0 or self.run.scheme != "located":  # steps may be right at their ends alone, by symmetry
            middles = self._times[rows[:-1]] + np.diff(self._times[rows]) / 2
            values = self._at(self.run, self._jumps[rows[1:]], middles)
            self._compare(found, rows[1:], values, middles + shift[self._jumps[rows[1:]]])
        for k, (one, other) in enumerate(zip(self.run.transitions[:count], self.finer.transitions, strict=False)):
            before, after = np.searchsorted(self._jumps, [k, k + 1], "right") - 1
            alike = ((before, one.before, other.before), (after, one.after or {}, other.after or {}))
            for row, a, b in (pair for j, pair in enumerate(alike, k) if j not in apart):
                for name in a.keys() & b.keys():
                    place = row, self.columns[name]
                    found[place] = np.fmax(found[place], abs(float(a[name] - b[name])))
        return np.maximum.accumulate(found)

    @staticmethod
    def _resumed(run: Execution, k: int) -> float:
        made = run.transitions[k]
        return float(made.time if made.resumed is None else made.resumed)

    @cached_property
    def by_row(self) -> Array:
        """How wrong each state is; shape (rows, states), nowhere falling, and never below what one step may do."""
        least = max(self.tolerance, ERROR_UNITS * self.unit) * self.sizes
        least[0] = 0.0
        wrong = np.maximum(self.measured, least)
        return wrong if self.view is None else _errors_by_resets(self.view, self, wrong)

    @cached_property
    def columns(self) -> dict[str, int]:
        """The number of each state."""
        return {name: k for k, name in enumerate(self.run.states)}

    @cached_property
    def unreliable(self) -> dict[str, float]:
        """From when on the error of a state exceeds a tenth of its largest size, for those of which it does."""
        sizes = np.nan_to_num(np.abs(self._values)).max(axis=0, initial=0.0)
        for name, k in self.columns.items():
            if (of := remembered_state(name)) in self.columns:  # what an event remembers has the size of what it is for
                sizes[k] = max(sizes[k], sizes[self.columns[of]])
        beyond = self.by_row * SAFE > sizes
        return {
            name: float(self._times[int(np.argmax(beyond[:, k]))])
            for name, k in self.columns.items()
            if beyond[:, k].any() and self.by_row[-1, k] > 0
        }

    @cached_property
    def _times(self) -> Array:
        return np.asarray(self.run.times, dtype=float)

    @cached_property
    def _jumps(self) -> NDArray[np.int64]:
        table = self.run.arc_table
        return np.repeat(table.jump, np.diff([*table.first, len(self._times)]))

    @cached_property
    def _values(self) -> Array:
        """States by row, not-a-number where the mode has none; shape (rows, states)."""
        values = np.full((len(self._times), len(self.run.states)), np.nan)
        for arc in self.run.arcs:
            rows, columns = slice(arc.first, arc.last + 1), [self.columns[name] for name in arc.states]
            values[rows, columns] = np.asarray(self.run.values[rows, : len(columns)], dtype=float)
        return values

    def _compare(self, found: Array, rows: Any, values: Array, times: Array) -> None:
        """Enter how far the finer run is from values that belong to rows, at times."""
        first, last = map(float, self.finer.time_span)
        inside = (times >= first) & (times <= last)
        rows, values, times = rows[inside], values[inside], times[inside]
        if len(rows):
            apart = np.nan_to_num(np.abs(values - self._at(self.finer, self._jumps[rows], times)))
            found[rows] = np.maximum(found[rows], apart)

    def _at(self, run: Execution, jumps: Any, times: Array) -> Array:
        """States of a run at times, not-a-number where it has not made so many transitions; shape (times, states)."""
        there = np.full((len(times), len(self.columns)), np.nan)
        if len(times):
            samples = run.sample(times)
            for k, name in enumerate(samples.states):
                if name in self.columns:
                    there[:, self.columns[name]] = np.asarray(samples.state_columns[:, k], dtype=float)
            there[samples.jump != jumps] = np.nan
        return there


def _orders(one: Sequence[Transition], other: Sequence[Transition], slack: float) -> tuple[set[int], float | None]:
    """Where transitions within ``slack`` of each other have other orders and meet again, and when sequences part."""
    k, most, apart = 0, min(len(one), len(other)), set[int]()
    while k < most:
        if _what(one[k]) == _what(other[k]):
            k += 1
            continue
        first = min(float(one[k].time), float(other[k].time))
        met = next((j for j in range(k + 1, most) if one[j].target == other[j].target), None)
        if met is None or max(float(one[met].time), float(other[met].time)) - first > slack:
            return apart, first
        apart.update(range(k + 1, met + 1))
        k = met + 1
    rest = one[most:] or other[most:]
    return apart, float(rest[0].time) if rest else None


def _what(made: Transition) -> tuple[str, str, str]:
    return made.source, made.edge, made.target


def _errors_by_resets(run: RunView, errors: Errors, wrong: Array) -> Array:
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
        known = self._known_after(made, place, k, after)
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

    def _known_after(self, made: Transition, place: Place, k: int, after: State) -> frozenset[str]:
        """The states that are known after a reset; of those of queues, in the execution that it makes wait."""
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
                off = [e + copysign(b, e) for e, b in zip(off, self._bent(made, place, k, after), strict=True)]
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
