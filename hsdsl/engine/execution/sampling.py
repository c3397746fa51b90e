"""The value of an execution at any time: the piece that contains the time, and its polynomial there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, TIE
from hsdsl.engine.execution.parts import Arc
from hsdsl.engine.execution.samples import Array, Samples, split

if TYPE_CHECKING:
    from hsdsl.engine.execution.run import Execution

Side = Literal["right", "left"]


class Evaluated(Protocol):
    """The result of a sampler at n times; all fields except the first may be computed at first use.

    Attributes
    ----------
    outside : int
        The number of the first time that is outside the run; -1 where none is, and only then the rest is there.
    times : array, shape (n,)
        Those outside the run by no more than the tie tolerance moved to its ends.
    states, outputs : array, shape (n, number of them)
    """

    @property
    def outside(self) -> int: ...
    @property
    def times(self) -> Array: ...
    @property
    def states(self) -> Array: ...
    @property
    def outputs(self) -> Array: ...


Sampler = Callable[[Array, bool, Sequence[str], int], Evaluated]


class ArcTable:
    """The arcs as columns; each distinct tuple of states is one layout."""

    def __init__(self, arcs: Sequence[Arc]) -> None:
        self.first = np.array([arc.first for arc in arcs])
        self.mode = np.array([arc.mode for arc in arcs])
        self.jump = np.array([arc.jump for arc in arcs])
        self.kind = np.array([arc.kind for arc in arcs])
        self.layouts = list(dict.fromkeys(arc.states for arc in arcs))
        number = {layout: i for i, layout in enumerate(self.layouts)}
        self.layout = np.array([number[arc.states] for arc in arcs])

    def present(self, states: Sequence[str]) -> Array:
        """Return which arcs have which states: shape (arcs, states)."""
        return np.array([[name in layout for name in states] for layout in self.layouts], dtype=bool)[self.layout]


def within(execution: Execution, times: Any) -> tuple[Array, Array]:
    """Convert times to the execution's number type, and mark those within the run.

    A time outside the run by no more than the tie tolerance, relative to the run's length, counts as its end.
    """
    instants = _as_times(execution, times)
    start, end = execution.time_span
    slack = TIE * max(abs(float(start)), abs(float(end)))
    inside = np.asarray((instants >= start - slack) & (instants <= end + slack), dtype=bool)
    return instants, inside


def _as_floats(times: Any) -> Array:
    return np.asarray(times, dtype=float).reshape(-1)


def _as_times(execution: Execution, times: Any) -> Array:
    if execution.times.dtype != object:
        return _as_floats(times)
    plain = np.atleast_1d(np.asarray(times, dtype=object)).ravel()
    convert = execution.times[0].context.convert  # a float is exact there, and keeps its binary value
    return np.array([convert(t) for t in plain], dtype=object)


def find(execution: Execution, times: Any, side: Side) -> tuple[Array, Array]:
    """Find the first row of the piece that contains each time (the row itself if the time is that of a row).

    Of several rows at one time ``right`` takes the last and ``left`` the first.

    Returns
    -------
    rows, times : array, shape (n,)

    Raises ValueError: for a time that is not :func:`within` the run, or a ``side`` that is neither.
    """
    _check(side)
    instants, inside = within(execution, times)
    start, end = execution.time_span
    if not inside.all():
        raise _outside(execution, instants[int(np.argmin(inside))])
    instants = np.minimum(np.maximum(instants, start), end)
    rows = np.searchsorted(execution.times, instants, side=side)
    if side == "right":
        return rows - 1, instants
    return np.where(np.asarray(execution.times[rows] == instants, dtype=bool), rows, rows - 1), instants


def _check(side: Side) -> None:
    if side not in ("right", "left"):
        raise ValueError(f"side is 'right' or 'left', not {side!r}")


def _outside(execution: Execution, time: Any) -> ValueError:
    start, end = execution.time_span
    return ValueError(
        f"time {float(time):.17g} is outside the run, which goes from {float(start):.17g} to {float(end):.17g}"
    )


def sample(execution: Execution, times: Any, side: Side, columns: Sequence[str] | None) -> Samples:
    """Evaluate at any times, by the execution's own sampler if it has one."""
    if execution.sampler is None:
        return evaluate(execution, *find(execution, times, side)).only(columns)
    _check(side)
    states, outputs, names = execution.states, execution.output_names, execution.output_names
    if columns is not None:
        states, names = split(columns, states, outputs)
    instants = _as_floats(times)
    found = execution.sampler(instants, side == "left", states, len(outputs) if names else 0)
    if found.outside >= 0:
        raise _outside(execution, instants[found.outside])
    source = _Source(execution, found, side)
    return Samples.deferred(_LATER, states=states, outputs=names, state_columns=found.states, _source=source)


