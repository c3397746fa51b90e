"""What the compiled loop writes to: chunks of columns, and the execution's columns and transitions made of them."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from hsdsl.execution import Arc, Array, Transition
from hsdsl.program import Program
from hsdsl.runtime import tables

LEAST_ROWS, MOST_ROWS = 2048, 2**20


@dataclass(frozen=True)
class Shape:
    """Sizes of one model's rows: states of the largest mode, outputs, the pieces' degree, edges of any mode."""

    width: int
    outputs: int
    degree: int
    edges: int


class Chunks:
    """The chunks of one run; ``table`` is the one that is being written."""

    def __init__(self, table: tables.Chunk, shape: Shape, rows: float) -> None:
        self.table, self._shape = table, shape
        self._full: list[dict[str, Array]] = []
        self._rows = int(min(max(rows, LEAST_ROWS), MOST_ROWS))
        self._open()

    def flush(self) -> None:
        """Keep what was written and open another chunk, twice as large."""
        self._full.append(self._written())
        self._rows = min(2 * self._rows, MOST_ROWS)
        self._open()

    def _open(self) -> None:
        shape, rows = self._shape, self._rows
        arcs, transitions = rows // 2 + 8, rows // 4 + 8
        self._columns: dict[str, Array] = {
            "times": np.empty(rows),
            "values": np.empty((rows, shape.width)),
            "outputs": np.empty((rows, shape.outputs)),
            "depth": np.zeros(rows),
            "pieces": np.zeros((rows, shape.degree, shape.width)),
            "arc": np.empty(arcs, tables.ARC),
            "transition": np.empty(transitions, tables.TRANSITION),
            "before": np.empty((transitions, shape.width)),
            "after": np.empty((transitions, shape.width)),
            "alternatives": np.empty(transitions * shape.edges, np.int32),
        }
        table = self.table
        table.row_room, table.arc_room, table.transition_room = rows, arcs, transitions
        table.rows = table.arcs = table.transitions = table.alternatives_used = 0
        for name, column in self._columns.items():
            setattr(table, name, column.ctypes.data)

    def _written(self) -> dict[str, Array]:
        table = self.table
        rows, transitions = table.rows, table.transitions
        used = dict.fromkeys(("times", "values", "outputs", "depth", "pieces"), rows)
        used |= dict.fromkeys(("transition", "before", "after"), transitions)
        used |= {"arc": table.arcs, "alternatives": table.alternatives_used}
        return {name: column[: used[name]] for name, column in self._columns.items()}

    def whole(self) -> dict[str, Array]:
        """Every column from the start of the run."""
        chunks = [*self._full, self._written()]
        if len(chunks) == 1:
            return chunks[0]
        return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]}


def execution_columns(whole: dict[str, Array], program: Program, states: tuple[str, ...]) -> dict[str, Any]:
    """Make an execution's arrays of whole columns; ``states`` are those the run began with."""
    arcs = tuple(_arcs(whole, program, states))
    width = max(len(arc.states) for arc in arcs)
    pieces = np.zeros_like(whole["pieces"])
    pieces[:-1] = whole["pieces"][1:]  # here a row's piece leads to it, there it leaves it
    return {
        "times": whole["times"],
        "values": np.ascontiguousarray(whole["values"][:, :width]),
        "outputs": whole["outputs"],
        "depth": whole["depth"],
        "coefficients": np.ascontiguousarray(pieces[:, :, :width]),
        "arcs": arcs,
    }


def _arcs(whole: dict[str, Array], program: Program, states: tuple[str, ...]) -> Iterator[Arc]:
    rows = len(whole["times"])
    opened: list[tuple[int, int, int, int]] = whole["arc"].tolist()
    ends = [first - 1 for first, *_ in opened[1:]] + [rows - 1]
    for (first, jump, index, kind), last in zip(opened, ends, strict=True):
        mode = program.modes[index]
        states = mode.states if mode.states or not mode.final else states  # one without a flow has those it is given
        if first <= last:
            yield Arc(mode.name, states, tables.KINDS[kind], jump, first, last)


def transitions_of(whole: dict[str, Array], program: Program) -> Iterator[Transition]:
    """Make the transitions of whole columns."""
    alternatives: list[int] = whole["alternatives"].tolist()
    made: list[tuple[float, float, int, int, int, int]] = whole["transition"].tolist()
    states: list[list[list[float]]] = [whole["before"].tolist(), whole["after"].tolist()]
    used = 0
    for index, (time, resumed, source, number, entry, count) in enumerate(made):
        before, after = states[0][index], states[1][index]
        mode = program.modes[source]
        edge = mode.edges[number]
        ended = resumed != resumed
        yield Transition(
            index=index,
            time=time,
            resumed=None if ended else resumed,
            edge=edge.name,
            source=mode.name,
            target=program.modes[edge.target].name,
            before=dict(zip(mode.states, before, strict=False)),
            after=None if ended else dict(zip(edge.target_states, after, strict=False)),
            alternatives=tuple(mode.edges[k].name for k in alternatives[used : used + count]),
            entry=bool(entry),
        )
        used += count


def grown(visited: tables.Visited, room: int, width: int) -> tuple[Array, ...]:
    """Give a set of visited states memory for ``room`` of them; returns what must be kept alive."""
    memory = np.empty(room, np.int32), np.empty((room, width)), np.zeros(2 * room, np.int64)
    visited.room, visited.count = room, 0
    visited.mode, visited.state, visited.slot = (ctypes.c_void_p(m.ctypes.data) for m in memory)
    return memory
