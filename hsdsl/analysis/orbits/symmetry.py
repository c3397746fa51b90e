"""Directions in which states may shift and nothing changes, as the place of a runner and of its foot together do.

From a start that is shifted along such a direction everything is shifted by constants: the derivatives of the states
along it stay the same on each arc and come back as they began, and no transition moves in time. An orbit closes but for
these shifts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hsdsl.analysis.orbits.section import Return
from hsdsl.analysis.sensitivity.state_names import derivative_name, own, shift_name
from hsdsl.engine.execution import Array

SYMMETRY = 1e-9  # relative to the sizes of states: what changes by less does not


@dataclass(frozen=True)
class Symmetry:
    """The directions of a section's states, one a row; each has 1 for a state of its own, where the others have 0."""

    directions: Array

    @property
    def leading(self) -> list[int]:
        """The state of each direction's own, its first."""
        return [int(np.flatnonzero(way)[0]) for way in self.directions]

    @property
    def drifting(self) -> list[int]:
        """All states that a shift moves."""
        return np.flatnonzero(np.any(self.directions != 0, axis=0)).tolist()

    def kept(self, count: int) -> list[int]:
        """Of so many states, phases and parameters those that are no direction's own."""
        return [k for k in range(count) if k not in self.leading]

    def without_shifts(self, rows: Array) -> Array:
        """What is kept of rows, one a state, after a shift has brought each direction's own state back."""
        kept, n = self.kept(len(rows)), self.directions.shape[1]
        shifts = np.zeros((len(self.leading), len(rows)))
        shifts[:, :n] = self.directions
        return rows[kept] - shifts[:, kept].T @ rows[self.leading]


def symmetry(passage: Return, sizes: Array) -> Symmetry:
    """The symmetry of a passage, by its derivatives; ``sizes`` are those of the section's states."""
    rows = np.vstack(list(_changes(passage, sizes)))
    rows /= np.maximum(1.0, np.max(np.abs(rows), axis=1, keepdims=True, initial=0.0))
    ways = np.linalg.svd(rows, full_matrices=False)[2]
    free = _reduced(ways[np.max(np.abs(rows @ ways.T), axis=0, initial=0.0) < SYMMETRY])
    return Symmetry(free * sizes / sizes[Symmetry(free).leading][:, None])


def _changes(passage: Return, sizes: Array) -> Iterator[Array]:
    """What a shift of each of the section's states changes, relative to sizes: rows that are zero along a symmetry."""
    n, run, table = len(sizes), passage.execution, passage.execution.arc_table
    lasts = passage.time or 1.0
    by = passage.sensitivity.wrt[:n]
    known = dict(zip((label.removeprefix("initial.") for label in by), sizes.tolist(), strict=True))
    yield (passage.slopes[:n, :n] - np.eye(n)) * sizes / sizes[:, None]
    yield passage.slopes[n:, :n] * sizes / lasts
    arc = np.repeat(np.arange(len(table.first)), np.diff(table.first, append=len(run.times)))
    for number, states in enumerate(table.layouts):
        rows = np.flatnonzero((run.times <= passage.time) & (table.layout[arc] == number))
        if len(rows):
            values = run.values[rows].astype(float)
            moved = values - run.values[table.first[arc[rows]]].astype(float)
            yield _columns(values, states, [shift_name(label) for label in by]) * sizes / lasts
            for x in own(states):
                size = known.get(x) or float(np.max(np.abs(values[:, states.index(x)]))) or 1.0
                yield _columns(moved, states, [derivative_name(x, label) for label in by]) * sizes / size


def _columns(values: Array, states: tuple[str, ...], names: list[str]) -> Array:
    """The columns of states with these names; one that the augmented system leaves out is zero."""
    found = np.zeros((len(values), len(names)))
    for k, name in enumerate(names):
        if name in states:
            found[:, k] = values[:, states.index(name)]
    return found


def _reduced(rows: Array) -> Array:
    """Rows in echelon form: each with 1 in a column of its own."""
    rows, done = rows.copy(), 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        best = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[best, column]) < SYMMETRY:
            continue
        rows[[done, best]] = rows[[best, done]]
        rows[done] /= rows[done, column]
        others = np.arange(len(rows)) != done
        rows[others] -= np.outer(rows[others, column], rows[done])
        done += 1
    return np.where(np.abs(rows) < SYMMETRY, 0.0, rows)[:done]
