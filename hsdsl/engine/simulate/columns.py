"""The columns that a compiled run has written: where they are in memory, and which states each of its arcs has."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from hsdsl.engine.execution import Array
from hsdsl.engine.runtime import structures
from hsdsl.mathematics.program import Program

RECORDS = {"arc": structures.ARC, "transition": structures.TRANSITION, "note": structures.NOTE}
ARC_NUMBERS, TRANSITION_NUMBERS, NOTE_NUMBERS = (
    record.itemsize // 8 for record in RECORDS.values()
)  # as long as so many
HEAD = ctypes.sizeof(structures.Record) // 8
COUNTS = Struct("5q")  # the fields that a record begins with
ORDER = (  # in which library.c packs them
    "times", "values", "outputs", "depth", "coefficients", "arc", "transition", "before", "after", "note",
    "alternatives",
)  # fmt: skip
BY_TRANSITION = ("transition", "before", "after", "alternatives")


@dataclass(frozen=True)
class Shape:
    """Sizes of a model's rows: states of the largest mode, outputs, the pieces' degree, edges and contacts of modes."""

    width: int
    outputs: int
    degree: int
    edges: int
    contacts: int

    @property
    def row_bytes(self) -> int:
        """About how much memory a row takes."""
        return 8 * (3 + self.width * (2 + self.degree) + self.outputs)


class Counts(NamedTuple):
    """How much a run has written."""

    rows: int
    arcs: int
    transitions: int
    notes: int
    alternatives: int


class Gathered:
    """Columns of a long run, as arrays; rows have as many states as the largest mode has that the run was in.

    The chunks that the run has written are joined on first use: to copy all of them takes longer than many a run.
    """

    def __init__(self, chunks: list[dict[str, Array]], rows: int, width: int) -> None:
        self._chunks, self.rows, self._width = chunks, rows, width
        self._arrays: dict[str, Array] = {}
        self._lock = RLock()

    def __getitem__(self, name: str) -> Array:
        if name not in self._arrays:
            with self._lock:
                if name not in self._arrays:
                    self._arrays[name] = self._joined("pieces" if name == "coefficients" else name)
        return self._arrays[name]

    def _joined(self, name: str) -> Array:
        """One column; a row's piece, which led to it in the run, leaves it here. Copied parts are let go."""
        first = self._chunks[0][name]
        shape = (*first.shape[1:-1], self._width) if name in ("values", "pieces") else first.shape[1:]
        if name == "pieces":
            return self._joined_pieces(np.zeros((self.rows, *shape)))
        whole, end = np.empty((sum(len(chunk[name]) for chunk in self._chunks), *shape), first.dtype), 0
        for chunk in self._chunks:
            part = chunk.pop(name)
            whole[end : end + len(part)] = part[..., : self._width] if name == "values" else part
            end += len(part)
        return whole

    def _joined_pieces(self, whole: Array) -> Array:
        """The pieces; no step leaves the last row of an arc."""
        flows, end = np.ones((self.rows, 1, 1), bool), 0
        flows[self["arc"]["first"][1:] - 1] = False
        for k, chunk in enumerate(self._chunks):
            part = chunk.pop("pieces")[int(k == 0) : -1, :, : self._width]
            np.copyto(whole[end : end + len(part)], part, where=flows[end : end + len(part)])
            end += len(part)
        return whole

    @property
    def notes(self) -> int:
        """How many notes there are."""
        return len(self["note"])

    @cached_property
    def _record(self) -> Any:
        of, names = self, ("times", "values", "outputs", "coefficients", "arc", *BY_TRANSITION)
        rows, degree, width = of["coefficients"].shape
        counts = (len(of[name]) for name in ("arc", "transition", "note", "alternatives"))
        sizes = rows, *counts, width, degree, of["outputs"].shape[1]
        return structures.Record(*sizes, *(of[name].ctypes.data for name in names))

    @property
    def record(self) -> int:
        """Where the ``hs_record`` is that says where they are."""
        return ctypes.addressof(self._record)


