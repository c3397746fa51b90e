"""Values of a compiled run at many times: what C is given, and the arrays that it fills. See ``c/sample.c``."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from hsdsl.execution import Array, Evaluated
from hsdsl.runtime import structures
from hsdsl.runtime.kernel import CompiledModel

NUMBER = 8  # bytes
SHARED = ("rows", "arcs", "width", "degree", "times", "values", "recorded", "pieces", "arc")  # with ``hs_record``


class Placed(Protocol):
    """Columns that C can be shown."""

    @property
    def record(self) -> int:
        """Where the ``hs_record`` is that says where they are."""
        ...


class Sampled:
    """What is the same for all runs of one model over one timeline (a pointer to the ``hs_timeline``).

    ``library`` is the runtime that the runs need anyway: it has all that samples need.
    """

    def __init__(self, library: ctypes.CDLL, compiled: CompiledModel, timeline: Any) -> None:
        self.table = structures.Sampling(model=structures.address(ctypes.pointer(compiled.table)), timeline=timeline)
        self.run = library.hs_sample
        self._kept = compiled, timeline
        self._columns: dict[Any, tuple[Array, Array, int, int]] = {}

    def columns(self, layouts: tuple[tuple[str, ...], ...], names: Sequence[str]) -> tuple[int, int]:
        """Where it is written how many states each layout has, and which of them have these names."""
        key = layouts, tuple(names)
        if key not in self._columns:
            dimension = np.array([len(states) for states in layouts], np.int32)
            places = [[there.index(name) if name in there else -1 for name in names] for there in layouts]
            column = np.array(places, np.int32)
            self._columns[key] = dimension, column, dimension.ctypes.data, column.ctypes.data
        return self._columns[key][2:]


class Filled:
    """Memory that C has filled at n times: times, rows, k states, m outputs, and room between them."""

    def __init__(self, memory: Array, outside: int, n: int, k: int, m: int) -> None:
        self._memory, self.outside, self._n, self._k, self._m = memory, outside, n, k, m

    @property
    def times(self) -> Array:
        """Shape (n,)."""
        return self._memory[: self._n]

    @property
    def rows(self) -> Array:
        """Shape (n,), of int."""
        return self._memory[self._n : 2 * self._n].view(np.int64)

    @property
    def states(self) -> Array:
        """Shape (n, k)."""
        return self._memory[2 * self._n : (2 + self._k) * self._n].reshape(self._k, self._n).T

    @property
    def outputs(self) -> Array:
        """Shape (n, m)."""
        start = (2 + self._k) * self._n
        return self._memory[start : start + self._n * self._m].reshape(self._n, self._m)


class Sampler:
    """Evaluates one run.

    Parameters
    ----------
    sampled : Sampled
    columns : object
        The run's columns; its ``record`` says what of them is where.
    kinds : tuple of tuples of str
        The states of each kind of arcs.
    layout : array of int32, optional
        Of which kind each arc is; None where there is only one.
    """

    def __init__(
        self, sampled: Sampled, columns: Placed, kinds: tuple[tuple[str, ...], ...], layout: Array | None
    ) -> None:
        self._sampled, self._columns, self._kinds, self._layout = sampled, columns, kinds, layout
        self._own: Any = None

    def _table(self) -> Any:
        """What is the same for any times."""
        table = structures.Sampling.from_buffer_copy(self._sampled.table)
        record = structures.Record.from_address(self._columns.record)
        for name in SHARED:
            setattr(table, name, getattr(record, name))
        self._outputs = record.outputs
        table.layout = None if self._layout is None else self._layout.ctypes.data
        return table

    def __call__(self, times: Array, left: bool, states: Sequence[str], outputs: bool) -> Evaluated:
        """Evaluate the states named, and the outputs where ``outputs`` is true.

        Parameters
        ----------
        times : array of float, shape (n,)
        left : bool
            At a jump take the value before the first transition.
        states : sequence of str
        outputs : bool
        """
        n, k = len(times), len(states)
        own = self._own = self._own or self._table()
        m = self._outputs if outputs else 0
        ends = 0, n, 2 * n, (2 + k) * n, (2 + k + m) * n  # time, row, states, results, scratch
        memory = np.empty(ends[-1] + 2 * own.width)
        memory[:n] = times
        table, start = structures.Sampling.from_buffer_copy(own), structures.start_of(memory)
        table.samples, table.columns, table.outputs, table.left = n, k, m, left
        table.dimension, table.column = self._sampled.columns(self._kinds, states)
        table.time, table.row, table.states, table.results, table.scratch = [start + NUMBER * end for end in ends]
        return Filled(memory, self._sampled.run(ctypes.byref(table)), n, k, m)
