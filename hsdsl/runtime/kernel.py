"""A program's compiled routines as a `Kernel`: what the Python loop takes in place of the Python kernel.

A call goes through ctypes and costs more than the Python routine would; this kernel is here to tell a fault of the code
generator from one of the compiled loop. Constants and diagnoses are evaluated by the Python kernel in every engine.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from contextvars import copy_context
from functools import cache
from threading import Lock, Thread
from typing import Any

from hsdsl.arithmetic import FLOAT64, Number
from hsdsl.backends.python import PythonKernel, changed, conjunction, spread_out
from hsdsl.kernel import ModeKernel, Routine, Series, Taylor, Vector
from hsdsl.program import Program, Tape
from hsdsl.runtime import structures
from hsdsl.runtime.compiler import Effort, NoCompiler, TooSlow
from hsdsl.runtime.library import LOOP, is_kept, load

Address = int | None
Double = ctypes.c_double
Doubles = ctypes.POINTER(ctypes.c_double)
RoutinePointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, Double, Doubles, Doubles)
SeriesPointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, ctypes.c_int, Double, Doubles, Doubles)
SurfaceSeriesPointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, ctypes.c_int, Doubles)


LARGE = 1 << 17  # characters of a program
SYMBOL = "hs_the_model"

_loading = Lock()


def runtime() -> ctypes.CDLL:
    """The hand-written runtime; a run in it leaves the interpreter free.

    Raises
    ------
    NoCompiler
        There is no compiler, or it fails.
    """
    with _loading:  # another thread may compile it: see `begin`
        return _runtime()


@cache
def _runtime() -> ctypes.CDLL:
    text, symbol, effort = LOOP
    library = load(text, symbol, lambda: text, effort)
    library.hs_workspace.restype = ctypes.c_int64
    library.hs_simulate.argtypes, library.hs_simulate.restype = (ctypes.c_void_p,), None
    library.hs_pack.argtypes, library.hs_pack.restype = (ctypes.c_void_p, ctypes.c_void_p), ctypes.c_int64
    library.hs_sample.argtypes, library.hs_sample.restype = (ctypes.c_void_p,), ctypes.c_int64
    library.hs_look.argtypes, library.hs_look.restype = (ctypes.c_void_p,), None
    library.hs_screen_room.argtypes, library.hs_screen_room.restype = (ctypes.c_void_p,), ctypes.c_int64
    library.hs_run_ensemble.argtypes, library.hs_run_ensemble.restype = (ctypes.c_void_p,), None
    return library


def begin() -> None:
    """Compile the runtime in another thread, unless an earlier process compiled it."""

    def compile_runtime() -> None:
        with suppress(NoCompiler):  # the run that needs it reports the failure
            runtime()

    with suppress(NoCompiler):
        text, _, effort = LOOP
        if not is_kept(text, effort):
            Thread(target=copy_context().run, args=(compile_runtime,), daemon=True).start()


class CompiledModel:
    """A program compiled to a library: ``table`` is its ``hs_model``.

    Raises
    ------
    NoCompiler
        There is no compiler, or it fails.
    """

    def __init__(self, program: Program) -> None:
        data = len(program.parameters), len(program.inputs), len(program.switches)
        content = repr(((*data, len(program.outputs), program.initial_states), program.flows))
        try:
            self._library = load(content, SYMBOL, lambda: _source(program), _model_effort(content))
        except TooSlow as error:
            raise NoCompiler(f"{error}; {_longest(program)}") from None
        self.table = structures.Model.in_dll(self._library, SYMBOL)
        self._shared: dict[Hashable, Any] = {}

    def workspace(self, method: Any, scheme: str) -> int:
        """How many numbers a run needs for itself."""
        number = structures.SCHEMES.index(scheme)
        return runtime().hs_workspace(ctypes.byref(self.table), ctypes.byref(method), number)

    def mode(self, number: int) -> Any:
        """The ``hs_mode`` of a mode."""
        return structures.array_at(structures.Mode, self.table.mode, self.table.flows)[number]

    def shared(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what runs of this model share under a key, made on first use."""
        return self._shared[key] if key in self._shared else self._shared.setdefault(key, make())


def _model_effort(content: str) -> Effort:
    """Of a large model -O2 takes several times as long as -O1, and few runs are long enough to win that back."""
    return "-O1" if len(content) > LARGE else "-O2"


