"""The columns that a compiled run has written, and where they are in memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hsdsl.execution import Array
from hsdsl.runtime import structures

NUMBER = 8  # bytes
RECORDS = {"arc": structures.ARC, "transition": structures.TRANSITION, "note": structures.NOTE}
ARC_NUMBERS, TRANSITION_NUMBERS, NOTE_NUMBERS = (
    record.itemsize // 8 for record in RECORDS.values()
)  # as long as so many
ORDER = (  # in which pack.c puts them
    "times", "values", "outputs", "depth", "coefficients", "arc", "transition", "before", "after", "note",
    "alternatives",
)  # fmt: skip


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


class Where(NamedTuple):
    """Numbers of rows and arcs, sizes of a row, and addresses of columns, for C."""

    rows: int
    arcs: int
    width: int
    degree: int
    outputs: int
    times: int
    values: int
    recorded: int
    pieces: int
    arc: int


class Made(NamedTuple):
    """Numbers of transitions and notes, and addresses of what belongs to transitions, for C."""

    transitions: int
    notes: int
    transition: int
    before: int
    after: int
    alternatives: int


class Gathered:
    """Columns of a long run, as arrays; rows have as many states as the largest mode has that the run was in."""

    def __init__(self, arrays: dict[str, Array], width: int) -> None:
        if width < arrays["values"].shape[1]:
            for name in ("values", "coefficients"):
                arrays[name] = np.ascontiguousarray(arrays[name][..., :width])
        self._arrays = arrays

    def __getitem__(self, name: str) -> Array:
        return self._arrays[name]

    @property
    def notes(self) -> int:
        """How many notes there are."""
        return len(self._arrays["note"])

    @property
    def where(self) -> Where:
        """Where they are."""
        of = self._arrays
        rows, degree, width = of["coefficients"].shape
        places = [of[name].ctypes.data for name in ("times", "values", "outputs", "coefficients", "arc")]
        return Where(rows, len(of["arc"]), width, degree, of["outputs"].shape[1], *places)

    @property
    def made(self) -> Made:
        """Where transitions are."""
        of = self._arrays
        places = [of[name].ctypes.data for name in ("transition", "before", "after", "alternatives")]
        return Made(len(of["transition"]), len(of["note"]), *places)


class Packed:
    """Columns of a short run in one stretch of memory, as ``pack.c`` puts them; arrays are made on first use.

    A dozen arrays take longer to make than many a run.

    Parameters
    ----------
    pack : callable
        Copies the columns to an address, and returns how many states a row has there.
    counts : Counts
    shape : Shape
        With the states of the model's largest mode, of which the run may not have been in one.
    """

    def __init__(self, pack: Callable[[int], int], counts: Counts, shape: Shape) -> None:
        rows, arcs, transitions, notes, alternatives = counts
        by_row = 2 + shape.outputs + shape.width * (1 + shape.degree)
        self._counts, self._shape = counts, shape
        self._memory = np.empty(
            rows * by_row
            + transitions * 2 * shape.width
            + ARC_NUMBERS * arcs
            + TRANSITION_NUMBERS * transitions
            + NOTE_NUMBERS * notes
            + (alternatives + 1) // 2
        )
        self._start = structures.start_of(self._memory)
        self._width = pack(self._start)

    @cached_property
    def _sizes(self) -> tuple[int, ...]:
        """How many numbers each column takes, in the order of `ORDER`."""
        (n, arcs, k, notes, alternatives), w, there = self._counts, self._width, self._shape.width
        by_row = n, n * w, n * self._shape.outputs, n, n * self._shape.degree * w
        records = ARC_NUMBERS * arcs, TRANSITION_NUMBERS * k, k * there, k * there, NOTE_NUMBERS * notes
        return (*by_row, *records, (alternatives + 1) // 2)

    def __getitem__(self, name: str) -> Array:
        place = ORDER.index(name)
        start = sum(self._sizes[:place])
        raw: Array = self._memory[start : start + self._sizes[place]]
        if name in RECORDS:
            return raw.view(RECORDS[name])
        if name == "alternatives":
            return raw.view(np.int32)[: self._counts.alternatives]
        n, k, shape = self._counts.rows, self._counts.transitions, self._shape
        if name in ("values", "outputs"):
            return raw.reshape(n, self._width if name == "values" else shape.outputs)
        if name in ("before", "after"):
            return raw.reshape(k, shape.width)
        return raw.reshape(n, shape.degree, self._width) if name == "coefficients" else raw

    @property
    def notes(self) -> int:
        """How many notes there are."""
        return self._counts.notes

    @property
    def where(self) -> Where:
        """Where they are."""
        n, w, m, degree = self._counts.rows, self._width, self._shape.outputs, self._shape.degree
        times = self._start
        values = times + NUMBER * n
        recorded = values + NUMBER * n * w
        pieces = recorded + NUMBER * n * (m + 1)  # behind the depths
        arc = pieces + NUMBER * n * degree * w
        return Where(n, self._counts.arcs, w, degree, m, times, values, recorded, pieces, arc)

    @property
    def made(self) -> Made:
        """Where transitions are."""
        n, arcs, k, notes, _ = self._counts
        by_row = 2 + self._shape.outputs + self._width * (1 + self._shape.degree)
        transition = self._start + NUMBER * (n * by_row + ARC_NUMBERS * arcs)
        before = transition + NUMBER * TRANSITION_NUMBERS * k
        after = before + NUMBER * k * self._shape.width
        behind = after + NUMBER * (k * self._shape.width + NOTE_NUMBERS * notes)
        return Made(k, notes, transition, before, after, behind)


Columns = Gathered | Packed
