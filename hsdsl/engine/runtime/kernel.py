"""The hand-written runtime, programs compiled to libraries that it runs, and values of their runs at many times."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Hashable
from functools import cache
from typing import Any, Protocol

import numpy as np

from hsdsl.engine.execution import Array, Evaluated
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.compiler import NoCompiler
from hsdsl.engine.runtime.library import LANES, SYMBOL, compiled, compiled_lanes, loop
from hsdsl.mathematics.program import Program


@cache
def runtime() -> ctypes.CDLL:
    """The hand-written runtime; a run in it leaves the interpreter free.

    Raises NoCompiler: there is no compiler, or it fails.
    """
    library = loop()
    library.hs_workspace.restype = ctypes.c_int64
    library.hs_run_whole.argtypes, library.hs_run_whole.restype = (ctypes.c_void_p,), ctypes.c_int64
    library.hs_pack.argtypes, library.hs_pack.restype = (ctypes.c_void_p, ctypes.c_void_p), ctypes.c_int64
    sampling = *(ctypes.c_void_p,) * 3, ctypes.c_int64, ctypes.c_void_p
    library.hs_sample_record.argtypes, library.hs_sample_record.restype = sampling, ctypes.c_int64
    library.hs_screen_run.argtypes, library.hs_screen_run.restype = (ctypes.c_void_p,) * 3, ctypes.c_int64
    library.hs_run_ensemble.argtypes, library.hs_run_ensemble.restype = (ctypes.c_void_p,), None
    library.hs_run_team.argtypes, library.hs_run_team.restype = (ctypes.c_void_p,), None
    library.hs_lane_memory.argtypes = *(ctypes.c_void_p,) * 2, ctypes.c_int64, ctypes.c_int32
    library.hs_lane_memory.restype = ctypes.c_int64
    return library


class CompiledModel:
    """A program compiled to a library: ``table`` is its ``hs_model``.

    Raises NoCompiler: there is no compiler, or it fails.
    """

    def __init__(self, program: Program) -> None:
        self._program, self._library = program, compiled(program)
        self.table = structures.Model.in_dll(self._library, SYMBOL)
        self._shared: dict[Hashable, Any] = {}
        self._lanes: Any = None
        self._without_lanes = False

    def workspace(self, method: Any, scheme: str) -> int:
        """How many numbers a run needs for itself."""
        number = structures.COMPILED_SCHEMES.index(scheme)
        return runtime().hs_workspace(ctypes.byref(self.table), ctypes.byref(method), number)

    def mode(self, number: int) -> Any:
        """The ``hs_mode`` of a mode."""
        return structures.array_at(structures.Mode, self.table.mode, self.table.flows)[number]

    def lanes(self, compiles: bool) -> Any:
        """Its ``hs_lane_program``: what is kept of it, or what one ``compiles``.

        None where there is none: no mode steps in lanes, or processor or compiler lack them.
        """
        if self._lanes is None and not self._without_lanes:
            try:
                library = compiled_lanes(self._program, compiles)
            except NoCompiler:
                library = None
            self._without_lanes = compiles and library is None
            self._lanes = library and structures.LaneProgram.in_dll(library, LANES)
        return self._lanes

    def shared(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what runs of this model share under a key, made on first use."""
        return self._shared[key] if key in self._shared else self._shared.setdefault(key, make())


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
        self.scratch, self.evaluate = 2 * compiled.table.width, library.hs_sample_record
        self._of = compiled, timeline
        self._tables: dict[Any, tuple[int, Any, Array, Array]] = {}

    def table(self, layouts: tuple[tuple[str, ...], ...], names: tuple[str, ...], outputs: int, left: bool) -> int:
        """Where an ``hs_sampling`` is that asks for some states of each layout, outputs, and a side."""
        key = layouts, names, outputs, left
        if key not in self._tables:
            compiled, timeline = self._of
            dimension = np.array([len(states) for states in layouts], np.int32)
            places = [[there.index(name) if name in there else -1 for name in names] for there in layouts]
            column = np.array(places, np.int32)
            table = structures.Sampling(
                model=structures.address(ctypes.pointer(compiled.table)), timeline=timeline, outputs=outputs, left=left,
                columns=len(names), dimension=dimension.ctypes.data, column=column.ctypes.data,
            )  # fmt: skip
            self._tables[key] = ctypes.addressof(table), table, dimension, column
        return self._tables[key][0]


class Filled:
    """Memory that C has filled at n times: times, k states, m outputs."""

    def __init__(self, memory: Array, outside: int, n: int, k: int, m: int) -> None:
        self._memory, self.outside, self._n, self._k, self._m = memory, outside, n, k, m

    @property
    def times(self) -> Array:
        """Shape (n,)."""
        return self._memory[: self._n]

    @property
    def states(self) -> Array:
        """Shape (n, k)."""
        row = 8 * self._n
        return np.ndarray((self._n, self._k), np.float64, self._memory, row, (8, row))

    @property
    def outputs(self) -> Array:
        """Shape (n, m)."""
        start = (1 + self._k) * self._n
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

    def __call__(self, times: Array, left: bool, states: tuple[str, ...], outputs: int) -> Evaluated:
        """Evaluate the states named, and the outputs: all that the model has, or 0.

        Parameters
        ----------
        times : array of float, shape (n,)
        left : bool
            At a jump take the value before the first transition.
        states : tuple of str
        outputs : int
            How many outputs.
        """
        n, k, shared, layout = len(times), len(states), self._sampled, self._layout
        memory = np.empty(n * (1 + k + outputs) + shared.scratch)
        memory[:n] = times
        outside = shared.evaluate(
            shared.table(self._kinds, states, outputs, left),
            self._columns.record,
            None if layout is None else layout.ctypes.data,
            n,
            structures.start_of(memory),
        )
        return Filled(memory, outside, n, k, outputs)