def _longest(program: Program) -> str:
    """Say where most of the work of a model is."""
    flows = (
        (text, f"the flow of {state} in mode {mode.name}")
        for mode in program.modes
        for state, text in zip(mode.states, mode.flow_texts, strict=True)
    )
    guards = ((edge.text, f"the guard of {edge.name}") for mode in program.modes for edge in mode.edges)
    text, where = max((*flows, *guards), key=lambda pair: len(pair[0]), default=("", "none"))
    return f"the longest expression is {where}, with {len(text):,} characters"


def _source(program: Program) -> str:
    from hsdsl.backends.c import model_source  # what is compiled already needs none

    return model_source(program)


class CompiledKernel(PythonKernel):
    """A compiled program for the Python loop; constants, switches and diagnoses are Python's."""

    def __init__(self, program: Program, compiled: CompiledModel) -> None:
        super().__init__(program, FLOAT64)
        self._compiled = compiled

    def taylor(self, mode: int, data: Sequence[Number]) -> Taylor | None:
        """Return Taylor coefficients along a mode's flow; None where the flow is kinked."""
        tape = self._program.flows[mode].tape
        return None if tape is None else _taylor(self._compiled.mode(mode), tape, data)

    def jacobian(self, mode: int, data: Sequence[Number]) -> Routine:
        """Return the derivatives of a mode's flow by its states, row by row."""
        table, program = self._compiled.mode(mode), self._program.flows[mode]
        n, numbers = table.dimension, (Double * max(1, len(data)))(*data)
        rows = table.jacobian
        return spread_out(_routine(rows.values, numbers, n, rows.count), program.jacobian.places, n * n, 0.0)

    def bind(self, mode: int, data: Sequence[Number]) -> ModeKernel:
        """Bind a mode to parameter values and input segments."""
        table, outputs = self._compiled.mode(mode), len(self._program.outputs)
        n, m = table.dimension, table.surfaces
        numbers = (Double * max(1, len(data)))(*data)
        edges, program = structures.array_at(structures.Edge, table.edge, table.edges), self._program.flows[mode]
        pairs = list(zip(edges, program.edges, strict=True))
        gradients = structures.array_at(structures.Sparse, table.gradients, m)
        rates = structures.addresses(table.rates, m)

        def bound(address: Address, results: int, arguments: int = n) -> Routine:
            return _routine(address, numbers, arguments, results)

        return ModeKernel(
            flow=bound(table.flow, n),
            surfaces=bound(table.values, m),
            magnitudes=bound(table.magnitudes, m),
            outputs=bound(table.outputs, outputs),
            gradients=tuple(
                spread_out(bound(row.values, row.count), places, n + 1, 0.0)
                for row, places in zip(gradients, program.slopes, strict=True)
            ),
            rates=tuple(bound(rate, 1) for rate in rates),
            conditions=tuple(
                conjunction([bound(part, 1) for part in structures.addresses(e.condition, e.parts)]) for e in edges
            ),
            resets=tuple(changed(bound(e.reset, e.changes), edge, 1) for e, edge in pairs),
            spreads=tuple(changed(bound(e.spread, e.changes, 2 * n), edge, n + 1) for e, edge in pairs),
        )


def _taylor(table: Any, tape: Tape, data: Sequence[Number]) -> Taylor:
    numbers = (Double * max(1, len(data)))(*data)
    own = 1 + table.dimension + tape.needed
    every = 1 + table.dimension + len(tape.operations)
    assert table.series is not None and table.surface_series is not None
    write, write_surfaces = SeriesPointer(table.series), SurfaceSeriesPointer(table.surface_series)

    def flow(order: int, t: Number, x: Vector) -> tuple[Series, ...]:
        length = order + 2
        found = (Double * (length * every))()
        if write(numbers, order, t, (Double * max(1, len(x)))(*x), found):
            raise ValueError("no finite value")
        return tuple(found[i * length : (i + 1) * length - (i > table.dimension)] for i in range(own))

    def surfaces(order: int, lines: tuple[Series, ...]) -> tuple[Series | None, ...]:
        length = order + 2
        found = (Double * (length * every))()
        for i, line in enumerate(lines):
            found[i * length : i * length + len(line)] = line
        if write_surfaces(numbers, order, found):
            raise ValueError("no finite value")
        rows = (None if line is None else line * length for line in tape.surfaces)
        return tuple(None if start is None else found[start : start + order + 1] for start in rows)

    return Taylor(flow, surfaces)


def _routine(address: Address, data: ctypes.Array[Double], arguments: int, results: int) -> Routine:
    assert address is not None
    function = RoutinePointer(address)
    given, found = (Double * max(1, arguments)), (Double * max(1, results))

    def call(t: Number, *x: Number) -> Vector:
        out = found()
        if function(data, t, given(*x), out):
            raise ValueError("no finite value")
        return tuple(out[:results])

    return call