class Packed:
    """Columns of a short run in one stretch of memory, as ``hs_pack`` puts them after their record; arrays are made on
    first use.

    A dozen arrays take longer to make than many a run.

    Parameters
    ----------
    pack : callable
        Copies the columns to an address.
    size : int
        How many numbers they take.
    shape : Shape
        With the states of the model's largest mode, of which the run may not have been in one.
    """

    def __init__(self, pack: Callable[[int], int], size: int, shape: Shape) -> None:
        self._shape, self._memory = shape, np.empty(size)
        self.record = structures.start_of(self._memory)  # where the ``hs_record`` is
        pack(self.record)

    @cached_property
    def _counts(self) -> Counts:
        return Counts(*COUNTS.unpack_from(self._memory.data))

    @cached_property
    def _record(self) -> Any:
        return structures.Record.from_address(self.record)

    @cached_property
    def _sizes(self) -> tuple[int, ...]:
        """How many numbers each column takes, in the order of `ORDER`."""
        (n, arcs, k, notes, alternatives), w, there = self._counts, self._record.width, self._shape.width
        by_row = n, n * w, n * self._shape.outputs, n, n * self._shape.degree * w
        records = ARC_NUMBERS * arcs, TRANSITION_NUMBERS * k, k * there, k * there, NOTE_NUMBERS * notes
        return (*by_row, *records, (alternatives + 1) // 2)

    def __getitem__(self, name: str) -> Array:
        place = ORDER.index(name)
        start = HEAD + sum(self._sizes[:place])
        raw: Array = self._memory[start : start + self._sizes[place]]
        if name in RECORDS:
            return raw.view(RECORDS[name])
        if name == "alternatives":
            return raw.view(np.int32)[: self._counts.alternatives]
        n, k, shape = self._counts.rows, self._counts.transitions, self._shape
        if name in ("values", "outputs"):
            return raw.reshape(n, self._record.width if name == "values" else shape.outputs)
        if name in ("before", "after"):
            return raw.reshape(k, shape.width)
        return raw.reshape(n, shape.degree, self._record.width) if name == "coefficients" else raw

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return self._counts.rows

    @property
    def notes(self) -> int:
        """How many notes there are."""
        return self._counts.notes


Columns = Gathered | Packed


MOST_ARCS, MOST_KEPT = 256, 64


class StateLayouts:
    """The kinds of arcs of all runs of a program that begin with the same states.

    Attributes
    ----------
    kinds : tuple of tuples of str
        The first is what runs begin with.
    of_mode : array of int32, shape (modes,)
        The kind of each mode's arcs; -1 for a final mode without a flow, which keeps the states it is entered with.
    one : bool
        Whether all arcs are of one kind.
    """

    def __init__(self, program: Program, states: tuple[str, ...]) -> None:
        own = [None if mode.final and not mode.states else mode.states for mode in program.modes]
        self.kinds = tuple(dict.fromkeys((states, *(kind for kind in own if kind is not None))))
        self.of_mode = np.array([-1 if kind is None else self.kinds.index(kind) for kind in own], np.int32)
        self.one = len(self.kinds) == 1
        self._kept: dict[bytes, tuple[Array, tuple[str, ...]]] = {}

    def of_arcs(self, modes: Array, before: int = 0) -> Array:
        """Give the kind of each arc by its mode, the one before them being of kind ``before``."""
        found = self.of_mode[modes]
        for i in np.flatnonzero(found < 0):
            found[i] = found[i - 1] if i else before
        return found

    def found(self, modes: Array) -> tuple[Array, tuple[str, ...]]:
        """Give the kind of each arc, and the names of all their states in the order in which they come up.

        The last few answers are kept: runs of one model often pass through the same modes.
        """
        if len(modes) > MOST_ARCS:
            return self._found(modes)
        key = modes.tobytes()
        if key not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            self._kept[key] = self._found(modes)
        return self._kept[key]

    def _found(self, modes: Array) -> tuple[Array, tuple[str, ...]]:
        found = self.of_arcs(modes)
        numbers: list[int] = found.tolist()
        order = dict.fromkeys(numbers)
        return found, tuple(dict.fromkeys(name for kind in order for name in self.kinds[kind]))

    def width(self, found: Array) -> int:
        """Return the most states that arcs of these kinds have."""
        numbers: list[int] = found.tolist()
        return max(len(self.kinds[kind]) for kind in set(numbers))
