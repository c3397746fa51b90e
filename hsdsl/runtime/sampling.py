"""Values of a compiled run at many times: what C is given, and the arrays that it fills. See ``c/sample.c``."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from hsdsl.execution import Array, Evaluated
from hsdsl.runtime import tables
from hsdsl.runtime.kernel import CompiledModel, runtime

Layouts = Callable[[], tuple[Sequence[tuple[str, ...]], Array | None]]
BLOCK = 8  # HS_BLOCK
NUMBER = 8  # bytes


class Sampler:
    """Evaluates one run.

    Parameters
    ----------
    compiled : CompiledModel
    timeline : pointer
        To the ``hs_timeline`` of the run.
    columns : mapping
        The execution's ``times``, ``values``, ``outputs`` and ``coefficients``.
    arcs : array
        The arcs as they were written.
    layouts : callable
        Asked when the run is first sampled: the states of each kind of arcs, and of which kind each arc is, as an array
        of int32 (None where there is only one).
    """

    def __init__(
        self, compiled: CompiledModel, timeline: Any, columns: Mapping[str, Array], arcs: Array, layouts: Layouts
    ) -> None:
        self._compiled, self._timeline = compiled, timeline
        self._columns, self._arcs, self._layouts = columns, arcs, layouts

    @cached_property
    def _of_arcs(self) -> tuple[Sequence[tuple[str, ...]], Array | None, Array]:
        """The kinds of arcs, the kind of each, and how many states each kind has."""
        layouts, layout = self._layouts()
        return layouts, layout, np.array([len(states) for states in layouts], np.int32)

    @cached_property
    def _table(self) -> tables.Sampling:
        """What is the same for any times."""
        columns = self._columns
        _, layout, dimension = self._of_arcs
        return tables.Sampling(
            model=ctypes.pointer(self._compiled.table),
            timeline=self._timeline,
            rows=len(columns["times"]),
            arcs=len(self._arcs),
            width=columns["values"].shape[1],
            degree=columns["coefficients"].shape[1],
            times=columns["times"].ctypes.data,
            values=columns["values"].ctypes.data,
            recorded=columns["outputs"].ctypes.data,
            pieces=columns["coefficients"].ctypes.data,
            arc=self._arcs.ctypes.data,
            layout=None if layout is None else layout.ctypes.data,
            dimension=dimension.ctypes.data,
        )

    def __call__(self, times: Array, left: bool, states: Sequence[str], outputs: bool) -> Evaluated:
        """Evaluate the states named, and the outputs if they are wanted.

        Parameters
        ----------
        times : array of float, shape (n,)
        left : bool
            At a jump take the value before the first transition.
        states : sequence of str
        outputs : bool
        """
        n, k, room = len(times), len(states), len(times) + BLOCK
        m = self._columns["outputs"].shape[1] if outputs else 0
        ends = 0, room, 2 * room, (2 + k) * room, (2 + k) * room + n * m  # time, row, states, results, scratch
        memory = np.empty(ends[-1] + 2 * self._table.width)
        memory[:n], memory[n:room] = times, 0.0
        places = [[there.index(name) if name in there else -1 for name in states] for there in self._of_arcs[0]]
        column = np.array(places, np.int32)
        table = tables.Sampling.from_buffer_copy(self._table)
        table.samples, table.columns, table.outputs, table.left = n, k, m, left
        table.column, start = column.ctypes.data, memory.ctypes.data
        table.time, table.row, table.states, table.results, table.scratch = (start + NUMBER * end for end in ends)
        return Evaluated(
            outside=runtime().hs_sample(ctypes.byref(table)),
            times=memory[:n],
            rows=memory[room : room + n].view(np.int64),
            states=memory[ends[2] : ends[3]].reshape(k, room)[:, :n].T,
            outputs=memory[ends[3] : ends[4]].reshape(n, m),
        )
