"""Errors of a run, as the same run made finer shows them: by row and state, by transition time, and where they part.

Both runs are compared at equal times since the transition before, in equal arcs of hybrid time, and right before and
after each transition. So the error of a state is free of that of time, which is kept apart. An error counts from where
it is first seen: it never falls again, so a difference that happens to vanish somewhere excuses nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsdsl.base.names import remembered_state
from hsdsl.base.numbers.bernstein import Array
from hsdsl.engine.execution import Execution, Transition
from hsdsl.engine.simulate.moving import ERROR_UNITS

SAFE = 10  # margins below so many errors are named


@dataclass(frozen=True)
class Errors:
    """What two runs of one model show of the coarser one.

    Attributes
    ----------
    run, finer : Execution
    tolerance : float
        Of the run, 0 for fixed steps; no error is smaller, relative to the size of the state, once a step is made.
    unit : float
        Unit round-off of the run's numbers.
    tie : float
        Times closer than this are the same instant.
    by_resets : callable
        ``by_resets(self, wrong)`` says what resets make of errors that are ``wrong`` without them.
    """

    run: Execution
    finer: Execution
    tolerance: float
    unit: float
    tie: float
    by_resets: Callable[[Errors, Array], Array] = lambda _, wrong: wrong

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
        """Behind how many transitions the runs are not alike, for these have other orders; and when they part."""
        return _orders(self.run.transitions, self.finer.transitions, self._slack)

    @property
    def midway(self) -> bool:
        """Whether the runs are compared in the middle of steps too.

        Steps that no tolerance bounds, and those of the relaxed scheme, may be right at their ends by symmetry.
        """
        return self.tolerance == 0 or self.run.scheme != "located"

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
        return (
            float(self.time_errors[min(made, len(self.time_errors)) - 1])
            if made and len(self.time_errors)
            else self.tie
        )

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
        if self.midway:
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
        return self.by_resets(self, np.maximum(self.measured, least))

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
        lengths = np.diff([*table.first, len(self._times)])
        return np.repeat(table.jump, lengths)

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
