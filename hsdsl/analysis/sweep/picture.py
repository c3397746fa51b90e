# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
"""Pictures of a sweep: what one shows, checked before anything is run, and drawn from the dataset.

A column of lists gives a bifurcation diagram over one name, samples give curves over time. A column of numbers or words
gives a curve over one name, a map over two. Of more names a slice is drawn, where grids have one value each, and draws
are near one.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from hsdsl.analysis.sweep.manifest import LISTS, Manifest, column_of, schema
from hsdsl.base.errors import UsageError
from hsdsl.base.names import SINCE, called, did_you_mean, shown
from hsdsl.engine.execution import Array

if TYPE_CHECKING:
    from hsdsl.analysis.plot.analyses import Axis
    from hsdsl.analysis.sweep.dataset import Sweep

TIME, SAMPLED = "time", "sample.time"
NEAR = 0.1  # of all rows, that a slice of a draw has
TIMES = {"transition": "transition.time", "before": "transition.time", "after": "transition.time"}


@dataclass(frozen=True)
class Picture:
    """What is drawn of a sweep, as the options of `Sweep.plot`; without ``of`` it is :func:`telling` that chooses."""

    of: str | None = None
    tail: float = 0.5
    over: str | None = None
    at: Mapping[str, float] = field(default_factory=dict[str, float])

    def check(self, manifest: Manifest) -> None:
        """Refuse what no dataset of this manifest could show.

        Raises UsageError: no such column, one that cannot be drawn, a name without a grid, or more names than axes.
        """
        if self.over not in (None, TIME):
            reason = f"--over: expected {TIME}, got '{shown(self.over)}'"
            raise UsageError(reason, "pictures are over what varies without it")
        if not 0 < self.tail <= 1:
            raise UsageError(f"--tail: expected a share above 0 and up to 1, got {self.tail:g}")
        names, columns = manifest.variation.names, list(schema(manifest).names)
        column, fixed = self._named(columns), self.slice(manifest)
        free = [name for name in names if name not in fixed]
        listed = (column or "").partition(".")[0] in LISTS
        if column and (
            column not in columns or column in ("row", "message", "verdict.reasons", *map(column_of, names))
        ):
            raise UsageError(f"--of: the sweep has no column '{column}' to draw", _hint(columns, column))
        if self.over and not _is_sampled(column or ""):
            raise UsageError(f"--over {TIME}: '{column}' has no samples", "choose one with --of sample.NAME")
        if not self.over and len(free) > (1 if listed else 2):
            most = "a bifurcation diagram shows one varied name" if listed else "a map shows two varied names"
            values = {grid.name: f"{grid.values[0]:g}" for grid in manifest.variation.grids}
            last = next((name for name in reversed(free) if name in values), free[-1])
            hint = f"draw a slice: --slice {last}={values.get(last, 'VALUE')}"
            raise UsageError(f"{most}, got {', '.join(free)}", hint)

    def _named(self, columns: list[str]) -> str | None:
        """The column, where it follows without the numbers of the dataset."""
        return self.of or (next((c for c in columns if _is_sampled(c)), "sample.x") if self.over else None)

    def slice(self, manifest: Manifest) -> dict[str, float]:
        """The values of grids nearest to those given, and those of draws as they are.

        Raises UsageError: a name that does not vary, a value beyond its grid, or no name left.
        """
        found: dict[str, float] = {}
        grids = {grid.name: grid.values for grid in manifest.variation.grids}
        for name, value in self.at.items():
            if name not in manifest.variation.names:
                hint = did_you_mean(name, manifest.variation.names)
                raise UsageError(f"--slice: nothing varies '{shown(name)}'", hint)
            if name not in grids:
                found[name] = value
                continue
            values = np.array(grids[name])
            if not values.min() <= value <= values.max():
                raise UsageError(f"--slice {name}: expected {values.min():g} to {values.max():g}, got {value:g}")
            found[name] = float(values[np.argmin(np.abs(values - value))])
        if len(found) == len(manifest.variation.names):
            raise UsageError("--slice: nothing varies in this slice", "leave a name out")
        return found

    def draw(self, sweep: Sweep, path: str | os.PathLike[str]) -> None:
        """Draw it.

        Raises UsageError: as :meth:`check`, or there is nothing to draw.
        """
        from hsdsl.analysis.plot import analyses as plots
        from hsdsl.analysis.plot.style import time_label

        self.check(sweep.manifest)
        fixed = self.slice(sweep.manifest)
        column = self._named(sweep.columns) or telling(sweep)
        unit = sweep.manifest.units.get("t" if column.endswith(".time") else column.rpartition(".")[2])
        label = f"{column} [{unit}]" if unit else column
        drawn = {each.name for each in sweep.manifest.variation.draws}
        at = [f"{name} {'near' if name in drawn else '='} {value:g}" for name, value in fixed.items()]
        title = ", ".join([called(sweep.manifest.title, sweep.manifest.model), *at])
        rows = np.ones(sweep.done, bool)
        for name, value in fixed.items():
            rows &= _nearest(sweep[name], value) if name in drawn else sweep[name] == value
        axes = [_axis(sweep, name, rows) for name in sweep.manifest.variation.names if name not in fixed]
        if self.over:
            curves = [each for each, kept in zip(_curves(sweep, column), rows, strict=True) if kept]
            plots.plot_family(path, curves, axes[0], label, title, time_label(sweep.manifest.units))
        elif column.partition(".")[0] in LISTS:
            values, where = _dots(sweep, column, self.tail)
            values, where = values[rows[where]], (np.cumsum(rows) - 1)[where[rows[where]]]
            if not len(values):
                hint = "draw whole runs with --tail 1" if self.tail < 1 else ""
                raise UsageError(f"--of {column}: there is none in the last {self.tail:g} of each run", hint)
            plots.plot_dots(path, axes[0], plots.Quantity(label, values), where, title)
        else:
            numbers = sweep[column][rows]
            quantity = plots.Quantity(label, numbers if numbers.dtype == object else numbers.astype(float))
            if len(axes) == 1:
                plots.plot_curve(path, axes[0], quantity, title)
            else:
                plots.plot_map(path, axes[0], axes[1], quantity, title)


def _nearest(values: Array, value: float) -> Array:
    """Whether each number is in the tenth that is nearest to a value."""
    off = np.abs(values - value)
    return off <= np.quantile(off, NEAR)


def telling(sweep: Sweep) -> str:
    """The column that is drawn where none is named.

    Where transitions were recorded over one name, it is the state before them that they change most, relative to its
    size, but no time in a mode, and none of whole numbers, as of modes and counters; else the number of transitions.
    """
    states = [name for name in sweep.manifest.states if name.rpartition(".")[2] != SINCE]
    if not (sweep.manifest.recording.transitions and len(sweep.manifest.variation.names) == 1 and states):
        return "transitions"
    changes, whole = np.zeros(len(states)), np.ones(len(states), dtype=bool)
    for table in sweep.batches([f"{side}.{state}" for state in states for side in ("before", "after")]):
        for k, state in enumerate(states):
            before, after = (_flat(table, f"{side}.{state}") for side in ("before", "after"))
            known = np.isfinite(before) & np.isfinite(after) & (before != after)
            whole[k] &= bool((before[known] % 1 == 0).all() and (after[known] % 1 == 0).all())
            before, after = before[known], after[known]
            changes[k] += (np.abs(after - before) / np.maximum(np.abs(before), np.abs(after))).sum()
    changes[whole] = 0.0
    return f"before.{states[int(np.argmax(changes))]}" if changes.any() else "transitions"


def _flat(table: Any, column: str) -> Array:
    """The numbers in all lists of a column."""
    return table.column(column).combine_chunks().flatten().to_numpy(zero_copy_only=False)


def _hint(columns: list[str], column: str) -> str | None:
    first = column.partition(".")[0]
    if first in LISTS:
        return f"record it: --record {'outputs:every=TIME' if first == 'sample' else 'transitions'}"
    return did_you_mean(column, columns)


def _axis(sweep: Sweep, name: str, rows: Array) -> Axis:
    from hsdsl.analysis.plot.analyses import Axis

    manifest: Manifest = sweep.manifest
    grid = next((grid for grid in manifest.variation.grids if grid.name == name), None)
    drawn = next((each for each in manifest.variation.draws if each.name == name), None)
    unit = manifest.units.get(name.removeprefix("initial."))
    logarithmic = grid.logarithmic if grid else drawn is not None and drawn.distribution.startswith("log")
    label = f"{name} [{unit}]" if unit else name
    return Axis(label, sweep[name][rows], grid and grid.values, logarithmic)


def _is_sampled(column: str) -> bool:
    return column.startswith("sample.") and column != SAMPLED


def _curves(sweep: Sweep, column: str) -> list[tuple[Array, Array]]:
    """The times and the values of the samples of each row."""
    found: list[tuple[Array, Array]] = []
    for table in sweep.batches([SAMPLED, column]):
        counts = table.column(SAMPLED).combine_chunks().value_lengths().fill_null(0).to_numpy().astype(int)
        ends = np.cumsum(counts)[:-1]
        found += zip(np.split(_flat(table, SAMPLED), ends), np.split(_flat(table, column), ends), strict=True)
    return found


def _dots(sweep: Sweep, column: str, tail: float) -> tuple[Array, Array]:
    """The numbers of lists in the last part of each run, and the row of each among those that there are."""
    times = TIMES.get(column.partition(".")[0], SAMPLED)
    values: list[Any] = [np.empty(0)]
    where, rows = [np.empty(0, int)], 0
    for table in sweep.batches(list(dict.fromkeys([column, times, "time"]))):
        counts = table.column(times).combine_chunks().value_lengths().fill_null(0).to_numpy().astype(int)
        row, ends = np.repeat(np.arange(table.num_rows), counts), table.column("time").to_numpy()
        late = _flat(table, times) >= (1 - tail) * ends[row]
        values.append(_flat(table, column)[late])
        where.append(row[late] + rows)
        rows += table.num_rows
    return np.concatenate(values), np.concatenate(where)
