"""A program's compiled routines as a `Kernel`: what the Python loop takes in place of the Python kernel.

A call goes through ctypes and costs more than the Python routine would; this kernel is here to tell a fault of the code
generator from one of the compiled loop. Constants and diagnoses are evaluated by the Python kernel in every engine.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import partial
from typing import Any

from hsdsl.base.numbers.arithmetic import FLOAT64, Number
from hsdsl.engine.backends.python import PythonKernel, changed, conjunction, spread_out
from hsdsl.engine.kernel import ModeKernel, Routine, Series, Taylor, Vector
from hsdsl.engine.runtime import structures
from hsdsl.engine.runtime.kernel import CompiledModel
from hsdsl.mathematics.program import Program, Tape

Double = ctypes.c_double
Doubles = ctypes.POINTER(ctypes.c_double)
RoutinePointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, Double, Doubles, Doubles)
ShapePointer = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, Doubles, Double, Doubles, Doubles)
SeriesPointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, ctypes.c_int, Double, Doubles, Doubles)
SurfaceSeriesPointer = ctypes.CFUNCTYPE(ctypes.c_int, Doubles, ctypes.c_int, Doubles)


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

    def terms(self, mode: int, data: Sequence[Number]) -> Routine | None:
        """Return the sizes of the terms of a mode's flow; None if it does not jump."""
        table = self._compiled.mode(mode)
        n, numbers = table.dimension, (Double * max(1, len(data)))(*data)
        return _routine(table.terms, numbers, 2 * n, n) if table.terms else None

    def bind(self, mode: int, data: Sequence[Number]) -> ModeKernel:
        """Bind a mode to parameter values and input segments."""
        table, outputs = self._compiled.mode(mode), len(self._program.outputs)
        n, m = table.dimension, table.surfaces
        numbers = (Double * max(1, len(data)))(*data)
        edges, program = structures.array_at(structures.Edge, table.edge, table.edges), self._program.flows[mode]
        pairs = list(zip(edges, program.edges, strict=True))
        gradients = structures.array_at(structures.Sparse, table.gradients, m)
        rates = structures.array_at(structures.Local, table.rates, m)

        def bound(routine: Any, results: int, arguments: int = n) -> Routine:
            return _routine(routine, numbers, arguments, results)

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
                conjunction([bound(part, 1) for part in structures.array_at(structures.Local, e.condition, e.parts)])
                for e in edges
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


def _routine(routine: Any, data: ctypes.Array[Double], arguments: int, results: int) -> Routine:
    if isinstance(routine, structures.Local):
        function = partial(ShapePointer(routine.shape), routine.of)
    else:
        function = RoutinePointer(routine)
    given, found = (Double * max(1, arguments)), (Double * max(1, results))

    def call(t: Number, *x: Number) -> Vector:
        out = found()
        if function(data, t, given(*x), out):
            raise ValueError("no finite value")
        return tuple(out[:results])

    return call
