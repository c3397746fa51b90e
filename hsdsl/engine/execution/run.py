"""The execution: columns that a run filled, their values at any time, equality, display and saving.

Its value at a time is that of the piece that the time falls in, by the piece's polynomial.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

import numpy as np

from hsdsl.base.errors import UsageError
from hsdsl.base.names import checks_methods, visible, without_memory
from hsdsl.base.numbers.arithmetic import DOMAIN_ERRORS, TIE
from hsdsl.engine.execution.records import (
    REASONS,
    Arc,
    Array,
    Deferred,
    Point,
    RunWarning,
    Samples,
    Stop,
    Transition,
    Verdict,
    same,
    shown,
    split,
)

Side = Literal["right", "left"]


class Evaluated(Protocol):
    """The result of a sampler at n times; all fields except the first may be computed at first use.

    ``outside`` is the number of the first time that is outside the run; -1 where none is, and only then the rest is
    there. Of the ``times``, those outside the run by no more than the tie tolerance are moved to its ends.
    """

    @property
    def outside(self) -> int: ...
    @property
    def times(self) -> Array: ...
    @property
    def states(self) -> Array: ...
    @property
    def outputs(self) -> Array: ...


Sampler = Callable[[Array, bool, tuple[str, ...], int], Evaluated]


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
    return instants, np.asarray((instants >= start - slack) & (instants <= end + slack), dtype=bool)


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

    Of several rows at one time ``right`` takes the last and ``left`` the first. Returns rows and times.

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


class _Places(NamedTuple):
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
    """Evaluate at ``times``, each in the piece that begins at its row, as :func:`find` gives them.

    No time is before that of its row; one in an arc's last row is equal to it.
    """
    at, table = _places(execution, rows, times), execution.arc_table
    with np.errstate(invalid="ignore", over="ignore"):
        values = _states(execution, at)
        outputs = _outputs(execution, at, values)
    columns, present = columns_by_name(values, table.layout[at.arc], table.layouts, execution.states)
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


OutputFunction = Callable[[str, Any, tuple[Any, ...]], Sequence[Any]]
Assessment = Callable[..., Verdict]


class CompiledRecord(Protocol):
    """The output of the C loop for a run; columns and transitions are computed from it at first use."""

    @property
    def made(self) -> int:
        """How many transitions were made."""
        ...

    @property
    def enters_beyond(self) -> bool:
        """Whether a transition fired at once on entry."""
        ...


@checks_methods
@dataclass(frozen=True, eq=False, repr=False)
class Execution(Deferred):
    """The result of a run; the package's docstring describes the arrays.

    Two executions are equal if all their fields are equal, where not-a-number equals itself. ``seconds``,
    ``output_function`` and ``sampler`` do not count.

    Attributes
    ----------
    stop : Stop
        The reason and time of the run's end.
    transitions : sequence of Transition
        The transitions, in order: a tuple, or `Records` of a compiled run.
    final : Point
        Time, mode, states and outputs at the end.
    verdict : Verdict
        Whether the theorem holds for the run, with reasons.
    settings : dict
        The settings of the run.
    seconds : dict
        Seconds for loading, compiling and simulating.
    times, values, outputs : array, shape (n,), (n, states) and (n, outputs)
        The recorded rows, two at a jump; :meth:`rows` gives them by name.
    overrides : dict
        The settings given beyond the model's file, by the names of `--set` (``c``, ``initial.v``,
        ``experiment.until``), with each value as written.
    output_function : callable or None
        ``output_function(mode, t, state) -> values of the outputs``. Rows have recorded outputs. Between rows this
        function computes them from the state (not-a-number if they have no value). Without it (in an execution read
        from a file) they are interpolated linearly between rows.
    sampler : callable or None
        A faster evaluation of the same values at many times, for a compiled run.
    assessment : callable or None
        ``assessment(execution, finer) -> Verdict``: the verdict by comparison with a finer run, or, if that is None and
        steps are not fixed, with its own ``finer``. Without this function the verdict does not change.
    repetition : callable or None
        ``repetition(execution) -> Execution``: the same run with finer steps (`hsdsl.engine.simulate.moving`).
    differentiation : callable or None
        ``differentiation(wrt) -> Sensitivity``: the derivatives of the run.
    compiled : CompiledRecord or None
        The output of the C loop, for a compiled run; it is available before the transitions.
    noted : callable or None
        ``noted(execution) -> str``: the codes of warnings that need no verdict.
    look : callable or None
        ``look() -> dict``: the parts of the model that a picture shows, as options of `hsdsl.analysis.plot.View`.
    """

    model: str
    digest: str
    engine: str
    scheme: str
    method: str
    settings: dict[str, Any]
    stop: Stop
    transitions: Sequence[Transition]
    final: Point
    verdict: Verdict
    output_names: tuple[str, ...]
    times: Array
    values: Array
    outputs: Array
    depth: Array
    coefficients: Array
    arcs: tuple[Arc, ...]
    seconds: dict[str, float] = field(compare=False)
    digits: int | None = None  # decimal digits of the numbers, None for float64
    title: str | None = None
    overrides: dict[str, Any] = field(default_factory=dict[str, Any])
    output_function: OutputFunction | None = field(default=None, compare=False)
    sampler: Sampler | None = field(default=None, compare=False)
    assessment: Assessment | None = field(default=None, compare=False)
    repetition: Callable[[Execution], Execution] | None = field(default=None, compare=False)
    differentiation: Callable[[Any], Any] | None = field(default=None, compare=False)
    noted: Callable[[Execution], str] | None = field(default=None, compare=False)
    look: Callable[[], dict[str, Any]] | None = field(default=None, compare=False)
    compiled: CompiledRecord | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        for name in ("sampler", "compiled"):  # they read a compiled run's own columns, and these may be others
            object.__setattr__(self, name, None)
        self.check()

    def check(self) -> None:
        """Check that columns and arcs belong together.

        Raises ValueError: they do not.
        """
        n = len(self.times)
        if not (len(self.values) == len(self.outputs) == len(self.depth) == len(self.coefficients) == n):
            raise ValueError("columns differ in length")
        if self.stop.reason not in REASONS:
            raise ValueError(f"unknown stop reason {self.stop.reason}")
        if not self.arcs or self.arcs[0].first != 0 or self.arcs[-1].last != n - 1:
            raise ValueError("arcs must cover the rows")
        if any(b.first != a.last + 1 for a, b in zip(self.arcs, self.arcs[1:], strict=False)):
            raise ValueError("arcs must follow each other")
        if n > 1 and bool(np.any(self.times[1:] < self.times[:-1])):
            raise ValueError("time must not run backwards")
        if any(self.times[arc.last] != self.times[arc.last + 1] for arc in self.arcs[:-1]):
            raise ValueError("an arc must begin at the time at which the one before it ends")

    def __eq__(self, other: object) -> bool:
        return same(self, other) if isinstance(other, Execution) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields to pickle: a copy, or an unpickled execution, equals one that was saved and read."""
        local = [each.name for each in fields(self) if not each.compare and each.name != "seconds"]
        return super().__getstate__() | dict.fromkeys(local)

    def __repr__(self) -> str:
        start, end = self.time_span
        count = len(self.transitions)
        return (
            f"<Execution of {visible(self.model)}: {visible(self.scheme)} {visible(self.method)}, "
            f"t = {float(start):.6g} to {float(end):.6g}, {count} transition{'' if count == 1 else 's'}, "
            f"{len(self.arcs)} arcs, {len(self.times)} rows, stop: {self.stop.reason}>"
        )

    def _repr_html_(self) -> str:
        """Show a short summary and a picture in notebooks."""
        return shown("run_html", self)

    if not TYPE_CHECKING:

        def __getitem__(self, name: Any) -> Any:
            raise TypeError(f"a run has no items{self._elsewhere(name) or '; run.rows() has columns by name'}")

        __iter__ = None

    def _elsewhere(self, name: str) -> str:
        if name in ("t", "time"):
            return "; its times are run.times"
        if name in (*self.states, *self.output_names):
            return f"; its values are run.rows()['{name}'], at times run.sample(times)['{name}']"
        return ""

    def plot(self, figure: Any = None, **options: Any) -> list[Any]:
        """Draw the run with Matplotlib, and return the axes: first those over time, then those of phase plots.

        Parameters
        ----------
        figure : Figure or SubFigure, optional
            The figure to draw on; by default a new figure of pyplot, which notebooks display automatically.
        **options
            ``columns`` (names), ``phases`` (pairs of names), ``title``; see `hsdsl.analysis.plot.View`.

        Raises UsageError: an unknown name.
        """
        return shown("axes", self, figure, **(self.view() | options))

    def view(self) -> dict[str, Any]:
        """Return the parts of the model that a picture shows: units, levels of guards; nothing for a run read from a
        file.
        """
        return {} if self.look is None else self.look()

    @property
    def warnings(self) -> tuple[RunWarning, ...]:
        """The warnings of the run: surfaces with an `if` that were passed or entered beyond, walls that were not
        checked, motion that completes the run, assumptions of the file. They are found with the verdict.
        """
        return self.verdict.warnings

    @property
    def made(self) -> int:
        """The number of transitions; for a long run it is available before the transitions."""
        return len(self.transitions) if self.compiled is None else self.compiled.made

    @property
    def enters_beyond(self) -> bool:
        """Whether a transition fired at once on entry; a compiled run knows this before its transitions."""
        return any(made.entry for made in self.transitions) if self.compiled is None else self.compiled.enters_beyond

    @property
    def time_span(self) -> tuple[Any, Any]:
        """The first and the last time."""
        return self.times[0], self.times[-1]

    @cached_property
    def arc_table(self) -> ArcTable:
        """The arcs as columns."""
        return ArcTable(self.arcs)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """The names of all states, in the order of their first occurrence in the run."""
        return tuple(dict.fromkeys(name for arc in self.arcs for name in arc.states))

    def sizes(self, arcs: Iterable[Arc] | None = None, start: float = -inf, end: float = inf) -> dict[str, float]:
        """Return the largest size of each state at the rows of arcs (by default all), from one time to another."""
        found: dict[str, float] = {}
        for arc in self.arcs if arcs is None else arcs:
            times = self.times[arc.first : arc.last + 1].astype(float)
            first, last = np.searchsorted(times, start), np.searchsorted(times, end, side="right")
            rows = np.abs(self.values[arc.first + first : arc.first + last, : len(arc.states)].astype(float))
            for name, size in zip(arc.states, rows.max(axis=0, initial=0.0).tolist(), strict=True):
                found[name] = max(found.get(name, 0.0), size)
        return found

    @property
    def shown(self) -> tuple[str, ...]:
        """The states and outputs in displays and tables: all except the memory of events."""
        return (*without_memory(self.states), *self.output_names)

    @cached_property
    def finer(self) -> Execution | None:
        """The same run with finer steps; None if the run was read from a file."""
        return None if self.repetition is None else self.repetition(self)

    def estimated(self) -> Execution:
        """Return the same execution with a verdict that uses the finer run, also if steps are fixed."""
        return self if self.assessment is None else replace(self, verdict=self.assessment(self, self.finer))

    def sensitivity(self, wrt: str | Sequence[str]) -> Any:
        """Return the derivatives of this run with respect to parameters and initial states (see `Model.sensitivity`).

        Raises UsageError: the run was read from a file, or a name is unknown.
        """
        if self.differentiation is None:
            raise UsageError("an execution that was read from a file has no model to differentiate")
        return self.differentiation(wrt)

    def __call__(self, t: Any, side: Side = "right") -> Point:
        """Return the execution's value at a time.

        Parameters
        ----------
        t : number
            Within :attr:`time_span`, or outside it by at most the tie tolerance.
        side : {"right", "left"}
            At a jump: the value after the last transition at that instant, or before the first.

        Raises ValueError: for a time outside the run.
        """
        one = self.sample(t, side)
        if len(one) != 1:
            raise ValueError(f"expected one time, got {len(one)}; sample(times) takes many")
        state = {
            name: value
            for name, value, there in zip(one.states, one.state_columns[0].tolist(), one.present[0], strict=True)
            if there
        }
        outputs = dict(zip(one.outputs, one.output_columns[0].tolist(), strict=True))
        kind = "strip" if one.kind[0] == "strip" else "flow"
        return Point(one.time.tolist()[0], str(one.mode[0]), int(one.jump[0]), kind, state, outputs)

    def sample(self, times: Any, side: Side = "right", columns: Sequence[str] | None = None) -> Samples:
        """Return the values at many times, given in any order.

        Parameters
        ----------
        times : numbers
            Within :attr:`time_span`, or outside it by at most the tie tolerance.
        side : {"right", "left"}
            At a jump, also of a strict event: the value after the last transition at that instant, or before the first.
        columns : names, optional
            States and outputs in the file; by default all.

        Raises ValueError: for a time outside the run; the message names the first such time.
        Raises UsageError: for a name that is neither a state nor an output.
        """
        return sample(self, times, side, columns)

    def rows(self) -> Samples:
        """Return the recorded rows, two at each jump, without rows that repeat the row above."""
        return evaluate(self, np.arange(len(self.times))[_changes(self)], self.times[_changes(self)])

    def to_pandas(self) -> Any:
        """Make a pandas DataFrame of :meth:`rows`: ``time``, ``mode``, ``j``, and :attr:`shown`.

        Raises UsageError: when pandas is not installed.
        """
        return self.rows().only(self.shown).to_pandas()

    def save(
        self,
        path: str | os.PathLike[str],
        samples: Any | None = None,
        columns: Sequence[str] | None = None,
        jumps: str = "both",
    ) -> tuple[Path, ...]:
        """Save to ``.npz`` (everything, without loss), or to ``.csv`` or ``.parquet`` (a table, with a JSON
        sidecar).

        Files are written under another name and then renamed, so that a failure keeps existing files.

        Parameters
        ----------
        path : path
            The suffix chooses the format.
        samples : times, optional
            For a table: rows at these times and at jumps, instead of the integrator's rows. Times outside the run are
            skipped (a run may stop early). The default is the run's own :attr:`sample_times`.
        columns : names, optional
            For a table: its states and outputs, in this order; by default those of :attr:`shown`.
        jumps : "both", "after" or "none"
            For a table: the rows of a jump. ``both`` are the row before it and the row after it, at the same time.
            With ``after`` no two rows have the same time. With ``none`` there are rows at ``samples`` only.

        Returns
        -------
        tuple of Path
            The files written.

        Raises UsageError: for an unknown suffix or column, a file that cannot be written, or a missing library.
        """
        samples = self.sample_times if samples is None else samples
        return shown("save", self, path, samples=samples, columns=columns, jumps=jumps)

    @property
    def sample_times(self) -> Array | None:
        """The times in the run's ``samples`` setting; None for the integrator's rows."""
        given = self.settings.get("samples")
        if isinstance(given, int):
            until = self.settings["until"]
            return np.array([until * k / (given - 1) for k in range(given - 1)] + [until])
        return None if given is None else np.array(given)


def _changes(execution: Execution) -> Array:
    """Mark all rows except the first of an arc that continues exactly from the end of the arc before it."""
    keep = np.ones(len(execution.times), dtype=bool)
    for before, after in zip(execution.arcs, execution.arcs[1:], strict=False):
        if (before.mode, before.jump, before.states) == (after.mode, after.jump, after.states):
            last, first = before.last, after.first
            keep[first] = not (
                same(execution.values[last], execution.values[first])
                and same(execution.outputs[last], execution.outputs[first])
            )
    return keep