class _Source:
    """The data from which the columns of samples are computed at first use."""

    def __init__(self, execution: Execution, found: Evaluated, side: Side) -> None:
        self.execution, self.found = execution, found
        self.side: Side = side

    @staticmethod
    def of(samples: Samples) -> _Source:
        return samples.__dict__["_source"]

    @property
    def table(self) -> ArcTable:
        """The arcs as columns."""
        return self.execution.arc_table

    @cached_property
    def arcs(self) -> Array:
        """The arc of each time."""
        return _arcs(self.execution, find(self.execution, self.found.times, self.side)[0])

    def outputs(self, names: Sequence[str]) -> Array:
        """Return the columns of some outputs."""
        known, values = self.execution.output_names, self.found.outputs
        return values if names == known else values[:, [known.index(name) for name in names]]


_LATER: dict[str, Callable[[Samples], Array]] = {
    "time": lambda samples: _Source.of(samples).found.times.copy(),  # which its owner may change
    "mode": lambda samples: (of := _Source.of(samples)).table.mode[of.arcs],
    "jump": lambda samples: (of := _Source.of(samples)).table.jump[of.arcs],
    "kind": lambda samples: (of := _Source.of(samples)).table.kind[of.arcs],
    "present": lambda samples: (of := _Source.of(samples)).table.present(samples.states)[of.arcs],
    "output_columns": lambda samples: _Source.of(samples).outputs(samples.outputs),
}


@dataclass(frozen=True, eq=False)
class _Places:
    """The places of n times: arc, row, the next row, and the fraction between both (0 at the row itself)."""

    time: Array
    arc: Array
    row: Array
    follower: Array
    fraction: Array
    between: Array


def _places(execution: Execution, rows: Array, times: Array) -> _Places:
    between = np.asarray(times > execution.times[rows], dtype=bool)
    follower = np.minimum(rows + 1, len(execution.times) - 1)
    fraction = np.zeros_like(times)
    begin = execution.times[rows[between]]
    fraction[between] = (times[between] - begin) / (execution.times[follower[between]] - begin)
    return _Places(times, _arcs(execution, rows), rows, follower, fraction, between)


def _arcs(execution: Execution, rows: Array) -> Array:
    return np.searchsorted(execution.arc_table.first, rows, side="right") - 1


def evaluate(execution: Execution, rows: Array, times: Array) -> Samples:
    """Evaluate at ``times``, each in the piece that begins at its row.

    Parameters
    ----------
    rows : array of int, shape (n,)
        As :func:`find` gives them.
    times : array, shape (n,)
        Of the execution's number type, not before the row's time; equal to it for an arc's last row.
    """
    at, table = _places(execution, rows, times), execution.arc_table
    with np.errstate(invalid="ignore", over="ignore"):
        values = _states(execution, at)
        outputs = _outputs(execution, at, values)
    columns, present = _by_name(execution, at, values)
    return Samples(
        time=times,
        mode=table.mode[at.arc],
        jump=table.jump[at.arc],
        kind=table.kind[at.arc],
        states=execution.states,
        outputs=execution.output_names,
        state_columns=columns,
        output_columns=outputs,
        present=present,
    )


def _states(execution: Execution, at: _Places) -> Array:
    """Return the states in the order of each arc; in a strip the state is constant."""
    values = execution.values[at.row]
    moving = at.between & (execution.arc_table.kind[at.arc] == "flow")
    k, s = at.row[moving], at.fraction[moving][:, None]
    degree = execution.coefficients.shape[1]
    if degree == 0:
        values[moving] += s * (execution.values[at.follower[moving]] - execution.values[k])
        return values
    increment = execution.coefficients[k, degree - 1]
    for m in range(degree - 2, -1, -1):
        increment = execution.coefficients[k, m] + s * increment
    values[moving] += s * increment
    return values


def _outputs(execution: Execution, at: _Places, values: Array) -> Array:
    outputs = execution.outputs[at.row]
    if not execution.output_names:
        return outputs
    if execution.output_function is None:
        change = execution.outputs[at.follower[at.between]] - execution.outputs[at.row[at.between]]
        outputs[at.between] += at.fraction[at.between][:, None] * change
        return outputs
    times = at.time.tolist()  # NumPy's own numbers go on where Python's have no value
    for i in np.flatnonzero(at.between):
        arc = execution.arcs[int(at.arc[i])]
        state = tuple(values[i, : len(arc.states)].tolist())
        try:
            outputs[i] = execution.output_function(arc.mode, times[i], state)
        except DOMAIN_ERRORS:
            outputs[i] = float("nan")
    return outputs


def _by_name(execution: Execution, at: _Places, values: Array) -> tuple[Array, Array]:
    """Sort the states into one column per name, and mark the rows whose mode has them."""
    table = execution.arc_table
    return columns_by_name(values, table.layout[at.arc], table.layouts, execution.states)


def columns_by_name(
    values: Array, layout: Array, layouts: Sequence[tuple[str, ...]], names: tuple[str, ...]
) -> tuple[Array, Array]:
    """Sort rows of states, each with its layout, into one column per name, with a mask of the rows that have the
    state.
    """
    columns = np.full((len(values), len(names)), float("nan"), dtype=values.dtype)
    present = np.zeros(columns.shape, dtype=bool)
    for number, states in enumerate(layouts):
        here = layout == number
        for i, name in enumerate(states):
            columns[here, names.index(name)] = values[here, i]
            present[here, names.index(name)] = True
    return columns, present
