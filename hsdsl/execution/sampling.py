"""The value of an execution at any time: which piece a time falls in, and the piece's polynomial there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from hsdsl.errors import UsageError
from hsdsl.execution.parts import Arc

if TYPE_CHECKING:
    from hsdsl.execution.run import Execution

Array = npt.NDArray[Any]
Side = Literal["right", "left"]

# The first three columns of every table; a state or output of such a name is labelled `state.j`, `output.j`.
HYBRID_TIME = ("time", "mode", "j")


@dataclass(frozen=True, eq=False)
class Samples:
    """Values of an execution at n points of hybrid time, by column.

    Attributes
    ----------
    time, mode, jump, kind : array, shape (n,)
        Time, name of the mode, transitions made so far, and ``flow`` or ``strip``.
    states, outputs : tuple of str
        Names, in the order in which the execution first has them.
    state_columns, output_columns : array, shape (n, number of names)
        Values, NaN where the mode lacks the state (or a state that the output needs).
    present : array of bool, shape (n, number of states)
        Whether the mode has the state, so that a state that *is* NaN can be told from one that is not there.

    ``samples["x"]`` is the column of a state or output, shape (n,); ``len(samples)`` is n.
    """

    time: Array
    mode: Array
    jump: Array
    kind: Array
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    state_columns: Array
    output_columns: Array
    present: Array

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, name: str) -> Array:
        if name in self.states:
            return self.state_columns[:, self.states.index(name)]
        if name in self.outputs:
            return self.output_columns[:, self.outputs.index(name)]
        raise KeyError(f"no state or output is called {name}; there are {', '.join(self.names) or 'none'}")

    @property
    def names(self) -> tuple[str, ...]:
        """All states, then all outputs."""
        return self.states + self.outputs

    @property
    def labels(self) -> tuple[str, ...]:
        """What heads the columns of a table: ``time``, ``mode``, ``j``, states, outputs."""
        states = [f"state.{name}" if name in HYBRID_TIME else name for name in self.states]
        outputs = [f"output.{name}" if name in HYBRID_TIME else name for name in self.outputs]
        return (*HYBRID_TIME, *states, *outputs)

    def columns(self) -> Iterator[tuple[str, Array, Array | None]]:
        """Give each column of the table: label, values (n,), and where it has a value (None: everywhere)."""
        values = [self.time, self.mode, self.jump, *self.state_columns.T, *self.output_columns.T]
        computed = [column == column for column in self.output_columns.T]
        present = [None, None, None, *self.present.T, *computed]
        yield from zip(self.labels, values, present, strict=True)

    def to_pandas(self) -> Any:
        """Make a pandas DataFrame of the table's columns.

        Raises
        ------
        UsageError
            When pandas is not installed.
        """
        pandas = optional("pandas", "a DataFrame")
        return pandas.DataFrame({label: values for label, values, _ in self.columns()})


class ArcTable:
    """The arcs as columns: each distinct tuple of states is one layout."""

    def __init__(self, arcs: Sequence[Arc]) -> None:
        self.first = np.array([arc.first for arc in arcs])
        self.mode = np.array([arc.mode for arc in arcs])
        self.jump = np.array([arc.jump for arc in arcs])
        self.kind = np.array([arc.kind for arc in arcs])
        self.layouts = list(dict.fromkeys(arc.states for arc in arcs))
        number = {layout: i for i, layout in enumerate(self.layouts)}
        self.layout = np.array([number[arc.states] for arc in arcs])


def optional(library: str, what: str) -> Any:
    """Import a library of the ``table`` extra, or say how to get it."""
    try:
        return import_module(library)
    except ImportError:
        message = f"{what} needs {library}, which is not installed: pip install 'hsdsl[table]'"
        raise UsageError(message) from None


def find(execution: Execution, times: Any, side: Side) -> tuple[Array, Array]:
    """Find the row that begins the piece each time lies in (the row itself where the time is a row's).

    Of several rows at one time ``right`` takes the last and ``left`` the first. A time outside the run by no
    more than the tie tolerance, 1e-12 max(1, |t|), counts as the run's end.

    Returns
    -------
    rows, times : array, shape (n,)

    Raises
    ------
    ValueError
        For a time outside the run, or a ``side`` that is neither.
    """
    if side not in ("right", "left"):
        raise ValueError(f"side is 'right' or 'left', not {side!r}")
    asked = _as_times(execution, times)
    start, end = execution.time_span
    slack = 1e-12 * max(1.0, abs(float(start)), abs(float(end)))
    inside = np.asarray((asked >= start - slack) & (asked <= end + slack), dtype=bool)
    if not inside.all():
        first = asked[int(np.argmin(inside))]
        raise ValueError(
            f"time {float(first):.17g} is outside the run, which goes from {float(start):.17g} to {float(end):.17g}"
        )
    asked = np.minimum(np.maximum(asked, start), end)
    rows = np.searchsorted(execution.times, asked, side=side)
    if side == "right":
        return rows - 1, asked
    return np.where(np.asarray(execution.times[rows] == asked, dtype=bool), rows, rows - 1), asked


def _as_times(execution: Execution, times: Any) -> Array:
    if execution.times.dtype != object:
        return np.atleast_1d(np.asarray(times, dtype=float)).ravel()
    plain = np.atleast_1d(np.asarray(times, dtype=object)).ravel()
    convert = execution.times[0].context.convert  # a float is exact there, and keeps its binary value
    return np.array([convert(t) for t in plain], dtype=object)


def evaluate(execution: Execution, rows: Array, times: Array) -> Samples:
    """Evaluate at ``times``, each lying in the piece that begins at its row.

    Parameters
    ----------
    rows : array of int, shape (n,)
        As :func:`find` gives them.
    times : array, shape (n,)
        Of the execution's number type, not before the row's time; equal to it for an arc's last row.
    """
    at = execution.arc_table
    arcs = np.searchsorted(at.first, rows, side="right") - 1
    inner = np.asarray(times > execution.times[rows], dtype=bool)
    follower = np.minimum(rows + 1, len(execution.times) - 1)
    fraction = np.zeros_like(times)
    begin = execution.times[rows[inner]]
    fraction[inner] = (times[inner] - begin) / (execution.times[follower[inner]] - begin)
    moving = inner & (at.kind[arcs] == "flow")
    with np.errstate(invalid="ignore", over="ignore"):
        values = _states(execution, rows, follower, fraction, moving)
        outputs = _outputs(execution, rows, follower, fraction, inner, times, values, at, arcs)
    states = execution.states
    columns, present = _by_name(states, values, at, arcs)
    return Samples(
        times,
        at.mode[arcs],
        at.jump[arcs],
        at.kind[arcs],
        states,
        execution.output_names,
        columns,
        outputs,
        present,
    )


def _states(execution: Execution, rows: Array, follower: Array, fraction: Array, moving: Array) -> Array:
    values = execution.values[rows]
    k, s = rows[moving], fraction[moving][:, None]
    degree = execution.coefficients.shape[1]
    if degree == 0:
        values[moving] += s * (execution.values[follower[moving]] - execution.values[k])
        return values
    increment = execution.coefficients[k, degree - 1]
    for m in range(degree - 2, -1, -1):
        increment = execution.coefficients[k, m] + s * increment
    values[moving] += s * increment
    return values


def _outputs(
    execution: Execution,
    rows: Array,
    follower: Array,
    fraction: Array,
    inner: Array,
    times: Array,
    values: Array,
    at: ArcTable,
    arcs: Array,
) -> Array:
    outputs = execution.outputs[rows]
    if not execution.output_names:
        return outputs
    if execution.output_function is None:
        k = rows[inner]
        change = execution.outputs[follower[inner]] - execution.outputs[k]
        outputs[inner] += fraction[inner][:, None] * change
        return outputs
    for i in np.flatnonzero(inner):
        width = len(at.layouts[at.layout[arcs[i]]])
        state = tuple(values[i, :width].tolist())
        outputs[i] = execution.output_function(str(at.mode[arcs[i]]), times[i], state)
    return outputs


def _by_name(states: Sequence[str], values: Array, at: ArcTable, arcs: Array) -> tuple[Array, Array]:
    columns = np.full((len(values), len(states)), float("nan"), dtype=values.dtype)
    present = np.zeros(columns.shape, dtype=bool)
    for number, layout in enumerate(at.layouts):
        here = at.layout[arcs] == number
        for i, name in enumerate(layout):
            columns[here, states.index(name)] = values[here, i]
            present[here, states.index(name)] = True
    return columns, present
