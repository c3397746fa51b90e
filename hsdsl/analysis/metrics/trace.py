"""An execution as a curve: its pieces of positive length, each a polynomial, in float64.

Of several transitions at one instant only the last value counts, so arcs that take no time are left out, except for
the value at the very end, which is a last piece of no length.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hsdsl.analysis.metrics.bernstein import sizes
from hsdsl.analysis.metrics.rounding import UNIT
from hsdsl.engine.execution import Array, Execution


@dataclass(frozen=True, eq=False)
class Trace:
    """An execution's n pieces in time order, the last of no length; each other one starts where the one before it ends.

    The w columns are ``names``: states of all modes of all compared curves; 0 where a mode lacks one. ``mode`` indexes
    ``modes``, each a name and the columns of its states. ``jump`` counts the transitions before a piece. ``strip`` is
    the index of the transition that ends a strip, -1 where the state flows, and ``edges`` names each transition's edge.
    ``coefficients`` (n, p + 1, w) are by powers of s in [0, 1]; ``depth`` (n, 2) is that in the strip at start and end.
    """

    names: tuple[str, ...]
    start: Array
    end: Array
    mode: Array
    modes: tuple[tuple[str, tuple[int, ...]], ...]
    jump: Array
    strip: Array
    edges: tuple[str, ...]
    coefficients: Array
    depth: Array

    def __len__(self) -> int:
        return len(self.start)

    def equals(self, other: Trace) -> bool:
        """Whether the two are one curve, number by number."""
        if (self.names, self.modes, len(self)) != (other.names, other.modes, len(other)):
            return False
        names = ("start", "end", "mode", "coefficients", "depth")
        same = (np.array_equal(getattr(self, name), getattr(other, name)) for name in names)
        return all(same) and self._strips() == other._strips()

    def _strips(self) -> list[str]:
        numbers: list[int] = self.strip.tolist()
        return [self.edges[k] if k >= 0 else "" for k in numbers]

    @cached_property
    def rounding(self) -> Array:
        """How far rounding may move any point of each piece that is computed from its coefficients.

        The share of a piece and the shifted polynomial take some 8 p roundings of numbers that add up to no more than
        the coefficients but the first, and p that are added to the first. Where nothing moves nothing is rounded.
        """
        first = np.sqrt(np.sum(self.coefficients[:, 0] ** 2, axis=1))
        added = (self.coefficients.shape[1] + 4) * UNIT * first
        return self.roughness + np.where(self.roughness > 0, added, 0.0)

    @cached_property
    def roughness(self) -> Array:
        """The same for differences of points, to which the first coefficient adds nothing."""
        return (8 * self.coefficients.shape[1] + 16) * UNIT * sizes(self.coefficients[:, 1:])

    def find(self, times: Array) -> Array:
        """Return the piece that begins at or holds each time, seen from the right."""
        return np.searchsorted(self.start, times, side="right") - 1

    def share(self, pieces: Array, times: Array) -> Array:
        """Return how far through its piece each time is, from 0 to 1."""
        length = self.end[pieces] - self.start[pieces]
        passed = times - self.start[pieces]
        return np.where(length > 0, passed / np.where(length > 0, length, 1.0), 0.0)

    def depths(self, pieces: Array, share: Array) -> Array:
        """Return the depth at a share of each piece."""
        ends: Array = self.depth[pieces]
        return ends[:, 0] * (1 - share) + ends[:, 1] * share


def names_of(executions: Sequence[Execution]) -> tuple[str, ...]:
    """Return the states of all executions, each name once."""
    return tuple(dict.fromkeys(name for execution in executions for name in execution.states))


def trace(execution: Execution, names: Sequence[str], instants: bool = False) -> Trace:
    """Make a curve of an execution; ``names`` are the columns, ``instants`` keeps the arcs that take no time."""
    table = execution.arc_table
    times = np.asarray(execution.times, dtype=float)
    arc_of = np.repeat(np.arange(len(execution.arcs)), [arc.last - arc.first + 1 for arc in execution.arcs])
    rows = np.flatnonzero((times[1:] > times[:-1]) & (arc_of[1:] == arc_of[:-1]))
    still = [arc.last for arc in execution.arcs[:-1] if instants and times[arc.first] == times[arc.last]]
    pieces = np.sort(np.concatenate([rows, np.array([*still, len(times) - 1], dtype=int)]))
    followers = pieces + np.isin(pieces, rows)
    arcs = arc_of[pieces]
    layouts = list(dict.fromkeys((arc.mode, arc.states) for arc in execution.arcs))
    mode_of = np.array([layouts.index((arc.mode, arc.states)) for arc in execution.arcs])[arcs]
    waits = table.kind[arcs] == "strip"
    columns = [tuple(names.index(state) for state in states) for _, states in layouts]
    depth = np.asarray(execution.depth, dtype=float)
    return Trace(
        names=tuple(names),
        start=times[pieces],
        end=times[followers],
        mode=mode_of,
        modes=tuple((mode, place) for (mode, _), place in zip(layouts, columns, strict=True)),
        jump=table.jump[arcs],
        strip=np.where(waits, table.jump[arcs], -1),
        edges=tuple(transition.edge for transition in execution.transitions),
        coefficients=_polynomials(execution, pieces, followers, waits, mode_of, columns, len(names)),
        depth=np.stack([depth[pieces], depth[followers]], axis=1),
    )


def _polynomials(
    execution: Execution,
    pieces: Array,
    followers: Array,
    waits: Array,
    mode_of: Array,
    columns: Sequence[tuple[int, ...]],
    width: int,
) -> Array:
    """Sort the recorded pieces into columns by name; a strip, and the last value, stay where they are."""
    degree = max(1, execution.coefficients.shape[1])
    sorted_by_name = np.zeros((len(pieces), degree + 1, width))
    for number, places in enumerate(columns):
        here = np.flatnonzero(mode_of == number)
        moving = here[~waits[here] & (followers[here] > pieces[here])]
        for own, column in enumerate(places):
            values = np.asarray(execution.values[:, own], dtype=float)
            sorted_by_name[here, 0, column] = values[pieces[here]]
            if execution.coefficients.shape[1] == 0:
                sorted_by_name[moving, 1, column] = values[followers[moving]] - values[pieces[moving]]
            else:
                sorted_by_name[moving, 1:, column] = execution.coefficients[pieces[moving], :, own]
    return sorted_by_name
