"""The columns that a compiled run has written, and where they are in memory."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from hsdsl.execution import Array
from hsdsl.runtime import tables

NUMBER = 8  # bytes
RECORDS = {"arc": tables.ARC, "transition": tables.TRANSITION, "note": tables.NOTE}
ORDER = (  # in which pack.c puts them
    "times", "values", "outputs", "depth", "coefficients", "arc", "transition", "before", "after", "note",
    "alternatives",
)  # fmt: skip


class Where(NamedTuple):
    """What C is told of columns: how many, and the addresses of the first elements."""

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
    def where(self) -> Where:
        """Where they are."""
        of = self._arrays
        rows, degree, width = of["coefficients"].shape
        places = [of[name].ctypes.data for name in ("times", "values", "outputs", "coefficients", "arc")]
        return Where(rows, len(of["arc"]), width, degree, of["outputs"].shape[1], *places)


@dataclass(frozen=True, eq=False)
class Packed:
    """Columns of a short run in one stretch of memory, as ``pack.c`` puts them; arrays are made when asked for.

    A dozen arrays take longer to make than many a run.
    """

    memory: Array
    rows: int
    arcs: int
    transitions: int
    notes: int
    alternatives: int
    outputs: int
    degree: int
    there: int  # states of the model's largest mode, and below of those the run was in
    width: int

    @cached_property
    def _sizes(self) -> tuple[int, ...]:
        """How many numbers each column takes, in the order of `ORDER`."""
        n, k, w, there = self.rows, self.transitions, self.width, self.there
        by_row = n, n * w, n * self.outputs, n, n * self.degree * w
        return (*by_row, 3 * self.arcs, 4 * k, k * there, k * there, 5 * self.notes, (self.alternatives + 1) // 2)

    def __getitem__(self, name: str) -> Array:
        place = ORDER.index(name)
        start = sum(self._sizes[:place])
        raw: Array = self.memory[start : start + self._sizes[place]]
        if name in RECORDS:
            return raw.view(RECORDS[name])
        if name == "alternatives":
            return raw.view(np.int32)[: self.alternatives]
        n, k = self.rows, self.transitions
        if name in ("values", "outputs"):
            return raw.reshape(n, self.width if name == "values" else self.outputs)
        if name in ("before", "after"):
            return raw.reshape(k, self.there)
        return raw.reshape(n, self.degree, self.width) if name == "coefficients" else raw

    @property
    def where(self) -> Where:
        """Where they are."""
        n, w, m = self.rows, self.width, self.outputs
        times = self.memory.ctypes.data
        values = times + NUMBER * n
        recorded = values + NUMBER * n * w
        pieces = recorded + NUMBER * n * (m + 1)  # behind the depths
        arc = pieces + NUMBER * n * self.degree * w
        return Where(n, self.arcs, w, self.degree, m, times, values, recorded, pieces, arc)


Columns = Gathered | Packed
