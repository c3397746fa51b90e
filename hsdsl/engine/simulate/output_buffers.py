"""What the compiled loop writes to: chunks of columns, and the execution's arcs and transitions made of them."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from hsdsl.base.limits import DEFAULT
from hsdsl.engine.execution import Arc, Array, Transition
from hsdsl.engine.execution.records import Records
from hsdsl.engine.runtime import structures
from hsdsl.engine.simulate.columns import Columns, Counts, Gathered, Packed, Shape, StateLayouts
from hsdsl.engine.simulate.review import Review
from hsdsl.mathematics.program import Program

LEAST_ROWS, MOST_ROWS = 2048, 2**20
MOST_KEPT = 2**23  # bytes of a chunk that the next run may use again
FEWEST_ROWS = 512  # of a first chunk that is as small as that
LARGEST_PAGE = 2**21  # bytes that become memory together
BY_ROW = ("times", "values", "outputs", "depth")
BY_TRANSITION = ("transition", "before", "after")


Sink = Callable[[dict[str, Array]], Any]


class OutputBuffers:
    """The chunks of one run; ``table`` is the one that is being written.

    A small one that is enough for its run is copied from and used again.
    """

    def __init__(self, table: Any, shape: Shape) -> None:
        self.table, self._shape, self._row_bytes = table, shape, shape.row_bytes
        self._full: list[dict[str, Array]] = []
        self._rows = 0  # of the chunk that is there
        self._before = 0  # rows of a run that needed more than one chunk
        self._memory, self._taken = DEFAULT.memory, 0  # bytes that the chunks of a run may take, and do
        self.full = False
        self.sink: Sink | None = None  # takes what is written, which then is not kept
        self.review: Review | None = None
        self._passed, self._mode = 0, 0  # rows of earlier chunks, and the mode of the last one
        small = MOST_KEPT // self._row_bytes
        self._least = small if FEWEST_ROWS <= small < LEAST_ROWS else LEAST_ROWS

    def clear(self, rows: float, memory: int, review: Review | None = None) -> None:
        """Make ready for a run that may write about so many rows, and keep so many bytes of them."""
        self._memory, self._taken, self.full = memory, 0, False
        if review is not None or self.review is not None:
            self.review, self._passed = review, 0
            self._stop_at_review()
        if max(rows, self._before, self._least) <= self._rows:
            self.table.blank = 0
            return
        room = min(max(rows, self._before), MOST_ROWS, memory // self._row_bytes)
        room = max(room, self._least)
        if room > self._rows:
            try:
                self._open(int(room))
            except MemoryError:
                self._open(self._least)

    def flush(self) -> None:
        """Keep what was written and open another chunk, twice as large; a small one where no more may be kept."""
        self._look()
        if self.sink is not None:
            self.sink(self._written())
            return self._reset()
        written, rows = self._written(), max(1, self.counts.rows)
        taken = sum(column.nbytes for name, column in written.items() if name != "pieces") + self._steps(written)
        self._taken += taken
        self._full.append(written)
        left = (self._memory - self._taken) * rows // taken
        self.full = left < min(LEAST_ROWS, self._rows)
        try:
            self._open(LEAST_ROWS if self.full else min(2 * self._rows, MOST_ROWS, left))
        except MemoryError:
            self.full = True
            self._open(LEAST_ROWS)

    def _steps(self, written: dict[str, Array]) -> int:
        """Bytes of the pages that pieces are written to: nothing leads to the first row of an arc."""
        rows, size = len(written["times"]), written["pieces"][0].nbytes
        before = sum(len(chunk["times"]) for chunk in self._full)
        leads = np.ones(rows + 1, bool)  # an arc may begin with the row behind them
        leads[written["arc"]["first"] - before] = False
        steps = np.flatnonzero(leads[:rows])
        first, last = steps * size // LARGEST_PAGE, ((steps + 1) * size - 1) // LARGEST_PAGE
        pages = np.sum(last - first + 1) - np.count_nonzero(first[1:] == last[:-1])
        return min(int(pages) * LARGEST_PAGE, written["pieces"].nbytes)

    def rest(self) -> dict[str, Array]:
        """What is in the chunk that is being written."""
        return self._written()

    @property
    def counts(self) -> Counts:
        """How much the chunk that is being written holds."""
        table = self.table
        return Counts(table.rows, table.arcs, table.transitions, table.notes, table.alternatives_used)

    def _open(self, rows: int) -> None:
        shape = self._shape
        arcs, transitions, notes = rows // 2 + 8, rows // 2 + 8, rows // 16 + 8
        notes += rows // 2 * max(0, shape.contacts - 1)  # of each guard that holds a state, where something else jumps
        self._columns: dict[str, Array] = {
            "times": np.empty(rows),
            "values": np.empty((rows, shape.width)),
            "outputs": np.empty((rows, shape.outputs)),
            "depth": np.empty(rows),
            "pieces": np.zeros((rows + 1, shape.degree, shape.width)),  # of memory that is there when it is written
            "arc": np.empty(arcs, structures.ARC),
            "transition": np.empty(transitions, structures.TRANSITION),
            "before": np.empty((transitions, shape.width)),
            "after": np.empty((transitions, shape.width)),
            "alternatives": np.empty(transitions * shape.edges, np.int32),
            "note": np.empty(notes, structures.NOTE),
        }
        table, self._rows = self.table, rows
        table.arc_room, table.transition_room, table.note_room = arcs, transitions, notes
        for name, column in self._columns.items():
            setattr(table, name, column.ctypes.data)
        self._reset()
        table.blank = 1

    def _look(self) -> None:
        """Review the run where its rows are due."""
        rows, arcs = self.counts[:2]
        self._passed += rows
        if self.review is None:
            return
        begun = self._columns["arc"][:arcs]
        begun = begun[begun["first"] < self._passed]
        self._mode = int(begun["mode"][-1]) if len(begun) else self._mode
        if self._passed == self.review.due:
            row: list[float] = self._columns["values"][rows - 1].tolist()
            self.review.look(self._mode, float(self._columns["times"][rows - 1]), row)

    def _stop_at_review(self) -> None:
        due = self._rows if self.review is None else self.review.due - self._passed
        self.table.row_room = min(self._rows, due)

    def _reset(self) -> None:
        self._stop_at_review()
        table = self.table
        table.rows = table.arcs = table.transitions = table.notes = table.alternatives_used = table.blank = 0

    def _written(self) -> dict[str, Array]:
        rows, arcs, transitions, notes, alternatives = self.counts
        used = {name: self._columns[name][:rows] for name in BY_ROW}
        used |= {name: self._columns[name][:transitions] for name in BY_TRANSITION}
        used["pieces"] = self._columns["pieces"][: rows + 1]
        used["arc"] = self._columns["arc"][:arcs]
        used["note"] = self._columns["note"][:notes]
        used["alternatives"] = self._columns["alternatives"][:alternatives]
        return used

    def whole(self, pack: Callable[[int], int], size: int, layouts: StateLayouts) -> Columns:
        """Take away every column from the start of the run, or copy them where the chunk can be used again.

        ``pieces`` become ``coefficients``: while a run is under way a row's piece leads to it, in an execution it
        leaves it. ``pack`` copies the chunk to an address, where it takes ``size`` numbers.
        """
        if not self._full and self._rows * self._row_bytes <= MOST_KEPT:
            return Packed(pack, size, self._shape)
        chunks = [*self._full, self._written()]
        rows = sum(len(chunk["times"]) for chunk in chunks)
        if len(chunks) > 1:
            self._before = min(rows * 9 // 8, MOST_KEPT // self._row_bytes)
        self._full, self._rows, self._columns = [], 0, {}
        modes = np.concatenate([chunk["arc"]["mode"] for chunk in chunks])
        return Gathered(chunks, rows, layouts.width(layouts.of_arcs(modes)))


def last_arc(whole: Columns, program: Program, layouts: StateLayouts) -> Arc:
    """Make the last arc of whole columns."""
    begun = np.flatnonzero(whole["arc"]["first"] < len(whole["times"]))
    return next(arcs_of(whole, program, layouts, int(begun[-1])))


def arcs_of(whole: Columns, program: Program, layouts: StateLayouts, start: int = 0) -> Iterator[Arc]:
    """Make the arcs of whole columns, from one of them on."""
    rows = len(whole["times"])
    opened: list[tuple[int, int, int, int]] = whole["arc"][start:].tolist()
    ends = [first - 1 for first, *_ in opened[1:]] + [rows - 1]
    found: list[int] = layouts.of_arcs(whole["arc"]["mode"])[start:].tolist()
    names, states, kinds = [mode.name for mode in program.modes], layouts.kinds, structures.KINDS
    for (first, jump, index, kind), last, number in zip(opened, ends, found, strict=True):
        if first <= last:
            yield Arc(names[index], states[number], kinds[kind], jump, first, last)


def transitions_of(whole: Columns, program: Program) -> Records[Transition]:
    """The transitions of whole columns."""
    counts = whole["transition"]["alternatives"]
    used = np.cumsum(counts) - counts if len(whole["alternatives"]) else None
    return Records(len(counts), partial(_transitions, whole, program, used))


def _transitions(whole: Columns, program: Program, used: Array | None, start: int, end: int) -> Iterator[Transition]:
    """Make transitions from ``start`` up to ``end``; ``used`` has where the alternatives of each begin."""
    made: list[tuple[float, float, int, int, int, int]] = whole["transition"][start:end].tolist()
    before: list[list[float]] = whole["before"][start:end].tolist()
    after: list[list[float]] = whole["after"][start:end].tolist()
    for k, (time, resumed, source, number, entry, count) in enumerate(made):
        mode = program.modes[source]
        edge = mode.edges[number]
        ended = resumed != resumed
        others: list[int] = [] if used is None else whole["alternatives"][used[start + k] :][:count].tolist()
        yield Transition(
            index=start + k,
            time=time,
            resumed=None if ended else resumed,
            edge=edge.name,
            source=mode.name,
            target=program.modes[edge.target].name,
            before=dict(zip(mode.states, before[k], strict=False)),
            after=None if ended else dict(zip(edge.target_states, after[k], strict=False)),
            alternatives=tuple(mode.edges[n].name for n in others),
            entry=bool(entry),
        )


def grown(visited: Any, room: int, width: int) -> tuple[Array, ...]:
    """Give a set of visited states memory for ``room`` of them; returns what must be kept alive."""
    memory = np.empty(room, np.int32), np.empty((room, width)), np.zeros(2 * room, np.int64)
    visited.room, visited.count = room, 0
    visited.mode, visited.state, visited.slot = (ctypes.c_void_p(m.ctypes.data) for m in memory)
    return memory
